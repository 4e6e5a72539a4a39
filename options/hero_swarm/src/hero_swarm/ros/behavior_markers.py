"""Markers of a behavior for RViz and the monitor: beams of its sensors, and its metric as text above the robots."""

from typing import List

import numpy as np
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from hero_client.values import BODY_RADIUS_M

from ..behavior import Behavior, Binary, Sensed, Sight, turn

BEAM_M = 3.0
"""Length at which a beam of endless range is drawn."""

TEXT_GAP_M = 0.09
"""Place of the metric above the robots."""

_FREE_COLOR, _SEEN_COLOR = ColorRGBA(0.4, 0.6, 1.0, 0.5), ColorRGBA(1.0, 0.3, 0.1, 0.9)
_TEXT_COLOR = ColorRGBA(0.9, 0.5, 0.0, 1.0)


class BehaviorMarkers:
    """The markers of one behavior in one frame."""

    def __init__(self, behavior: Behavior, frame: str, node: str) -> None:
        """node: name of the node, with which names of the markers begin: several behaviors share a topic."""
        self._behavior = behavior
        self._frame, self._node = frame, node

    def draw(self, poses: np.ndarray, sensed: Sensed, value: float) -> List[Marker]:
        """Return all markers for poses (R, 3), NaN for unknown ones but not for all, and the metric's value."""
        # Of sensors that look along a beam, or tell where others are.
        beams = [
            self._draw_sensor(name, poses, sensed) for name, sensor in self._behavior.sensors().items()
            if isinstance(sensor, (Binary, Sight)) or hasattr(getattr(sensed, name), "forward_m")
        ]  # fmt: skip
        text = self._make_marker("metric", Marker.TEXT_VIEW_FACING)
        text.text, text.scale.z, text.color = f"{self._behavior.metric} {value:.2f}", 0.045, _TEXT_COLOR
        x_m, y_m = float(np.nanmean(poses[:, 0])), float(np.nanmax(poses[:, 1])) + TEXT_GAP_M
        text.pose.position = Point(x_m, y_m, 0.1)
        # A metric that needs an arena is not known without one.
        return [*beams, *([text] if np.isfinite(value) else [])]

    def _make_marker(self, name: str, kind: int) -> Marker:
        marker = Marker()
        marker.header.frame_id, marker.header.stamp = self._frame, rospy.Time.now()
        marker.ns, marker.type, marker.action = f"{self._node}/{name}", kind, Marker.ADD
        marker.pose.orientation.w = 1.0
        return marker

    def _draw_sensor(self, name: str, poses: np.ndarray, sensed: Sensed) -> Marker:
        """Return lines along the beams, or to what is sensed."""
        marker = self._make_marker(name, Marker.LINE_LIST)
        marker.scale.x = 0.004
        sensor, reading = self._behavior.sensors()[name], getattr(sensed, name)
        if isinstance(sensor, (Binary, Sight)):
            rows = sensed.is_known.nonzero()[0]
            forward_m, left_m, hits = BODY_RADIUS_M + min(sensor.range_m, BEAM_M), 0.0, reading[rows] != 0
        else:
            rows, columns = (reading.seen & sensed.is_known[:, None]).nonzero()
            forward_m, left_m = reading.forward_m[rows, columns], reading.left_m[rows, columns]
            hits = np.zeros(len(rows), dtype=bool)
        x_m, y_m, yaw_rad = poses[rows].T
        ends = turn((forward_m, left_m), yaw_rad) + (x_m, y_m)
        for x, y, end_x, end_y, is_hit in np.column_stack((x_m, y_m, *ends, hits)).tolist():
            marker.points += [Point(x, y, 0.03), Point(end_x, end_y, 0.03)]
            marker.colors += [_SEEN_COLOR if is_hit else _FREE_COLOR] * 2
        return marker
