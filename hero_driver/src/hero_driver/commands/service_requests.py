"""Checks service requests before they reach a robot, which checks nothing itself. Pure: bytes in, words out.

The firmware prints values into 100 bytes (VelocityControl.ino:209), and stores them in its flash.
"""

import math
import struct
from typing import NamedTuple, Optional

from hero_node import Pose
from hero_node.robot_constants import PULSE_RANGE_US

_SET_ODOM = struct.Struct("<3d")


class _Rule(NamedTuple):
    layout: struct.Struct
    low: float
    high: float
    text: str


_GAINS = "gains must be finite, from 0 to 1e6; of a set with a negative one the robot uses none and stores all"

_RULES = {
    "hero_msgs/SetOdom": _Rule(_SET_ODOM, -1e6, 1e6, "x, y (m) and theta (rad) must be finite, within +-1e6"),
    "hero_msgs/SetPID": _Rule(struct.Struct("<6f"), 0.0, 1e6, _GAINS),
    "hero_msgs/SetMotor": _Rule(struct.Struct("<2h"), *PULSE_RANGE_US, "pulses must lie within 1000..2000 us"),
    "hero_msgs/SetIRCalibration": _Rule(
        struct.Struct("<8d"), 1e-6, 1e3, "gains must be finite, above 0 and at most 1e3 counts m^2"
    ),
}


def find_request_error(service_type: str, request: bytes) -> Optional[str]:
    """Return why a request to a service of service_type may not be sent, None if it may."""
    rule = _RULES.get(service_type)
    if rule is None:
        return None
    if len(request) != rule.layout.size:
        return f"a request of {len(request)} bytes is not a {service_type}"
    values = rule.layout.unpack(request)
    if not all(math.isfinite(value) and rule.low <= value <= rule.high for value in values):
        return "%s: %s" % (", ".join("%g" % value for value in values), rule.text)
    return None


def read_set_odom_pose(request: bytes) -> Pose:
    """Return the pose in a checked request of hero_msgs/SetOdom."""
    x_m, y_m, yaw_rad = _SET_ODOM.unpack(request)
    return Pose(x_m, y_m, math.remainder(yaw_rad, 2.0 * math.pi))


def is_success(answer: bytes) -> bool:
    """Return the first field of an answer of one of the robot's services."""
    return answer[:1] == b"\x01"
