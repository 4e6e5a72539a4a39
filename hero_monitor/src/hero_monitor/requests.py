"""Parses and checks the requests of pages. Pure.

Nothing is trusted: the page may be of another version, or not a page at all.
"""

import json
import math
from typing import Any, Dict, NamedTuple, Optional, Union

LONGEST_TEXT = 2000
FARTHEST_GOAL_M = 1000.0


class RequestError(Exception):
    """The text is not a valid request; the message says why."""


class Stop(NamedTuple):
    """Stop all robots, or release them."""

    stop: bool


class Drive(NamedTuple):
    """A button is held; a velocity as in Twist."""

    robot: str
    linear_m_s: float
    angular_rad_s: float


class Release(NamedTuple):
    """The button is released."""

    robot: str


class GoTo(NamedTuple):
    """A goal in the map's frame; without yaw_rad the final heading is free."""

    robot: str
    x_m: float
    y_m: float
    yaw_rad: Optional[float]


class Show(NamedTuple):
    """What the page shows in addition to the fleet."""

    ground_truth: bool


Request = Union[Stop, Drive, Release, GoTo, Show]


def read_number(fields: Dict[str, Any], name: str, limit: float) -> float:
    """Return a number within -limit..limit. Raises: RequestError."""
    value = fields.get(name)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise RequestError("%s is not a number" % name)
    if not (math.isfinite(value) and abs(value) <= limit):
        raise RequestError("%s is beyond %g" % (name, limit))
    return float(value)


def read_robot(fields: Dict[str, Any]) -> str:
    """Return the name of a robot. Raises: RequestError."""
    robot = fields.get("robot")
    if not isinstance(robot, str) or not robot:
        raise RequestError("robot is not a name")
    return robot


def read_flag(fields: Dict[str, Any], name: str) -> bool:
    """Return true or false. Raises: RequestError."""
    value = fields.get(name)
    if not isinstance(value, bool):
        raise RequestError("%s is neither true nor false" % name)
    return value


def read_request(text: Union[str, bytes], max_linear_m_s: float, max_angular_rad_s: float) -> Request:
    """Return the request in a text. Raises: RequestError."""
    if isinstance(text, bytes) or len(text) > LONGEST_TEXT:
        raise RequestError("not a short text")
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        raise RequestError("not JSON") from None
    if not isinstance(fields, dict):
        raise RequestError("not a JSON object")
    kind = fields.get("do")
    if kind == "stop":
        return Stop(read_flag(fields, "stop"))
    if kind == "drive":
        linear_m_s = read_number(fields, "linear", max_linear_m_s)
        return Drive(read_robot(fields), linear_m_s, read_number(fields, "angular", max_angular_rad_s))
    if kind == "release":
        return Release(read_robot(fields))
    if kind == "goal":
        x_m, y_m = (read_number(fields, name, FARTHEST_GOAL_M) for name in ("x", "y"))
        yaw_rad = None if fields.get("yaw") is None else read_number(fields, "yaw", 2 * math.pi)
        return GoTo(read_robot(fields), x_m, y_m, yaw_rad)
    if kind == "show":
        return Show(read_flag(fields, "ground_truth"))
    raise RequestError("unknown request")
