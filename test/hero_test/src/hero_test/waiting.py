"""Waiting for a condition, which is how tests synchronize."""

import time

TIMEOUT_S = 60.0
"""Only a test that fails waits this long; a busy machine needs its time."""

MAX_PAUSE_S = 0.1


def wait_for(condition, what, timeout_s=TIMEOUT_S):
    """Return the first true value of condition().

    Args:
        what: text that says what was waited for, or a function that returns it when the time is over.
    Raises:
        AssertionError: condition() was false for timeout_s.
    """
    start_s = time.monotonic()
    while True:
        value = condition()
        if value:
            return value
        waited_s = time.monotonic() - start_s
        if waited_s > timeout_s:
            raise AssertionError(f"waited {timeout_s:g} s for {what() if callable(what) else what}")
        # Many conditions are calls of other programs, whose answers cost more than the pause.
        time.sleep(min(0.01 + 0.1 * waited_s, MAX_PAUSE_S))
