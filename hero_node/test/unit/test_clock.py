"""The rate of a loop."""

import pytest

from hero_node.clock import Clock


class Watch(Clock):
    """Time that passes only in waits."""

    def __init__(self, end_s=10.0):
        self.time_s = 0.0
        self.end_s = end_s

    @property
    def now_s(self):
        return self.time_s

    def sleep(self, duration_s):
        assert duration_s >= 0.0
        self.time_s += duration_s
        return self.time_s < self.end_s


def test_a_rate_yields_its_times_until_the_program_is_to_end():
    assert list(Watch(0.35).rate(10)) == pytest.approx([0.0, 0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="more than 0 Hz, not 0"):
        next(Watch().rate(0))


def test_a_rate_waits_for_the_rest_of_the_period_only():
    watch, times_s = Watch(0.35), []
    for time_s in watch.rate(10):
        times_s.append(time_s)
        watch.time_s += 0.07
    assert times_s == pytest.approx([0.0, 0.1, 0.2, 0.3])


def test_a_slow_body_does_not_let_a_rate_run_faster_later():
    watch, times_s = Watch(), []
    for time_s in watch.rate(10):
        times_s.append(time_s)
        if len(times_s) == 2:
            watch.time_s += 0.35
        if len(times_s) == 4:
            break
    assert times_s == pytest.approx([0.0, 0.1, 0.45, 0.55])
