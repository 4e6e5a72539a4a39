"""Reads what Foxglove clients may publish: a stop of all robots, and velocities, as on the page. Pure."""

import math
import re
from typing import Any, Dict, Optional, Tuple

from hero_client.values import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S
from hero_node import TWIST_FORM, clamp

_VELOCITY_TOPIC = re.compile(r"/(hero_[0-9]+)(?:/velocity_controller)?/cmd_vel")
_STOP_TOPIC = re.compile(r"/(?:[A-Za-z0-9_/]+/)?stop_request")


PRESS_GAP_MS = 1500
"""Silence after which a client's next velocity counts as a new press: some send one a second while a button is held."""

Presses = Dict[str, Tuple[int, int]]
"""The clock as a client heard it with the first and the newest velocity of a press, by robot."""


def find_press(presses: Presses, robot: str, heard_ms: int) -> int:
    """Note a velocity for a robot; return the clock at the press that it belongs to."""
    pressed_ms, newest_ms = presses.get(robot, (heard_ms, heard_ms))
    if heard_ms - newest_ms > PRESS_GAP_MS:
        pressed_ms = heard_ms
    presses[robot] = pressed_ms, heard_ms
    return pressed_ms


def read_command(topic: str, message_type: str, content: bytes) -> Optional[Dict[str, Any]]:
    """Return a message as a page's request: a velocity within the firmware's limits, or a stop; None for others."""
    message_type = message_type.replace("/msg/", "/")  # as some clients write it
    velocity_topic = _VELOCITY_TOPIC.fullmatch(topic)
    if velocity_topic and message_type == "geometry_msgs/Twist" and len(content) == TWIST_FORM.size:
        linear_m_s, _, _, _, _, angular_rad_s = TWIST_FORM.unpack(content)
        if not math.isfinite(linear_m_s + angular_rad_s):
            return None
        robots = {"robots": [velocity_topic[1]]}
        if not (linear_m_s or angular_rad_s):
            return {"do": "end_drive", **robots}
        linear, angular = clamp(linear_m_s, MAX_LINEAR_M_S), clamp(angular_rad_s, MAX_ANGULAR_RAD_S)
        return {"do": "drive", **robots, "linear": linear, "angular": angular}
    if _STOP_TOPIC.fullmatch(topic) and message_type == "std_msgs/Bool" and len(content) == 1:
        return {"do": "release" if content == b"\0" else "stop"}
    return None
