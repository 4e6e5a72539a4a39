"""The camera's picture as the tracker of hero_localization publishes it, from straight above. Pure.

It lies under the robots if the map is in its frame; otherwise the page shows it beside them. It is some 0.1 s old when
it comes, more on a busy computer: the page draws robots on it where they were when it was taken.
"""

import math
from typing import Any, Dict, List, Optional

from hero_client.values import StampedHistory, interpolate_pose
from hero_node import Pose

from .page_state import MAX_DISTANCE_M, encode_pose

JPEG_START = b"\xff\xd8"
BYTES_MAX = 2000000
"""Size of a picture; the tracker's have some 100 kB."""

PERIOD_S = 0.2
"""Time between two pictures that pages fetch, however many are published."""

JPEGS_KEPT = 5
"""A page on a busy computer asks for one when newer ones have come: the robots it was told of are on no other."""

SILENT_S = 3.0
"""The tracker publishes five pictures a second; an older one shows no robot where it is."""

KEPT_S = 5.0
"""Time for which each robot's poses are kept."""

AHEAD_S = 0.1
"""A robot's newest pose shows where it was this long after it."""


class CameraPicture:
    """The newest pictures, by number."""

    def __init__(self) -> None:
        self._number = 0
        self._jpegs: Dict[int, bytes] = {}
        self._received_s = -math.inf
        self._frame = ""
        self._box_mm: Optional[List[int]] = None
        self._stamp_s = -math.inf
        self._histories: Dict[str, StampedHistory[Pose]] = {}

    def receive(self, picture: Any, now_s: float) -> None:
        """Take a sensor_msgs/CompressedImage, unless it comes too soon, or no browser can show it."""
        if now_s < self._received_s + PERIOD_S:
            return
        data = bytes(picture.data)
        if data.startswith(JPEG_START) and len(data) <= BYTES_MAX:
            self._number += 1
            self._jpegs[self._number] = data
            self._jpegs.pop(self._number - JPEGS_KEPT, None)
            self._received_s = now_s
            self._stamp_s = picture.header.stamp.to_sec()

    def find_jpeg(self, number: int) -> bytes:
        """Return a picture by the number that describe() tells; empty if it is gone."""
        return self._jpegs.get(number, b"")

    def receive_outline(self, outline: Any) -> None:
        """Take the places of the picture's corners: a geometry_msgs/PolygonStamped."""
        xs, ys = ([getattr(point, axis) for point in outline.polygon.points] for axis in "xy")
        is_known = len(xs) == 4 and all(abs(value) <= MAX_DISTANCE_M for value in xs + ys)
        self._box_mm = [round(1e3 * value) for value in (min(xs), min(ys), max(xs), max(ys))] if is_known else None
        self._frame = outline.header.frame_id.lstrip("/")

    def follow(self, name: str, stamp_s: float, pose: Pose) -> None:
        """Remember a robot's pose in the common frame."""
        self._histories.setdefault(name, StampedHistory(KEPT_S, interpolate_pose)).add(stamp_s, pose)

    def describe(self, map_frame: str, now_s: float) -> Optional[Dict[str, Any]]:
        """Return the picture's number and box, and where robots were when it was taken; None without a picture.

        box: x min, y min, x max, y max in mm; None if its place on this map is unknown.
        """
        if now_s > self._received_s + SILENT_S:
            self._jpegs.clear()
            return None
        if self._frame != map_frame or self._box_mm is None:
            return {"number": self._number, "box": None, "poses": {}}
        poses = {name: encode_pose(self._find_pose(history)) for name, history in self._histories.items()}
        known = {name: pose for name, pose in poses.items() if pose is not None}
        return {"number": self._number, "box": self._box_mm, "poses": known}

    def _find_pose(self, history: StampedHistory[Pose]) -> Optional[Pose]:
        """Return where a robot was when the picture was taken, None if that is not known."""
        is_ahead = history.newest_s <= self._stamp_s <= history.newest_s + AHEAD_S
        return history.newest if is_ahead else history.find(self._stamp_s)
