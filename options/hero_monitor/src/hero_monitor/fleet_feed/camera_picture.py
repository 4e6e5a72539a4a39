"""The camera's picture as the tracker of hero_localization publishes it, from straight above. Pure.

It lies under the robots while the map is in its frame.
"""

import math
from typing import Any, Dict, List, Optional

from .page_state import MAX_DISTANCE_M

JPEG_START = b"\xff\xd8"
BYTES_MAX = 2000000
"""Size of a picture; the tracker's have some 100 kB."""

PERIOD_S = 0.2
"""Time between two pictures that pages fetch, however many are published."""

SILENT_S = 3.0
"""The tracker publishes five pictures a second; an older one shows no robot where it is."""


class CameraPicture:
    """The newest picture.

    Attributes:
        jpeg: its file; empty without one.
    """

    def __init__(self) -> None:
        self.jpeg = b""
        self._number = 0
        self._received_s = -math.inf
        self._frame = ""
        self._box_mm: Optional[List[int]] = None

    def receive(self, picture: Any, now_s: float) -> None:
        """Take a sensor_msgs/CompressedImage, unless it comes too soon, or no browser can show it."""
        data = bytes(picture.data)
        if now_s >= self._received_s + PERIOD_S and data.startswith(JPEG_START) and len(data) <= BYTES_MAX:
            self.jpeg, self._received_s = data, now_s
            self._number += 1

    def receive_outline(self, outline: Any) -> None:
        """Take the places of the picture's corners: a geometry_msgs/PolygonStamped."""
        xs, ys = ([getattr(point, axis) for point in outline.polygon.points] for axis in "xy")
        is_known = len(xs) == 4 and all(abs(value) <= MAX_DISTANCE_M for value in xs + ys)
        self._box_mm = [round(1e3 * value) for value in (min(xs), min(ys), max(xs), max(ys))] if is_known else None
        self._frame = outline.header.frame_id.lstrip("/")

    def describe(self, map_frame: str, now_s: float) -> Optional[Dict[str, Any]]:
        """Return the picture's number and box (x min, y min, x max, y max in mm); None without one for this map."""
        if now_s > self._received_s + SILENT_S:
            self.jpeg = b""
        if not self.jpeg or self._box_mm is None or self._frame != map_frame:
            return None
        return {"number": self._number, "box": self._box_mm}
