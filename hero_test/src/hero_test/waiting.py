"""Waiting for a condition, which is how tests synchronise."""

import time

TIMEOUT_S = 60.0
"""Only a test that fails waits so long; a busy machine needs its time."""


def wait_for(condition, what, timeout_s=TIMEOUT_S):
    """Return the first true value of condition().

    Args:
        what: text that says what was waited for, or a function that returns it when the time is over.
    Raises:
        AssertionError: condition() was false for timeout_s.
    """
    deadline_s = time.monotonic() + timeout_s
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > deadline_s:
            raise AssertionError("waited %g s for %s" % (timeout_s, what() if callable(what) else what))
        time.sleep(0.01)
