"""What pages are told of a ROS master that ends, hangs and comes back."""

from concurrent.futures import Future
from contextlib import suppress

import pytest

from hero_monitor.fleet_feed import master_link
from hero_monitor.fleet_feed.losses import MASTER_PERIOD_S
from hero_monitor.fleet_feed.master_link import MasterLink
from hero_node import NodeError


class Watch:
    """Stands for MasterWatch; runs what the link submits at once, unless it hangs."""

    def __init__(self):
        self.now_s = 10.0
        self.is_lost = False
        self.failure = None
        self.hangs = False
        self.looks = 0

    def look(self):
        self.looks += 1
        self.is_lost = self.failure is not None
        if self.failure:
            raise self.failure
        return ""

    def submit(self, function):
        future = Future()
        if not self.hangs:
            with suppress(NodeError, OSError):  # kept in the future, which nothing reads
                function()
            future.set_result(None)
        return future


@pytest.fixture
def watch(monkeypatch):
    made = Watch()
    monkeypatch.setattr(master_link.time, "monotonic", lambda: made.now_s)
    monkeypatch.setattr(master_link, "MasterWatch", lambda: made)
    return made


def check(watch, link, times=1):
    for _ in range(times):
        watch.now_s += 2.0 * MASTER_PERIOD_S
        lost = link.check()
    return lost


def test_a_master_that_answers_is_not_lost(watch):
    assert check(watch, MasterLink(watch), 5) == ""
    assert watch.looks == 5


@pytest.mark.parametrize("failure", [NodeError("no answer"), OSError("the node itself is late")])
def test_a_master_is_lost_until_a_look_succeeds(watch, failure):
    link = MasterLink(watch)
    watch.failure = failure
    assert check(watch, link, 3).endswith("does not answer")
    watch.failure = None
    assert check(watch, link) == ""


def test_a_master_that_hangs_is_lost(watch):
    link = MasterLink(watch)
    watch.hangs = True
    assert check(watch, link) == ""
    assert check(watch, link, 2).endswith("does not answer")
