"""The driver's node: addresses at which it cannot listen, and its end, when rospy closes its topics."""

import signal
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import rospy

from hero_driver import node as node_module
from hero_driver.config import read_config
from hero_driver.node import LEAVE_WAIT_S, DriverNode
from hero_driver.transport.event_loop import EventLoop
from hero_node import ProgramError


def test_a_report_that_meets_closed_topics_is_left_out_at_the_end_only(monkeypatch):
    def publish(status):
        assert status == "status"
        raise rospy.ROSException("publish() to a closed topic")

    node = DriverNode.__new__(DriverNode)
    node._loop = SimpleNamespace(ask=lambda _, limit_s: "status")
    # rosnode kill: rospy closes topics while it is going down, and says that it is down after that.
    monkeypatch.setattr(rospy.core, "_in_shutdown", True)
    assert not rospy.is_shutdown()
    node._report(SimpleNamespace(publish=publish), False)
    monkeypatch.setattr(rospy.core, "_in_shutdown", False)
    with pytest.raises(rospy.ROSException):
        node._report(SimpleNamespace(publish=publish), False)


@pytest.mark.parametrize(
    ("host", "words"),
    [
        ("192.0.2.1", "~host 192.0.2.1, ~port 0 is not an address of this machine"),
        ("10.42.0..1", "'10.42.0..1' cannot be found"),
    ],
)
def test_a_host_that_is_not_this_machine_is_named_with_a_remedy(host, words):
    node = DriverNode.__new__(DriverNode)
    node._config, node._gateway = read_config({"host": host, "port": 0}), None
    node._loop = EventLoop(host, 0, 10.0)
    with pytest.raises(ProgramError) as caught:
        node.open()
    assert words in str(caught.value) and "`ip address` shows" in str(caught.value)


class Run:
    """The parts of a run of the node, and the order in which they were used."""

    def __init__(self, monkeypatch, **failures):
        self.steps, self.threads = [], SimpleNamespace(failure="")
        self.node = create_autospec(DriverNode, instance=True)
        for name in ("open", "spin", "close"):
            getattr(self.node, name).side_effect = self.note(name, failures.get(name, 5 if name == "spin" else None))
        monkeypatch.setattr(node_module, "_enter_ros", self.note("enter", failures.get("enter")))
        monkeypatch.setattr(node_module, "read_given", dict)
        monkeypatch.setattr(node_module, "DriverNode", lambda config, log, threads: self.node)
        monkeypatch.setattr(node_module.sys, "setswitchinterval", lambda interval_s: None)
        self.handlers = {}
        monkeypatch.setattr(node_module.signal, "signal", self.handlers.__setitem__)
        self.hooks = []
        monkeypatch.setattr(node_module.rospy_internals, "call_before_shutdown", self.hooks.append)
        monkeypatch.setattr(node_module, "end_ros_node", lambda reason, timeout_s: self.steps.append(timeout_s))

    def note(self, name, outcome):
        def act(*_):
            self.steps.append(name)
            if isinstance(outcome, BaseException):
                raise outcome
            return outcome

        return act

    def __call__(self):
        return node_module._run(None, self.threads)


def test_the_node_ends_ros_only_after_its_robots_are_stopped(monkeypatch):
    run = Run(monkeypatch)
    assert run() == 5 and run.steps == ["enter", "open", "spin", "close", LEAVE_WAIT_S]
    assert set(run.handlers) == {signal.SIGINT, signal.SIGTERM, signal.SIGHUP} and run.hooks == [run.node.end]
    for handle in run.handlers.values():
        handle(signal.SIGTERM, None)
    assert run.node.end.call_count == 3


@pytest.mark.parametrize("error", [rospy.ROSException("closed"), KeyboardInterrupt(), MemoryError()])
def test_whatever_breaks_the_reports_stops_the_robots(monkeypatch, error):
    run = Run(monkeypatch, spin=error)
    with pytest.raises(type(error)):
        run()
    assert run.steps == ["enter", "open", "spin", "close", LEAVE_WAIT_S]


def test_without_threads_nothing_waits_for_ros(monkeypatch):
    run = Run(monkeypatch)
    run.threads.failure = "no more threads"
    assert run() == 5 and run.steps == ["enter", "open", "spin", "close"]


@pytest.mark.parametrize(
    ("part", "error", "code"),
    [("enter", KeyboardInterrupt(), 130), ("enter", ProgramError("no"), 2), ("open", ProgramError("in use"), 2)],
)
def test_a_node_that_cannot_start_ends_with_its_status(monkeypatch, part, error, code):
    run = Run(monkeypatch, **{part: error})
    assert run() == code and run.steps[-1] == part


def make_closing_node(thread_ends):
    """Return a node that is served by a thread, and the steps of its end."""
    steps, alive = [], [True]
    node = DriverNode.__new__(DriverNode)

    def join(timeout_s):
        steps.append(("join", timeout_s))
        alive[0] = not thread_ends

    node._thread = SimpleNamespace(is_alive=lambda: alive[0], join=join)
    node._loop = SimpleNamespace(stop=lambda: steps.append("stop"))
    node._stop_interface = SimpleNamespace(close=lambda: steps.append("stop interface"))
    node._is_closed = SimpleNamespace(set=lambda: steps.append("closed"))
    node._registrar = SimpleNamespace(close=lambda: steps.append("registrar"))
    node._log = SimpleNamespace(close=lambda: steps.append("log"), log=lambda level, text: steps.append(text))
    return node, steps


@pytest.mark.parametrize("thread_ends", [True, False])
def test_the_end_stops_robots_first_and_waits_for_that_as_long_as_it_takes(thread_ends):
    node, steps = make_closing_node(thread_ends)
    for _ in range(2):
        node.close()
    assert steps[0] == "stop" and steps[1] == ("join", 3.0), "2 s for the robots, 1 s for the loop"
    hangs = [] if thread_ends else ["the driver ends, and could not stop the robots: its loop hangs"]
    assert steps[2 : 6 + len(hangs)] == [*hangs, "stop interface", "closed", "registrar", "log"]
    assert steps.count("stop") == (1 if thread_ends else 2)
