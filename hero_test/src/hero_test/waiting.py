"""Waiting for a condition, which is how tests synchronize."""

import time

TIMEOUT_S = 60.0
"""Only a test that fails waits so long; a busy machine needs its time."""

MAX_PAUSE_S = 0.05
MAX_SHARE = 0.1
"""Of the time, in which a condition is asked: many are calls of other programs, whose answers take long."""

MAX_LONG_PAUSE_S = 0.5


def wait_for(condition, what, timeout_s=TIMEOUT_S):
    """Return the first true value of condition().

    Args:
        what: text that says what was waited for, or a function that returns it when the time is over.
    Raises:
        AssertionError: condition() was false for timeout_s.
    """
    start_s = time.monotonic()
    while True:
        asked_s = time.monotonic()
        value = condition()
        if value:
            return value
        answered_s = time.monotonic()
        waited_s = answered_s - start_s
        if waited_s > timeout_s:
            raise AssertionError("waited %g s for %s" % (timeout_s, what() if callable(what) else what))
        pause_s = min((answered_s - asked_s) / MAX_SHARE, MAX_LONG_PAUSE_S)
        time.sleep(max(pause_s, min(0.01 + 0.1 * waited_s, MAX_PAUSE_S)))
