"""Tells requests that are made now from those that a socket held while monitor, page or network paused. Pure.

The monitor tells each page its clock several times a second, and a page returns the newest value that it has heard
with every request. A stop counts at any age; what makes robots move counts only while it is fresh.
"""

import time
from typing import Any, Dict, Optional

from .dead_man import HOLD_TIMEOUT_S

CLOCK_PERIOD_S = 0.12
"""Between two values of the clock."""

AGE_MAX_S = {"drive": HOLD_TIMEOUT_S, "goal": 1.0, "start": 1.0, "record": 1.0, "release": 1.0}
"""Of the requests that make robots move."""

INERT_S = 2.0
"""After a stop no release counts: the finger that stopped all robots may tap again."""


def read_clock_ms() -> int:
    """Return the time in ms; unlike CLOCK_MONOTONIC it runs while the PC sleeps."""
    return round(1e3 * time.clock_gettime(time.CLOCK_BOOTTIME))


def is_fresh(request: Dict[str, Any], now_ms: int) -> bool:
    """Return whether a request was made recently enough to be carried out."""
    limit_s = AGE_MAX_S.get(request["do"])
    return limit_s is None or 0 <= now_ms - request["heard_ms"] <= 1e3 * limit_s


def explain_refused_release(request: Dict[str, Any], now_ms: int, stopped_ms: Optional[int]) -> str:
    """Return why a release is refused; empty if it is not. stopped_ms: time of the last stop, None without one."""
    if not is_fresh(request, now_ms):
        return "NOT RELEASED: the request was delayed; hold Release again"
    if stopped_ms is not None and now_ms - stopped_ms < 1e3 * INERT_S:
        return "NOT RELEASED: robots were stopped less than %g s ago; hold Release again" % INERT_S
    return ""
