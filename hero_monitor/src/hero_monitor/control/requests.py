"""Parses and checks the requests of pages. Pure.

Nothing is trusted: the page may be of another version, or not a page at all.
"""

import json
import math
from typing import Any, Callable, Dict, Union

from hero_client.values.robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S
from hero_node.number_checks import is_number

MAX_TEXT_LENGTH = 16000
"""A group of a thousand robots."""

MAX_GOAL_M = 1000.0


class RequestError(Exception):
    """The text is not a valid request; the message says why."""


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool)


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and value != ""


def _is_number(limit: float) -> Callable[[Any], bool]:
    """Return a check for numbers within -limit..limit."""
    return lambda value: is_number(value, -limit, limit)


def _is_names(value: Any) -> bool:
    return isinstance(value, list) and value != [] and all(map(_is_name, value)) and len(set(value)) == len(value)


def _is_single(value: Any) -> bool:
    return _is_names(value) and len(value) == 1


_FRESH = {"heard_ms": _is_number(1e15)}

REQUESTS: Dict[str, Dict[str, Callable[[Any], bool]]] = {
    "stop": {},
    "release": _FRESH,
    "drive": {
        "robots": _is_names,
        "linear": _is_number(MAX_LINEAR_M_S),
        "angular": _is_number(MAX_ANGULAR_RAD_S),
        **_FRESH,
    },
    "end_drive": {"robots": _is_names},
    "stop_some": {"robots": _is_names},
    "goal": {"robots": _is_single, "x": _is_number(MAX_GOAL_M), "y": _is_number(MAX_GOAL_M), **_FRESH},
    "start": {"program": _is_name, "robots": _is_names, "values": lambda value: isinstance(value, dict), **_FRESH},
    "end": {"number": _is_number(1e9)},
    "record": {"on": _is_flag, **_FRESH},
    "show": {"ground_truth": _is_flag, "picture": _is_flag, "visible": _is_flag},
}
"""Requests of a page by its field "do", with the fields that it needs and their checks.

stop: stop all robots. release: release them. drive: a button is held; velocity in m/s and rad/s. end_drive: it is let
go. stop_some: end what drives these robots, and stop them. goal: a pose on the map in m; yaw (rad) may be added.
start: a program of offers.OFFERS, with values for its fields. end: a program, by its number. record: begin or end the
recording. show: whether the page is visible, and what it shows in addition to the fleet. heard_ms: the monitor's
clock, as the page last heard it (freshness).
"""

_is_yaw = _is_number(2.0 * math.pi)


def read_request(text: Union[str, bytes]) -> Dict[str, Any]:
    """Return the fields of the request in a text. Raises: RequestError."""
    if isinstance(text, bytes) or len(text) > MAX_TEXT_LENGTH:
        raise RequestError("not a short text")
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        raise RequestError("not JSON") from None
    kind = fields.get("do") if isinstance(fields, dict) else None
    if not isinstance(kind, str) or kind not in REQUESTS:
        raise RequestError("unknown request")
    checks = {**REQUESTS[kind], "yaw": _is_yaw} if fields.get("yaw") is not None else REQUESTS[kind]
    for name, is_valid in checks.items():
        if not is_valid(fields.get(name)):
            raise RequestError("%s of %s is missing or invalid" % (name, kind))
    return dict(fields)
