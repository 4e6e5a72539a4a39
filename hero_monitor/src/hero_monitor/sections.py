"""The fleet as numbered pieces of JSON, so that each page gets what is new to it and no more. Pure.

Every piece is whole in itself: a page that was too slow for some of them needs none of those to understand the next.
Lengths travel in mm and angles in mrad, as whole numbers: short, and finer than anybody can see.
"""

import json
import math
from collections import deque
from typing import Any, Deque, Dict, List, NamedTuple, Optional, Sequence

from hero_client.command_line import make_printable
from hero_client.fleet_state import Pose

LONGEST_LINE = 400
LOG_LINES_KEPT = 500
"""What a page that opens now can still read."""

LOG_LINES_AT_ONCE = 100
"""The most lines in one message: a slow page gets the newest, and is told how many it missed."""


FARTHEST_M = 10000.0
"""Coordinates and sizes beyond this are not drawn: a map of them would show nothing, and its grid would never end."""

FARTHEST_RANGE_M = 100.0


class LogLine(NamedTuple):
    """One line of /rosout."""

    number: int  # counts all lines from the start
    time_s: float
    level: int  # as in rosgraph_msgs/Log: 1 debug, 2 info, 4 warn, 8 error, 16 fatal
    node: str
    robot: str  # which robot it is about; empty if none
    text: str


def encode(value: Any) -> str:
    """Return a value as short JSON."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def shorten(text: str) -> str:
    """Return a text of at most LONGEST_LINE characters, without what cannot be printed."""
    return make_printable(text if len(text) <= LONGEST_LINE else text[: LONGEST_LINE - 3] + "...")


def encode_pose(pose: Optional[Pose]) -> Optional[List[int]]:
    """Return a pose as mm, mm, mrad; None for none, and for one that cannot be drawn."""
    if pose is None or not all(abs(value) <= FARTHEST_M for value in pose):
        return None
    return [round(value * 1000.0) for value in pose]


def encode_ranges(ranges_m: Sequence[float]) -> List[Optional[int]]:
    """Return proximity ranges in mm: None where nothing is, 0 where it touches, -1 where the sensor says nothing."""
    return [encode_range(range_m) for range_m in ranges_m]


def encode_range(range_m: float) -> Optional[int]:
    """Return one range; see encode_ranges. -Inf, +Inf and NaN are those of REP 117."""
    if abs(range_m) <= FARTHEST_RANGE_M:
        return max(0, round(range_m * 1000.0))
    if math.isinf(range_m):
        return None if range_m > 0 else 0
    return -1


def encode_colour(red: float, green: float, blue: float) -> Optional[str]:
    """Return a colour as #rrggbb, None for a light that is dark or a colour that is none."""
    parts = [red, green, blue]
    if not all(map(math.isfinite, parts)):
        return None
    numbers = [round(255 * min(1.0, max(0.0, part))) for part in parts]
    return "#%02x%02x%02x" % tuple(numbers) if any(numbers) else None


class LogRing:
    """The newest lines of the log."""

    def __init__(self) -> None:
        self.count = 0
        self._lines: Deque[LogLine] = deque(maxlen=LOG_LINES_KEPT)

    def append(self, time_s: float, level: int, node: str, robot: str, text: str) -> None:
        """Take a line, without what cannot be printed."""
        self.count += 1
        self._lines.append(LogLine(self.count, round(time_s, 3), level, shorten(node), robot, shorten(text)))

    def skip(self, count: int) -> None:
        """Count lines that nobody had the time to read."""
        self.count += count

    def encode_after(self, number: int) -> str:
        """Return the lines after that one as JSON: the newest of them, and how many are missing before."""
        new = [line for line in self._lines if line.number > number][-LOG_LINES_AT_ONCE:]
        first = new[0].number if new else self.count + 1
        return encode({"missed": max(0, first - number - 1) if number else 0, "lines": new})


class Page:
    """What one page has got already."""

    def __init__(self) -> None:
        self.versions: Dict[str, int] = {}
        self.log_number = 0


class Sections:
    """The pieces as they are now."""

    def __init__(self) -> None:
        self.log = LogRing()
        self._texts: Dict[str, str] = {}
        self._versions: Dict[str, int] = {}

    def put(self, name: str, value: Any) -> bool:
        """Replace a piece; return whether it differs from the one before: only then is it new."""
        text = encode(value)
        if self._texts.get(name) == text:
            return False
        self._texts[name] = text
        self._versions[name] = self._versions.get(name, 0) + 1
        return True

    def take_news(self, page: Page) -> Optional[str]:
        """Return all that is new to a page as one JSON object, None if nothing is; it counts as got."""
        parts = [
            '"%s":%s' % (name, self._texts[name])
            for name, version in self._versions.items()
            if page.versions.get(name) != version
        ]
        page.versions = dict(self._versions)
        if page.log_number < self.log.count:
            parts.append('"log":%s' % self.log.encode_after(page.log_number))
            page.log_number = self.log.count
        return "{%s}" % ",".join(parts) if parts else None
