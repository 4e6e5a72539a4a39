"""Notes which user drove, stopped or released: lines of the log, and a CSV file per day in ROS_HOME/hero_monitor."""

import csv
import time
from pathlib import Path
from typing import Dict, Sequence, Tuple

import rospkg
import rospy

from ..background import Background

QUIET_S = 10.0
"""A button that is pressed again and again is one drive until it was let go for this time."""

COLUMNS = ("time", "user", "request", "robots")


class Activity:
    """The users' requests; methods return at once."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._drives: Dict[Tuple[str, Tuple[str, ...]], float] = {}

    def note_drive(self, user: str, robots: Sequence[str]) -> None:
        """Note that a user drives robots, unless that was going on."""
        now_s = time.monotonic()
        self._drives = {key: last_s for key, last_s in self._drives.items() if now_s - last_s <= QUIET_S}
        key = (user, tuple(robots))
        if key not in self._drives:
            self.note(user, "drive", robots)
        self._drives[key] = now_s

    def note(self, user: str, request: str, robots: Sequence[str] = ()) -> None:
        """Note a request, also in the file."""
        row = (time.strftime("%Y-%m-%dT%H:%M:%S"), user, request, " ".join(robots))
        if request in ("stop", "release"):
            self._background.warn(f"{user}: {request} all robots")
        else:
            self._background.inform(f"{user}: {request} {' '.join(robots)}".strip())
        self._background.submit(_write, row)


def _write(row: Sequence[str]) -> None:
    path = Path(rospkg.get_ros_home()) / "hero_monitor" / f"requests_{row[0][:10]}.csv"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        is_new = not path.exists()
        with path.open("a", encoding="utf-8", newline="") as opened:
            csv.writer(opened).writerows([COLUMNS, row] if is_new else [row])
    except OSError as error:
        rospy.logwarn_throttle(60.0, f"{path} cannot be written ({error.strerror}): who drives is in the log only")
