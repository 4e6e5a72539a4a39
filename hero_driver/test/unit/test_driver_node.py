"""The driver's node: addresses at which it cannot listen, and its end, when rospy closes its topics."""

import queue
import signal
import threading
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import rospy

from hero_driver import node as node_module
from hero_driver.config import read_config
from hero_driver.gateway import Gateway
from hero_driver.node import LEAVE_WAIT_S, REPORT_CHECK_S, DriverNode
from hero_driver.reports.reporter import Reporter
from hero_driver.ros.log_relay import LogRelay
from hero_driver.ros.thread_watch import ThreadWatch
from hero_driver.transport.event_loop import EventLoop, NoAnswerError
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
    node._report(SimpleNamespace(publish=publish, measure_rates=lambda status: None), True)
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
        monkeypatch.setattr(node_module.ros, "read_given", dict)
        monkeypatch.setattr(node_module, "DriverNode", lambda config, log, threads: self.node)
        monkeypatch.setattr(node_module.sys, "setswitchinterval", lambda interval_s: None)
        self.handlers = {}
        monkeypatch.setattr(node_module.signal, "signal", self.handlers.__setitem__)
        self.hooks = []
        monkeypatch.setattr(node_module.rospy_internals, "call_before_shutdown", self.hooks.append)
        monkeypatch.setattr(node_module.ros, "end_ros_node", lambda reason, timeout_s: self.steps.append(timeout_s))

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


def test_rospy_is_changed_before_the_node_starts(monkeypatch):
    steps = []

    def note(module, *names):
        for name in names:
            fake = create_autospec(getattr(module, name), side_effect=lambda *_, name=name, **__: steps.append(name))
            monkeypatch.setattr(module, name, fake)

    note(node_module, "_wait_for_master", "report_dropped_log_lines")
    note(node_module.ros, "read_master_uri", "find_running_node", "limit_xmlrpc_connections", "open_tcpros_server")
    note(node_module.rospy_internals, "keep_publishers_connected", "leave_topics_out_of_rosout")
    note(node_module.ros, "init_ros_node")
    log = create_autospec(LogRelay, instance=True)
    node_module._enter_ros(["_port:=1"], log)
    before = ["read_master_uri", "_wait_for_master", "find_running_node", "report_dropped_log_lines"]
    changes = ["limit_xmlrpc_connections", "open_tcpros_server", "keep_publishers_connected"]
    assert steps == [*before, *changes, "init_ros_node", "leave_topics_out_of_rosout"]
    node_module.ros.init_ros_node.assert_called_once_with("hero_driver", arguments=["_port:=1"])
    (warn,) = node_module.ros.open_tcpros_server.call_args[0]
    warn("10.0.0.7", "refused")
    log.log_throttled.assert_called_once_with("warn", "handshake 10.0.0.7", "refused")
    node_module.ros.find_running_node.side_effect = ["/hero_driver"]
    with pytest.raises(ProgramError, match="a driver already runs as /hero_driver: end it, or start this one with"):
        node_module._enter_ros([], log)
    assert steps[-2:] == before[:2] and node_module.ros.init_ros_node.call_count == 1


def test_a_master_is_waited_for_with_one_line(monkeypatch, capsys):
    answers, waits = [False, False, False, True, True], []
    monkeypatch.setattr(node_module.rosgraph, "is_master_online", lambda: answers.pop(0))
    monkeypatch.setattr(node_module, "time", SimpleNamespace(sleep=waits.append))
    for _ in range(2):
        node_module._wait_for_master("http://lab:11311")
    assert waits == [0.5, 0.5] and capsys.readouterr().err.count("no ROS master at http://lab:11311 yet") == 1


@pytest.mark.parametrize(
    ("outcome", "failure", "exits"),
    [
        (5, "", []),
        (3, "no thread", [3]),
        (MemoryError(), "", [1]),
        (RuntimeError("can't start new thread"), "", [1]),
        (ProgramError("no ROS master"), "no thread", [1]),
        (RuntimeError("a bug"), "", None),
        (ProgramError("no ROS master"), "", None),
    ],
)
def test_a_driver_without_threads_does_not_wait_for_those_it_has(monkeypatch, capsys, outcome, failure, exits):
    threads, exited = ThreadWatch.__new__(ThreadWatch), []  # the whole one changes Python's threads
    threads.failure = failure
    monkeypatch.setattr(node_module, "ThreadWatch", lambda: threads)
    monkeypatch.setattr(node_module, "_run", create_autospec(node_module._run, side_effect=[outcome]))
    monkeypatch.setattr(node_module.os, "_exit", exited.append)
    if exits is None:
        with pytest.raises(type(outcome)):
            node_module.main([])
    else:
        assert node_module.main([]) == (exits or [outcome])[0]
    assert exited == (exits or [])
    assert ("cannot run: " in capsys.readouterr().err) == (exits == [1])


@pytest.mark.parametrize(
    ("part", "error", "code"),
    [("enter", KeyboardInterrupt(), 130), ("enter", ProgramError("no"), 2), ("open", ProgramError("in use"), 2)],
)
def test_a_node_that_cannot_start_ends_with_its_status(monkeypatch, part, error, code):
    run = Run(monkeypatch, **{part: error})
    assert run() == code and run.steps[-1] == part


def test_the_node_goes_on_until_its_end_is_asked_for():
    node = DriverNode.__new__(DriverNode)
    node._ends = queue.SimpleQueue()
    assert not node._has_ended(0.0)
    node.end()
    assert node._has_ended(0.0)


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


class Spin:
    """A node that reports in virtual time, whose state changes when a test says so."""

    def __init__(self, monkeypatch, changes=(), ends_s=5.0, period_s=1.0):
        self.now_s, self.changes, self.reports, self.told = 100.0, list(changes), [], []
        self.node = DriverNode.__new__(DriverNode)
        self.node._threads, self.node._crash = SimpleNamespace(failure=""), None
        self.node._config, self.node._changed = SimpleNamespace(report_period_s=period_s), threading.Event()
        self.node._report = lambda reporter, is_due: self.reports.append((self.now_s - 100.0, is_due))
        self.ends_s = ends_s
        self.node._has_ended = self.wait
        monkeypatch.setattr(node_module, "Reporter", lambda: "reporter")
        monkeypatch.setattr(node_module.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(rospy, "logfatal", lambda text, *values: self.told.append(text % values))

    def wait(self, timeout_s):
        assert timeout_s == REPORT_CHECK_S
        self.now_s += 0.125  # of which sums are exact
        while self.changes and self.changes[0] <= self.now_s - 100.0:
            self.changes.pop(0)
            self.node._changed.set()
        return self.now_s >= 100.0 + self.ends_s


def test_reports_come_each_period_and_once_for_a_burst_of_changes(monkeypatch):
    spin = Spin(monkeypatch, changes=(1.42, 1.44, 1.46, 2.01), ends_s=3.0)
    assert spin.node.spin() == 0
    assert spin.reports == [(0.125, True), (1.125, True), (1.5, False), (2.125, True)]
    assert spin.told == []


def test_a_change_during_a_report_is_reported_next(monkeypatch):
    spin = Spin(monkeypatch, ends_s=1.0)
    report = spin.node._report

    def report_meanwhile(*arguments):
        report(*arguments)
        if len(spin.reports) == 1:
            spin.node._changed.set()

    spin.node._report = report_meanwhile
    spin.node.spin()
    assert spin.reports == [(0.125, True), (0.25, False)]


def test_a_loop_that_breaks_ends_the_node_with_an_error(monkeypatch):
    spin = Spin(monkeypatch)
    node = spin.node
    node._ends = queue.SimpleQueue()
    node._has_ended = lambda timeout_s: DriverNode._has_ended(node, 0.0)
    node._loop = create_autospec(EventLoop, instance=True)
    node._loop.run.side_effect = ZeroDivisionError("a bug")
    with pytest.raises(ZeroDivisionError):
        node._run_loop()
    assert node.spin() == 1 and spin.told == ["the driver broke: ZeroDivisionError: a bug"]


def test_a_node_without_threads_for_programs_ends_with_an_error(monkeypatch):
    spin = Spin(monkeypatch)
    spin.node._threads.failure = "no more threads"
    assert spin.node.spin() == 1 and spin.told[0].endswith("could not stop robots any more: no more threads")
    assert spin.reports == []


def test_a_gateway_that_hangs_is_not_reported_on(monkeypatch):
    node, reporter = DriverNode.__new__(DriverNode), create_autospec(Reporter, instance=True)
    node._loop, node._gateway = create_autospec(EventLoop, instance=True), create_autospec(Gateway, instance=True)
    node._loop.ask.side_effect = NoAnswerError("hangs")
    node._report(reporter, True)
    assert not reporter.method_calls
    assert node._serve_dismissal(None).message == "the driver hangs"
    node._loop.ask.side_effect = [["hero_3", "hero_9"], []]
    answers = [node._serve_dismissal(None) for _ in range(2)]
    assert [answer.message for answer in answers] == [
        "no longer listed as gone: hero_3, hero_9",
        "no longer listed as gone: no robot",
    ]
    node._loop.ask.side_effect = None
    for is_periodic in (False, True):
        node._report(reporter, is_periodic)
    names = [call[0] for call in reporter.method_calls]
    assert names == ["publish", "measure_rates", "publish", "diagnose"]


def test_a_report_tells_of_all_that_the_driver_knows(monkeypatch):
    node, answers = DriverNode.__new__(DriverNode), []
    monkeypatch.setattr(node_module.time, "monotonic", lambda: 100.0)
    monkeypatch.setattr(node_module, "find_stamp", lambda stopped_s, now_s: rospy.Time(int(now_s - stopped_s)))
    node._loop = SimpleNamespace(listening="10.42.0.1:11411")
    node._stop_interface = SimpleNamespace(stopped_by="/teleop", stopped_s=93.0)
    node._gateway = create_autospec(Gateway, instance=True, stopped=True, peers={1: 1, 2: 2})
    node._gateway.refused_connections, node._gateway.last_refusal = 5, "why"
    node._gateway.list_robots.return_value = ["hero_2"]
    node._gateway.list_gone.return_value = [SimpleNamespace(message="hero_9, as it was")]
    node._take_status(answers.append)
    (status,) = answers
    message = status.message
    assert (message.listening, message.stopped, message.stopped_by) == ("10.42.0.1:11411", True, "/teleop")
    assert message.gone == ["hero_9, as it was"] and message.stopped_since == rospy.Time(7)
    assert status[0] == 100.0 and status[2:] == (["hero_2"], 2, 5, "why")
    node._stop_interface.stopped_s = None
    node._take_status(answers.append)
    assert answers[1].message.stopped_since == rospy.Time(0)
