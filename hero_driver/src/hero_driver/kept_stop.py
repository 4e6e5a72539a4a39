"""Whether robots are stopped, in a file for a driver that is started again under the same name.

The file exists while they are, and holds the time at which they were stopped.
"""

import contextlib
import os
import time

import rospkg

from hero_node.safe_file import write_file

FOLDER = "hero_driver"  # in ROS_HOME
TIME_FORMAT = "%Y-%m-%d %H:%M:%S"


class KeptStop:
    """The file of one driver. Its methods may block, and raise OSError where the file cannot be used."""

    def __init__(self, node: str) -> None:
        """node is the driver's name in ROS, in which a point cannot occur."""
        self.path = os.path.join(rospkg.get_ros_home(), FOLDER, node.strip("/").replace("/", ".") + ".stopped")

    def read_since(self) -> str:
        """Return since when robots are stopped, empty if they are not."""
        try:
            with open(self.path, encoding="utf-8") as file:
                return file.read(len(time.strftime(TIME_FORMAT))).strip() or "an unknown time"
        except FileNotFoundError:
            return ""
        except (OSError, UnicodeError):
            # There is a file, so they are.
            return "an unknown time"

    def write(self, stopped: bool) -> None:
        """Keep stopped; the time of a stop that is kept already stays."""
        if not stopped:
            with contextlib.suppress(FileNotFoundError):
                os.remove(self.path)
        elif not os.path.exists(self.path):
            os.makedirs(os.path.dirname(self.path), exist_ok=True)
            write_file(self.path, time.strftime(TIME_FORMAT + "\n").encode())
