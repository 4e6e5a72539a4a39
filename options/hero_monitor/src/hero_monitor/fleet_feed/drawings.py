"""Drawings of running behaviors on the map: beams of their sensors, and their metric as a line over time. Pure.

Each behavior sends all of its markers at once; those of one node have names that begin with the node's.
"""

from typing import Any, Dict, List, Tuple

from visualization_msgs.msg import Marker, MarkerArray

from hero_node import Pose

from .page_state import encode_color, encode_pose, shorten

SILENT_S = 2.0
"""Behaviors draw about eight times a second; one that is silent for this long has ended."""

MARKERS_MAX = 20
POINTS_MAX = 2000
"""Points of one marker. The lines between 100 robots that all sense each other would hide the robots."""


class Drawings:
    """The newest drawing of each behavior."""

    def __init__(self) -> None:
        self._newest: Dict[str, Tuple[float, MarkerArray]] = {}

    def receive(self, message: MarkerArray, now_s: float) -> None:
        """Take a message of one behavior."""
        if message.markers:
            self._newest[message.markers[0].ns.rpartition("/")[0]] = now_s, message

    def describe(self, frame: str, now_s: float) -> List[Dict[str, Any]]:
        """Return lines and texts in frame (mm), of behaviors that still run."""
        self._newest = {name: kept for name, kept in self._newest.items() if now_s - kept[0] <= SILENT_S}
        markers = [marker for _, message in self._newest.values() for marker in message.markers[:MARKERS_MAX]]
        return [
            drawn
            for marker in markers
            if marker.header.frame_id == frame and marker.action == Marker.ADD and len(marker.points) <= POINTS_MAX
            for drawn in _encode_marker(marker)
        ]


def _encode_marker(marker: Marker) -> List[Dict[str, Any]]:
    """Return lists of points of one color each, or a text; nothing of what cannot be drawn."""
    if marker.type == Marker.TEXT_VIEW_FACING:
        place = marker.pose.position
        found = encode_pose(Pose(place.x, place.y, marker.scale.z))
        text = {"text": shorten(marker.text), "at": found, "color": encode_rgb(marker.color)}
        return [] if found is None else [text]
    if marker.type not in (Marker.LINE_LIST, Marker.LINE_STRIP):
        return []
    points = [encode_pose(Pose(point.x, point.y, 0.0)) for point in marker.points]
    if marker.type == Marker.LINE_STRIP:
        color = encode_rgb(marker.color)
        return [{"lines": [[place[:2] for place in points if place is not None]], "color": color, "isBeam": False}]
    by_color: Dict[str, List[List[List[int]]]] = {}
    colors = marker.colors if len(marker.colors) == len(points) else [marker.color] * len(points)
    for start, end, color in zip(points[::2], points[1::2], colors[::2]):
        if start is not None and end is not None:
            by_color.setdefault(encode_rgb(color), []).append([start[:2], end[:2]])
    return [{"lines": lines, "color": color, "isBeam": True} for color, lines in by_color.items()]


def encode_rgb(color: Any) -> str:
    """Return a std_msgs/ColorRGBA as #rrggbb."""
    return encode_color(color.r, color.g, color.b) or "#000000"
