"""Page state, in named parts of JSON, of which each page gets those that are new to it: its updates. Pure.

Every part is complete in itself: a page that missed some needs none of them to understand the next. Lengths are
integers in mm and angles in mrad: short, and finer than a screen can show.
"""

import json
import math
from collections import deque
from typing import Any, Deque, Dict, List, Optional, Tuple

from hero_node import Pose, make_printable

MAX_LINE_LENGTH = 400
LOG_LINES_KEPT = 500
"""Lines that a new page gets."""

LOG_LINES_AT_ONCE = 100
"""Lines in one message; a slow page gets the newest, and the number of those it missed."""

MAX_DISTANCE_M = 10000.0
"""Coordinates and sizes beyond this are not drawn: the map would show nothing but an endless grid."""

MAX_RIM_RANGE_M = 100.0


def encode(value: Any) -> str:
    """Return a value as short JSON."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def shorten(text: str) -> str:
    """Return a text cut to MAX_LINE_LENGTH, without unprintable characters."""
    return make_printable(text if len(text) <= MAX_LINE_LENGTH else text[: MAX_LINE_LENGTH - 3] + "...")


def encode_pose(pose: Optional[Pose]) -> Optional[List[int]]:
    """Return a pose as mm, mm, mrad; None without one, or if it cannot be drawn."""
    if pose is None or not all(abs(value) <= MAX_DISTANCE_M for value in pose):
        return None
    return [round(value * 1000.0) for value in pose]


def encode_range(range_m: float) -> Optional[int]:
    """Return a proximity range in mm: None for nothing in range, 0 for contact, -1 for an invalid reading."""
    if 0.0 <= range_m <= MAX_RIM_RANGE_M:
        return round(range_m * 1000.0)
    return None if range_m == math.inf else -1


def encode_color(red: float, green: float, blue: float) -> Optional[str]:
    """Return a color as #rrggbb; None for a dark light or an invalid color."""
    parts = [red, green, blue]
    if not all(map(math.isfinite, parts)):
        return None
    numbers = [round(255 * min(1.0, max(0.0, part))) for part in parts]
    return "#%02x%02x%02x" % tuple(numbers) if any(numbers) else None


class LogRing:
    """The newest lines of /rosout, each with its number of all since the start."""

    def __init__(self) -> None:
        self.count = 0
        self._lines: Deque[Tuple[Any, ...]] = deque(maxlen=LOG_LINES_KEPT)

    def append(self, time_s: float, level: int, node: str, robot: str, text: str) -> None:
        """Add a line, made printable. level: as in rosgraph_msgs/Log; robot: that it concerns, empty for none."""
        self.count += 1
        self._lines.append((self.count, round(time_s, 3), level, shorten(node), robot, shorten(text)))

    def skip(self, count: int) -> None:
        """Count lines that were dropped unread."""
        self.count += count

    def encode_after(self, number: int) -> str:
        """Return the newest lines after that number as JSON, and how many are missing before them."""
        new = [line for line in self._lines if line[0] > number][-LOG_LINES_AT_ONCE:]
        first = new[0][0] if new else self.count + 1
        return encode({"missed": max(0, first - number - 1) if number else 0, "lines": new})


class PageState:
    """The current state."""

    def __init__(self) -> None:
        self.log = LogRing()
        self._texts: Dict[str, str] = {}

    def put(self, name: str, value: Any) -> bool:
        """Replace a part; return whether it has changed."""
        text = encode(value)
        if self._texts.get(name) == text:
            return False
        self._texts[name] = text
        return True

    def take_updates(self, seen: Dict[str, Any], hidden: str = "") -> Optional[str]:
        """Return what is new to a page as one JSON object, None without any; marks it as seen.

        seen: the parts that the page has, and of the log its last line; empty for a new page. hidden: the part that
        it may not see.
        """
        parts: Dict[str, Any] = {**self._texts, "log": self.log.count}
        new = [name for name in parts if parts[name] != seen.get(name, 0) and name != hidden]
        texts = [parts[name] if name != "log" else self.log.encode_after(seen.get(name, 0)) for name in new]
        seen.update((name, parts[name]) for name in new)
        return "{%s}" % ",".join('"%s":%s' % part for part in zip(new, texts)) if new else None
