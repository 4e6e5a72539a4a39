"""The start and the end of a ROS node: in which order, what refuses it, and what may not hold it up."""

import threading
from types import SimpleNamespace
from unittest.mock import Mock, call, create_autospec

import pytest
import rosgraph
import rospy

from hero_node.errors import NodeError
from hero_node.ros import ros_node
from hero_node.ros.connections import limit_xmlrpc_connections, open_tcpros_server
from hero_node.ros.master import SUCCESS, check_master, find_running_node
from hero_node.ros.ros_node import NodeMaster, end_ros_node, init_ros_node, start_ros_node

DEADLINE_S = 60.0


@pytest.fixture(name="steps")
def make_steps(monkeypatch):
    """The parts of a start, in whose order they are called."""
    steps = Mock()
    for function in (check_master, find_running_node, limit_xmlrpc_connections, open_tcpros_server):
        steps.attach_mock(create_autospec(function), function.__name__)
    for name in ("limit_master_calls", "init_ros_node", "end_without_delay"):
        steps.attach_mock(create_autospec(getattr(ros_node, name)), name)
    for name in steps._mock_children:
        monkeypatch.setattr(ros_node, name, getattr(steps, name))
    steps.find_running_node.return_value = ""
    return steps


def test_what_limits_connections_is_there_before_the_node_is(steps):
    start_ros_node("walk")
    assert [one[0] for one in steps.mock_calls] == [
        "check_master",
        "find_running_node",
        "limit_master_calls",
        "limit_xmlrpc_connections",
        "open_tcpros_server",
        "init_ros_node",
        "end_without_delay",
    ]
    assert steps.find_running_node.call_args == call("walk") and steps.init_ros_node.call_args == call("walk", False)


@pytest.mark.parametrize(
    ("anonymous", "mappings", "is_refused"),
    [(False, {}, True), (True, {"__name": "/lab_walk"}, True), (False, {"__name": "x"}, True), (True, {}, False)],
)
def test_a_node_of_a_name_that_runs_is_not_ended_by_another(steps, monkeypatch, anonymous, mappings, is_refused):
    steps.find_running_node.return_value = "/walk"
    monkeypatch.setattr(rospy.names, "get_mappings", lambda: mappings)
    if not is_refused:
        start_ros_node("walk", anonymous)
        assert steps.init_ros_node.call_args == call("walk", True), "it gets a name of its own"
        return
    with pytest.raises(NodeError, match="/walk already runs: end it, or start this one with another __name:="):
        start_ros_node("walk", anonymous)
    assert not steps.init_ros_node.called and not steps.open_tcpros_server.called


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (rosgraph.roslogging.LoggingException("cannot create"), "no log can be written (cannot create): set ROS_LOG"),
        (PermissionError(13, "Permission denied"), "no log can be written"),
        (NotADirectoryError(20, "Not a directory"), "no log can be written"),
        (TypeError("no nil"), "has no value for YAML"),
        (rospy.ROSInitException("remapping"), "remapping"),
        (ValueError("a name\nof two lines"), "a name"),
        (OSError(98, "in use"), "in use"),
    ],
)
def test_what_keeps_rospy_from_starting_is_one_line(monkeypatch, error, words):
    init = create_autospec(rospy.init_node, side_effect=error)
    monkeypatch.setattr(rospy, "init_node", init)
    with pytest.raises(NodeError) as refused:
        init_ros_node("walk", True, ["walk", "x:=y"])
    assert words in str(refused.value) and "\n" not in str(refused.value)
    init.assert_called_once_with("walk", argv=["walk", "x:=y"], anonymous=True, disable_signals=True)


def test_a_node_that_ends_registers_nothing_more(monkeypatch):
    asked = []
    monkeypatch.setattr(
        rospy.core._LockedServerProxy, "_ServerProxy__request", lambda proxy, name, given: asked.append(name)
    )
    master = NodeMaster.__new__(NodeMaster)
    for is_ending, names in ((False, ["registerPublisher", "unregisterPublisher"]), (True, ["unregisterPublisher"])):
        monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda is_ending=is_ending: is_ending)
        asked.clear()
        answers = [master._ServerProxy__request(name, ()) for name in ("registerPublisher", "unregisterPublisher")]
        assert asked == names and (answers[0] is None or answers[0][0] == SUCCESS)


@pytest.mark.parametrize("hangs", [False, True])
def test_a_master_that_hangs_delays_the_end_no_longer_than_its_limit(monkeypatch, hangs):
    released, reasons = threading.Event(), []

    def shut_down(reason):
        reasons.append(reason)
        if hangs:
            released.wait(DEADLINE_S)

    monkeypatch.setattr(rospy, "signal_shutdown", shut_down)
    end_ros_node("the program ends", 0.01 if hangs else DEADLINE_S)
    assert reasons == ["the program ends"]
    released.set()


def test_the_thread_that_registers_is_woken_when_the_node_has_ended(monkeypatch):
    hooks, managers = [], [ros_node.RegManager.__new__(ros_node.RegManager) for _ in range(2)]
    for manager in managers:
        manager.cond = Mock(spec=threading.Condition(), __enter__=Mock(), __exit__=Mock())
    listeners = SimpleNamespace(listeners=["another listener", *managers])
    monkeypatch.setattr(ros_node, "get_registration_listeners", lambda: listeners)
    monkeypatch.setattr(rospy.core, "add_shutdown_hook", hooks.append)
    ros_node.end_without_delay()
    (wake,) = hooks
    wake("the program ends")
    assert [manager.cond.notify_all.call_count for manager in managers] == [1, 1]
