"""Parses and checks the requests of pages. Pure.

Nothing is trusted: the page may be of another version, or not a page at all. Requests that are made now are told from
those that a socket held while monitor, page or network paused: the monitor tells each page its clock several times a
second, and a page returns the newest value that it has heard. A stop counts at any age; what makes robots move counts
only while it is fresh.
"""

import json
import math
import time
from typing import Any, Callable, Dict, Union

from hero_client.values import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S
from hero_node.parameters import is_number

from .dead_man import HOLD_TIMEOUT_S

MAX_TEXT_LENGTH = 16000
"""A group of a thousand robots."""

MAX_GOAL_M = 1000.0

CLOCK_PERIOD_S = 0.12
"""Time between two values of the clock."""

AGE_MAX_S = {"drive": HOLD_TIMEOUT_S, "goal": 1.0, "start": 1.0, "record": 1.0, "release": 1.0}
"""Largest age of the requests that make robots move. They need heard_ms: the clock, as the page last heard it."""


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


_is_clock, _is_yaw = _is_number(1e15), _is_number(2.0 * math.pi)

REQUESTS: Dict[str, Dict[str, Callable[[Any], bool]]] = {
    "stop": {},
    "release": {},
    "drive": {
        "robots": _is_names,
        "linear": _is_number(MAX_LINEAR_M_S),
        "angular": _is_number(MAX_ANGULAR_RAD_S),
        "pressed_ms": _is_clock,
    },
    "end_drive": {"robots": _is_names},
    "stop_some": {"robots": _is_names},
    "goal": {"robots": _is_single, "x": _is_number(MAX_GOAL_M), "y": _is_number(MAX_GOAL_M)},
    "start": {"program": _is_name, "robots": _is_names, "values": lambda value: isinstance(value, dict)},
    "end": {"number": _is_number(1e9)},
    "record": {"on": _is_flag},
    "dismiss": {},
    "code": {"robots": _is_names},
    "withdraw": {"code": _is_name},
    "show": {"picture": _is_flag},
}
"""Requests of a page by its field "do", with the fields that it needs and their checks.

drive: a button is held; velocity in m/s and rad/s, and the clock as heard when it was pressed. end_drive: it is let go.
stop_some: end what drives these robots, and stop them. goal: a pose on the map in m; yaw (rad) may be added. start: a
program of offers.OFFERS, with values for its fields. dismiss: list robots that are gone no longer. code: make a code
for the drivers of these robots. show: whether the page shows the camera's picture.
"""


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
    checks = dict(REQUESTS[kind])
    if kind in AGE_MAX_S:
        checks["heard_ms"] = _is_clock
    if fields.get("yaw") is not None:
        checks["yaw"] = _is_yaw
    for name, is_valid in checks.items():
        if not is_valid(fields.get(name)):
            raise RequestError(f"{name} of {kind} is missing or invalid")
    return dict(fields)


def read_clock_ms() -> int:
    """Return the time in ms; unlike CLOCK_MONOTONIC it runs while the PC sleeps."""
    return round(1e3 * time.clock_gettime(time.CLOCK_BOOTTIME))


def is_fresh(request: Dict[str, Any], now_ms: int) -> bool:
    """Return whether a request was made recently enough to be carried out."""
    limit_s = AGE_MAX_S.get(request["do"])
    return limit_s is None or 0 <= now_ms - request["heard_ms"] <= 1e3 * limit_s
