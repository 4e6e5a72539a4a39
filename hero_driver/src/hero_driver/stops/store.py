"""The stop of the robots, kept on disk for a driver that is started again under the same name and ROS master.

The name of an empty file says it, NAME.released or NAME.stopped, its time since when. Renaming needs no space: a disk
that has filled up since the driver's start loses no stop.
"""

import os
import platform
import urllib.parse
from typing import Optional

import rospkg

FOLDER = "hero_driver"  # in ROS_HOME
UNKNOWN_TIME_S = 0.0


class StopStore:
    """The file of one driver. Its methods may block."""

    def __init__(self, node: str, master_uri: str) -> None:
        """Take the driver's name in ROS, in which a point cannot occur, and the address of its master."""
        name = f"{node.strip('/').replace('/', '.')}.{_name_master(master_uri)}"
        self._folder = os.path.join(rospkg.get_ros_home(), FOLDER)
        self._released_path = os.path.join(self._folder, name + ".released")
        self.path = os.path.join(self._folder, name + ".stopped")

    def read_since(self) -> Optional[float]:
        """Return since when robots are stopped, s since 1970 or UNKNOWN_TIME_S; None if they are not."""
        try:
            return os.stat(self.path).st_mtime
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError:
            # It cannot be ruled out that they are.
            return UNKNOWN_TIME_S

    def write(self, stopped: bool) -> None:
        """Keep stopped, until it is on the disk; the time of a stop that is kept already stays. Raises: OSError."""
        old, new = (self._released_path, self.path) if stopped else (self.path, self._released_path)
        os.makedirs(self._folder, exist_ok=True)
        try:
            os.utime(old)
            os.rename(old, new)
        except FileNotFoundError:
            with open(new, "ab"):
                pass
        folder = os.open(self._folder, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _name_master(uri: str) -> str:
    """Return host and port of a ROS master; this PC is always called localhost."""
    parts = urllib.parse.urlsplit(uri)
    host = parts.hostname or ""
    if host in ("::1", platform.node().lower()) or host.startswith("127."):
        host = "localhost"
    return f"{host}_{parts.port}"
