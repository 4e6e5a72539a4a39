"""The monitor at a ROS master that ends and comes back: its registrations are whole again, whatever interrupts them."""

from contextlib import suppress

import pytest

from hero_monitor.fleet_feed import master_link
from hero_monitor.fleet_feed.losses import MASTER_PERIOD_S
from hero_monitor.fleet_feed.master_link import MasterLink
from hero_node.errors import NodeError


class Master:
    """A master that knows the monitor, of which whole registrations are counted; runs what the link submits at once."""

    def __init__(self):
        self.pid = 100
        self.answers = True
        self.knows_node = True
        self.failures = []
        self.registrations = 0

    def ask(self, method):
        assert method == "getPid"
        if not self.answers:
            raise NodeError("no answer")
        return self.pid

    def register(self):
        self.knows_node = True
        if self.failures:
            raise self.failures.pop()
        self.registrations += 1

    def submit(self, function):
        with suppress(OSError):  # kept in the future, which nothing reads
            function()


@pytest.fixture
def master(monkeypatch):
    made = Master()
    made.now_s = 10.0
    monkeypatch.setattr(master_link.time, "monotonic", lambda: made.now_s)
    monkeypatch.setattr(master_link, "ask_master", made.ask)
    monkeypatch.setattr(master_link, "is_registered", lambda: made.knows_node)
    monkeypatch.setattr(master_link, "register_again", made.register)
    monkeypatch.setattr(master_link.rospy, "logwarn", lambda text: None)
    return made


def check(master, link, times=1):
    for _ in range(times):
        master.now_s += 2.0 * MASTER_PERIOD_S
        lost = link.check()
    return lost


def test_nothing_is_registered_again_at_a_master_that_stays(master):
    assert check(master, MasterLink(master), 5) == ""
    assert master.registrations == 0


@pytest.mark.parametrize("knows_node", [False, True])
def test_a_master_that_was_started_again_gets_all_registrations(master, knows_node):
    link = MasterLink(master)
    check(master, link)
    master.pid, master.knows_node = 200, knows_node  # known already by a topic that was registered meanwhile
    assert check(master, link, 3) == ""
    assert master.registrations == 1


@pytest.mark.parametrize("failure", [NodeError("late"), OSError("late")])
def test_registrations_that_were_cut_off_are_repeated(master, failure):
    link = MasterLink(master)
    check(master, link)
    master.pid, master.failures = 200, [failure]
    assert check(master, link) != ""
    assert check(master, link, 3) == ""
    assert master.registrations == 1


def test_a_master_of_the_same_process_number_is_another_after_a_pause(master):
    link = MasterLink(master)
    check(master, link)
    master.answers = False
    assert check(master, link) != ""
    master.answers = True
    assert check(master, link, 3) == ""
    assert master.registrations == 1
