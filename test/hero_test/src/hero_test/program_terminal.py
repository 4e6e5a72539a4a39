"""Programs in terminals of their own, and the program fleet without one."""

import contextlib
import fcntl
import os
import pty
import signal
import struct
import subprocess
import termios
import threading

from hero_test.processes import find_program
from hero_test.waiting import TIMEOUT_S, wait_for


def run_fleet(*arguments, **options):
    """Run fleet; return its exit code, output and errors."""
    streams = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    command = [find_program("hero_tools", "fleet"), *arguments]
    result = subprocess.run(command, timeout=TIMEOUT_S, check=False, **{**streams, **options})
    return result.returncode, (result.stdout or b"").decode(), result.stderr.decode()


class ProgramTerminal:
    """A terminal with a program, which is read all the time: a program whose output is not read blocks."""

    def __init__(self, package, program, *arguments):
        self._leader, self._follower = pty.openpty()
        fcntl.ioctl(self._follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 200, 0, 0))
        self.settings_before = self.settings()
        streams = {"stdin": self._follower, "stdout": self._follower, "stderr": self._follower}
        self.process = subprocess.Popen([find_program(package, program), *arguments], **streams, start_new_session=True)
        self.output = bytearray()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        # The end of a terminal is an error (EIO).
        with contextlib.suppress(OSError):
            while True:
                self.output += os.read(self._leader, 65536)

    def settings(self):
        return termios.tcgetattr(self._follower)

    def press(self, keys):
        os.write(self._leader, keys)

    def wait_for(self, text, start=0):
        """Wait for text in the output from start on."""
        wait_for(
            lambda: text in self.output[start:],
            lambda: f"{text!r} in {bytes(self.output[start:][-2000:])!r}",
        )

    def wait_for_next(self, text):
        """Wait for text in what is drawn from now on."""
        self.wait_for(text, len(self.output))

    def wait_for_end(self):
        """Wait until the program has ended; return its exit code."""
        return self.process.wait(TIMEOUT_S)

    def close(self):
        """End everything."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        os.close(self._follower)
        self._reader.join()
        os.close(self._leader)
