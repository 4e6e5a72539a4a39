"""Tests of real time on a machine that others use too: tried again where the machine stood still meanwhile.

The driver keeps velocities 60 ms apart, and a robot drops what it reads within 50 ms. Where the machine stands still
for longer than what is between, the robots of a test read two at once, or the driver is late: that says nothing about
the driver. Whether it did is measured, so a failure on a machine that ran is a failure at once.
"""

import functools
import threading
import time

TRIES = 5
MARGIN_S = 0.009
"""Between two velocities of the driver (60 ms) and what a robot needs to take both (its read cycle of 51 ms)."""

SAMPLE_S = 0.002


class StallWatch:
    """How long this process was kept from running at most, while `with` lasts.

    Attributes:
        longest_s: so far.
    """

    def __init__(self):
        self.longest_s = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._measure, daemon=True)

    @property
    def stood_still(self):
        """Whether that was long enough to make a robot drop a velocity."""
        return self.longest_s >= MARGIN_S

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()

    def _measure(self):
        before_s = time.monotonic()
        while not self._end.wait(SAMPLE_S):
            now_s = time.monotonic()
            self.longest_s = max(self.longest_s, now_s - before_s - SAMPLE_S)
            before_s = now_s


def in_steady_time(test_case):
    """Return a TestCase class whose tests are tried again if they fail while the machine stood still for MARGIN_S."""
    for name, test in list(vars(test_case).items()):
        if name.startswith("test_"):
            setattr(test_case, name, _try_again(test))
    return test_case


def _try_again(test):
    @functools.wraps(test)
    def run(case):
        for left in reversed(range(TRIES)):
            with StallWatch() as watch:
                try:
                    return test(case)
                except AssertionError as error:
                    if not left or not watch.stood_still:
                        raise
                    print("%s once more: machine stood still %.3f s: %s" % (test.__name__, watch.longest_s, error))
            case.tearDown()
            case.doCleanups()
            case.setUp()
        return None

    return run
