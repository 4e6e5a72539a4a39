"""Markers of a behavior for RViz and the monitor: beams of its sensors, and its metric as a line over time."""

from collections import deque
from typing import Deque, List, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from hero_client.values import BODY_RADIUS_M

from ..behavior import Behavior, Binary, Sensed, Sight

BEAM_M = 3.0
"""Length at which a beam of endless range is drawn."""

PLOT_S, PLOT_STEP_S = 120.0, 0.5
PLOT_M = (0.8, 0.1)
"""Time, time between points, and size, wide and high, of the metric's line, which scales itself to its values."""

PLOT_GAP_M = 0.06

_FREE_COLOR, _SEEN_COLOR = ColorRGBA(0.4, 0.6, 1.0, 0.5), ColorRGBA(1.0, 0.3, 0.1, 0.9)
_PLOT_COLOR, _AXES_COLOR = ColorRGBA(0.9, 0.5, 0.0, 1.0), ColorRGBA(0.5, 0.5, 0.5, 1.0)


def _has_places(behavior: Behavior, name: str, sensed: Sensed) -> bool:
    """Return whether a sensor looks along a beam, or tells where others are."""
    return isinstance(behavior.sensors()[name], (Binary, Sight)) or hasattr(getattr(sensed, name), "forward_m")


class BehaviorMarkers:
    """The markers of one behavior in one frame."""

    def __init__(self, behavior: Behavior, frame: str, node: str) -> None:
        """node: name of the node, with which names of the markers begin: several behaviors share a topic."""
        self._behavior = behavior
        self._frame, self._node = frame, node
        self._history: Deque[Tuple[float, float]] = deque()
        self._corner: Optional[Tuple[float, float]] = None

    def draw(self, poses: np.ndarray, sensed: Sensed, value: float) -> List[Marker]:
        """Return all markers for poses (R, 3), NaN for unknown ones but not for all, and the metric's value."""
        if not self._history or sensed.time_s >= self._history[-1][0] + PLOT_STEP_S:
            self._history.append((sensed.time_s, value))
        while self._history[0][0] < sensed.time_s - PLOT_S:
            self._history.popleft()
        # Where it was first, or higher: robots that drive into it would hide it.
        left_m, low_m = float(np.nanmean(poses[:, 0])) - PLOT_M[0] / 2.0, float(np.nanmax(poses[:, 1])) + PLOT_GAP_M
        self._corner = (left_m, low_m) if self._corner is None else (self._corner[0], max(self._corner[1], low_m))
        shown = [name for name in self._behavior.sensors() if _has_places(self._behavior, name, sensed)]
        beams = [self._draw_sensor(name, poses, sensed) for name in shown]
        # A metric that needs the arena is not known live.
        return [*beams, *(self._draw_plot(self._corner, sensed.time_s, value) if np.isfinite(value) else ())]

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
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        ends = x_m + cosine * forward_m - sine * left_m, y_m + sine * forward_m + cosine * left_m
        for x, y, end_x, end_y, is_hit in np.column_stack((x_m, y_m, *ends, hits)).tolist():
            marker.points += [Point(x, y, 0.03), Point(end_x, end_y, 0.03)]
            marker.colors += [_SEEN_COLOR if is_hit else _FREE_COLOR] * 2
        return marker

    def _draw_plot(self, corner_m: Tuple[float, float], now_s: float, value: float) -> List[Marker]:
        """Return the metric's line over the last PLOT_S, its axes, and their scale and value as text."""
        (left_m, low_m), (width_m, height_m) = corner_m, PLOT_M
        times_s, values = np.array(self._history).T
        least, most = float(np.nanmin(values)), float(np.nanmax(values))
        x_m = left_m + width_m * (1.0 + (times_s - now_s) / PLOT_S)
        y_m = low_m + height_m * (values - least) / max(most - least, 1e-9)
        line = self._make_marker("metric_line", Marker.LINE_STRIP)
        line.scale.x, line.color = 0.006, _PLOT_COLOR
        line.points = [Point(x, y, 0.02) for x, y in zip(x_m.tolist(), y_m.tolist())]
        axes = self._make_marker("metric_axes", Marker.LINE_STRIP)
        axes.scale.x, axes.color = 0.004, _AXES_COLOR
        axes.points = [
            Point(x, y, 0.02) for x, y in ((left_m, low_m + height_m), (left_m, low_m), (left_m + width_m, low_m))
        ]
        text = self._make_marker("metric", Marker.TEXT_VIEW_FACING)
        text.text = f"{self._behavior.metric} {value:.2f} ({least:.2f} to {most:.2f} in {PLOT_S:.0f} s)"
        text.scale.z, text.color = 0.045, _PLOT_COLOR
        text.pose.position = Point(left_m + width_m / 2.0, low_m + height_m + 0.03, 0.1)
        # RViz draws no line of one point.
        return [axes, text, *([line] if len(line.points) > 1 else [])]
