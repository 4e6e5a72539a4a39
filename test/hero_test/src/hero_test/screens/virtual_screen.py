"""A virtual screen (Xvfb), and what is drawn on it as an array.

Xvfb keeps its screen in a file in the format of xwd (X11/XWDFile.h): numbers of 32 bits, big end first, then pixels.
"""

import os
import shutil
import struct
import subprocess
import tempfile

import numpy as np

MISSING = [name for name in ("Xvfb", "rviz") if shutil.which(name) is None]
HEADER_SIZE, WIDTH, HEIGHT, BITS_PER_PIXEL, BYTES_PER_LINE, COLORS = 0, 4, 5, 11, 12, 19  # places of the numbers
COLOR_LENGTH = 12


class VirtualScreen:
    """A screen of its own, until close()."""

    def __init__(self, width, height):
        self._folder = tempfile.TemporaryDirectory()
        read_fd, write_fd = os.pipe()
        self._process = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write_fd), "-screen", "0", "%dx%dx24" % (width, height)]
            + ["-fbdir", self._folder.name, "-nolisten", "tcp", "-nocursor"],
            pass_fds=[write_fd],
            stderr=subprocess.DEVNULL,
        )
        os.close(write_fd)
        with os.fdopen(read_fd) as answer:
            self.display = ":" + answer.readline().strip()

    def environment(self):
        """Return the environment for programs that draw on it."""
        return dict(os.environ, DISPLAY=self.display, LIBGL_ALWAYS_SOFTWARE="1", QT_X11_NO_MITSHM="1")

    def read(self):
        """Return what is on the screen now: an array (height, width, 3) of red, green and blue, 0..255."""
        with open(os.path.join(self._folder.name, "Xvfb_screen0"), "rb") as file:
            data = file.read()
        numbers = struct.unpack(">25I", data[:100])
        assert numbers[BITS_PER_PIXEL] == 32, "a screen of another kind than was asked for"
        start = numbers[HEADER_SIZE] + numbers[COLORS] * COLOR_LENGTH
        lines = np.frombuffer(data, np.uint8, numbers[HEIGHT] * numbers[BYTES_PER_LINE], start)
        pixels = lines.reshape(numbers[HEIGHT], -1, 4)[:, : numbers[WIDTH]]
        return pixels[:, :, 2::-1].copy()

    def close(self):
        self._process.terminate()
        self._process.wait()
        self._folder.cleanup()
