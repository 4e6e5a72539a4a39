"""A small disk of a test's own: it can be filled whatever else uses the machine's disks."""

import os
import subprocess
import unittest

MOUNT = 'mount -t tmpfs -o size="$1" small "$2" && echo mounted && exec cat'


class SmallDisk:
    """A disk in memory, until close(); its files are below `path`.

    It is mounted for one process only, so that nothing of it stays behind whatever ends the test; others reach it
    through that process. Raises: unittest.SkipTest where the system permits no mounts of one's own.
    """

    def __init__(self, folder, size):
        """folder: an empty one to mount it on. size: as mount takes it, such as 32k."""
        self._holder = subprocess.Popen(
            ["unshare", "--mount", "--propagation", "private", "sh", "-c", MOUNT, "sh", size, str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        if self._holder.stdout.readline() != b"mounted\n":
            self.close()
            raise unittest.SkipTest(
                "this system lets no test have mounts of its own (unshare --mount): run it as root, not in a chroot"
            )
        self.path = "/proc/%d/root%s" % (self._holder.pid, folder)

    def take(self, size):
        """Take this many bytes, or all that are left."""
        with open(os.path.join(self.path, "filler"), "wb", buffering=0) as filler:
            filler.write(bytes(size))  # as many as there is room for

    def close(self):
        """Give it back once no program uses it any more."""
        self._holder.kill()
        self._holder.communicate()
