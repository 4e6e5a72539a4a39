"""Messages of a robot -> what a program wants to know, and colours. Messages are read, never made; no ROS imports.

Source of the ranges' meaning: REP 117.
"""

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

from .control_laws import wrap_angle

COLORS: Dict[str, Tuple[float, float, float]] = {
    "off": (0.0, 0.0, 0.0),
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "yellow": (1.0, 1.0, 0.0),
    "magenta": (1.0, 0.0, 1.0),
    "cyan": (0.0, 1.0, 1.0),
    "white": (1.0, 1.0, 1.0),
    "orange": (1.0, 0.4, 0.0),
}

Color = Union[str, Sequence[float]]


class Velocity(NamedTuple):
    """How the robot moves, in its own frame."""

    linear_m_s: float
    turn_rad_s: float


class Obstacle(NamedTuple):
    """The nearest thing that a proximity sensor sees."""

    range_m: float
    """From the robot's centre."""
    bearing_rad: float
    """Counter-clockwise from straight ahead, -pi..pi."""


def parse_color(color: Color) -> Tuple[float, float, float]:
    """Return (red, green, blue), each 0..1.

    Raises: ValueError with the names that are known.
    """
    if isinstance(color, str):
        if color not in COLORS:
            raise ValueError("no colour %r; there are: %s" % (color, ", ".join(COLORS)))
        return COLORS[color]
    values = [float(value) for value in color]
    if len(values) != 3 or not all(0.0 <= value <= 1.0 for value in values):
        raise ValueError("a colour is a name or three numbers 0..1, not %r" % (color,))
    return values[0], values[1], values[2]


def yaw_of(orientation: Any) -> float:
    """Return the turn about z, -pi..pi, of a geometry_msgs/Quaternion; nan for what is no quaternion."""
    return math.atan2(
        2.0 * (orientation.w * orientation.z + orientation.x * orientation.y),
        1.0 - 2.0 * (orientation.y * orientation.y + orientation.z * orientation.z),
    )


def front_first(scan: Any) -> List[float]:
    """Return the ranges of a sensor_msgs/LaserScan starting straight ahead, with -inf (REP 117: too close) as 0.0."""
    count = len(scan.ranges)
    if count == 0 or scan.angle_increment <= 0.0:
        return []
    front = int(round(-scan.angle_min / scan.angle_increment))
    return [
        0.0 if scan.ranges[(front + index) % count] == -math.inf else scan.ranges[(front + index) % count]
        for index in range(count)
    ]


def nearest_obstacle(ranges: Sequence[float]) -> Optional[Obstacle]:
    """Return the nearest of ranges that start straight ahead and go round counter-clockwise, None if all are free."""
    seen = [(range_m, index) for index, range_m in enumerate(ranges) if math.isfinite(range_m)]
    if not seen:
        return None
    range_m, index = min(seen)
    return Obstacle(range_m, wrap_angle(index * 2.0 * math.pi / len(ranges)))
