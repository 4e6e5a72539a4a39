"""Goals that come while a robot drives: which replace it, which turn it, how each ends, and what is reported."""

import math
from collections import namedtuple
from unittest import mock

import pytest
from linkless_robot import make_robot

from hero_client.controllers.go_to_goal import Goal
from hero_node import Pose

pytest.importorskip("actionlib", reason="the server of goals is a node's")
from geometry_msgs.msg import PoseStamped

from hero_client.apps import go_to_goal_server
from hero_client.apps.go_to_goal_server import (
    FEEDBACK_PERIOD_S,
    GoalRequest,
    GoToGoalServer,
)
from hero_msgs.msg import GoToGoal

Outcome = namedtuple("Outcome", "reason gave_up distance_m elapsed_s")


@pytest.fixture(autouse=True)
def _without_ros(monkeypatch):
    monkeypatch.setattr("rospy.Subscriber", mock.create_autospec(go_to_goal_server.rospy.Subscriber))
    monkeypatch.setattr("actionlib.ActionServer", mock.create_autospec(go_to_goal_server.actionlib.ActionServer))
    monkeypatch.setattr("threading.Thread.start", lambda thread: None)


class NotedServer(GoToGoalServer):
    """Notes what happens: the goal's x by the word."""

    def __init__(self, robot, **options):
        super().__init__(robot, **options)
        self.notes, self.outcomes, self.progress = [], [], []
        self.looks = 0

    def put(self, request):
        self._requests.put(request)

    def _accept(self, request):
        super()._accept(request)
        self.notes.append(("accept", request.goal.x_m))

    def _find_interruption(self, handle):
        self.looks += 1
        assert self.looks < 10000, "it waits for ever"
        return super()._find_interruption(handle)

    def _show_progress(self, request, distance_m, elapsed_s):
        self.progress.append((round(self.robot.now_s - 100.0, 3), request.goal.x_m, distance_m, elapsed_s))

    def _end(self, request, *outcome):
        super()._end(request, *outcome)
        self.notes.append(("end", request.goal.x_m))
        self.outcomes.append(Outcome(*outcome))


class Handle:
    """The goal of a client of the action, and what it is told."""

    def __init__(self, **limits):
        self.ends = []
        wanted = GoToGoal(use_heading=False, **limits)
        wanted.target.pose.position.x, wanted.target.header.frame_id = 0.3, "map"
        self.get_goal = lambda: wanted

    def __getattr__(self, name):
        return lambda *result: self.ends.append((name, *result))


def make_server(avoid=False):
    robot, link = make_robot()
    return NotedServer(robot, avoid=avoid), link


def ask(x_m, frame="", handle=None, tolerance_m=0.01, timeout_s=20.0):
    return GoalRequest(Goal(x_m, 0.0), frame, tolerance_m, timeout_s, handle)


def drive(server, link, later=()):
    """Drive to the next goal; later: (s, what happens then)."""
    waiting = sorted(later, key=lambda item: item[0])

    def wait(duration_s):
        link.clock.sleep(min(duration_s, 0.05))
        while waiting and link.clock.now_s >= 100.0 + waiting[0][0]:
            waiting.pop(0)[1]()

    return server._drive_to_next(wait)


def test_a_goal_is_driven_to_and_reported_twice_a_second():
    server, link = make_server()
    assert server._thread.daemon, "a goal that never ends keeps no program alive"
    assert go_to_goal_server.actionlib.ActionServer.call_args[1] == {"auto_start": False}, "its thread may then begin"
    server._server.start.assert_called_once_with()
    assert not server.busy and not drive(server, link)
    server.put(ask(0.2))
    assert server.busy and drive(server, link) and not server.busy and server.reached
    assert server.notes == [("accept", 0.2), ("end", 0.2)]
    (outcome,) = server.outcomes
    assert (outcome.gave_up, outcome.reason) == (False, "")
    assert outcome.distance_m < 0.01 and outcome.elapsed_s == pytest.approx(link.clock.now_s - 100.0, abs=0.12)
    times_s = [at_s for at_s, *_ in server.progress]
    assert times_s[0] == 0.0 and len(times_s) > 5
    assert all(
        FEEDBACK_PERIOD_S - 0.01 < end_s - begin_s < FEEDBACK_PERIOD_S + 0.11
        for begin_s, end_s in zip(times_s, times_s[1:])
    )
    assert all(elapsed_s == pytest.approx(at_s, abs=0.01) for at_s, _, _, elapsed_s in server.progress)
    assert server.progress[0][2] == pytest.approx(0.2) and server.progress[1][2] < 0.16


def test_of_goals_that_wait_only_the_newest_is_driven_to():
    server, link = make_server()
    for x_m in (5.0, 6.0, 0.1):
        server.put(ask(x_m))
    assert drive(server, link) and not server.busy
    assert server.notes == [("end", 5.0), ("end", 6.0), ("accept", 0.1), ("end", 0.1)]
    assert [(one.gave_up, one.elapsed_s) for one in server.outcomes[:2]] == [(True, 0.0)] * 2
    assert math.isnan(server.outcomes[0].distance_m) and server.outcomes[0].reason == "another goal came"


def test_a_goal_of_the_same_frame_turns_the_robot_and_another_one_stops_it():
    for first, second, turns in (("", "", True), ("map", "map", True), ("", "map", False), ("robot", "robot", False)):
        server, link = make_server()
        server.put(ask(1.0, first))
        assert drive(
            server,
            link,
            [(1.0, lambda server=server, second=second: server.put(ask(0.3, second, timeout_s=9.0)))],
        )
        stops = [velocity for at_s, *velocity in link.sent if velocity == [0.0, 0.0] and at_s < 2.0]
        assert server.notes[:2] == [("accept", 1.0), ("end", 1.0)]
        assert server.outcomes[0].reason == "another goal came" and server.outcomes[0].gave_up
        assert server.outcomes[0].elapsed_s == pytest.approx(1.0, abs=0.15)
        assert 0.8 < server.outcomes[0].distance_m < 1.0
        assert server.busy != turns
        if turns:
            assert stops == [] and server.notes[2:] == [("accept", 0.3), ("end", 0.3)]
            assert server.outcomes[1].elapsed_s == pytest.approx(link.clock.now_s - 101.0, abs=0.25)
        else:
            assert link.velocity == (0.0, 0.0) and drive(server, link) and server.reached


def test_a_stream_of_goals_is_followed_without_a_stop():
    server, link = make_server()
    server.put(ask(0.3))
    later = [(0.1 * number, lambda number=number: server.put(ask(0.3 + 0.005 * number))) for number in range(1, 40)]
    assert drive(server, link, later) and server.reached and not server.busy
    assert [outcome.reason for outcome in server.outcomes] == ["another goal came"] * 39 + [""]
    assert link.pose.x_m == pytest.approx(0.495, abs=0.01)
    assert min(linear_m_s for _, linear_m_s, _ in link.sent[:40]) > 0.0


def test_a_goal_is_driven_to_in_its_frame():
    for frame, x_m in (("", 0.2), ("map", -0.3), ("odom", 0.2)):
        server, link = make_server()
        link.origin = Pose(0.5, 0.0, 0.0)
        server.put(ask(0.2, frame))
        assert drive(server, link) and server.reached and link.pose.x_m == pytest.approx(x_m, abs=0.01)


def test_each_goal_on_the_way_has_its_own_limits():
    server, link = make_server()
    server.put(ask(5.0, timeout_s=3.0))
    assert drive(server, link, [(2.0, lambda: server.put(ask(9.0, timeout_s=4.0)))])
    assert link.clock.now_s == pytest.approx(106.1, abs=0.25) and "not there after 4 s" in server.outcomes[1].reason
    assert not server.outcomes[1].gave_up and not server.reached


def test_a_goal_ends_by_its_own_cancellation_only():
    server, link = make_server()
    mine = Handle()
    server.put(ask(0.2, handle=mine))
    assert drive(server, link, [(0.5, lambda: server._receive_cancel(Handle()))]) and server.reached
    server.put(ask(5.0, handle=mine))
    assert drive(server, link, [(0.0, lambda: server._receive_cancel(mine))])
    outcome = server.outcomes[-1]
    assert (outcome.gave_up, outcome.reason) == (True, "cancelled")
    assert outcome.elapsed_s < 0.5 and link.velocity == (0.0, 0.0) and not server.reached and not server.busy
    server.put(ask(5.0))
    assert drive(server, link, [(0.0, server.give_up)])
    assert server.outcomes[-1].reason == "the program ends" and server.outcomes[-1].gave_up
    server.put(ask(0.1))
    assert not drive(server, link)


def test_whatever_comes_wakes_the_servers_thread():
    server, _ = make_server()
    invalid = PoseStamped()
    invalid.pose.position.x = math.nan
    for come in (
        lambda: server.put_goal(Goal(0.1, 0.0)),
        lambda: server._receive_goal(invalid),
        lambda: server._receive_action(Handle()),
        lambda: server._receive_cancel(Handle()),
        server.give_up,
    ):
        server._news.clear()
        come()
        assert server._news.is_set()


def test_a_goal_fails_with_the_robots_reason():
    server, link = make_server()
    link.ready_s = math.inf
    server.put(ask(0.2, timeout_s=3.0))
    assert drive(server, link)
    assert server.outcomes[0].reason == "hero_3 is not ready after 3 s: nothing subscribes"
    assert not server.outcomes[0].gave_up and math.isnan(server.outcomes[0].distance_m)
    link.ready_s, link.ranges = 0.0, [0.06] + [math.inf] * 7
    server.put(ask(0.5))
    assert drive(server, link) and "an obstacle is in the way" in server.outcomes[1].reason
    server.put(ask(0.5))
    with pytest.raises(ZeroDivisionError):
        drive(server, link, [(0.1, lambda: 1 // 0)])
    assert len(server.outcomes) == 2, "a bug is not the robot's reason"


def test_only_a_queue_that_avoids_drives_around_obstacles():
    for avoid in (True, False):
        server, link = make_server(avoid)
        link.ranges[0] = 0.06
        advance = link.advance

        def turn_away(step_s, link=link, advance=advance):
            advance(step_s)
            link.ranges[0] = 0.06 if abs(link.pose.yaw_rad) < 0.6 and link.pose.x_m < 0.1 else math.inf

        link.advance = turn_away
        server.put(ask(0.4, timeout_s=30.0))
        assert drive(server, link) and server.reached == avoid, server.outcomes


def test_a_server_gives_each_goal_its_own_limits_or_those_of_the_server(monkeypatch):
    logged = []
    for name in ("loginfo", "logwarn", "logerr", "logdebug"):
        monkeypatch.setattr("rospy." + name, lambda *said, name=name: logged.append(name))
    robot, link = make_robot()
    server = GoToGoalServer(robot, 0.02, 30.0)
    put = []
    monkeypatch.setattr(server._requests, "put", put.append)
    for limits, expected in (({}, (0.02, 30.0)), ({"tolerance": 0.05}, (0.05, 30.0)), ({"timeout": 2.0}, (0.02, 2.0))):
        server._receive_action(Handle(**limits))
        assert put[-1][:4] == (Goal(0.3, 0.0), "map", *expected) and put[-1].handle is not None
    message = PoseStamped()
    right = -math.sqrt(0.5), math.sqrt(0.5), pytest.approx(-math.pi / 2.0)  # entries of no sum
    for z, w, yaw_rad in ((0.0, 0.0, None), (1.0, 0.0, math.pi), right):
        message.pose.orientation.z, message.pose.orientation.w = z, w
        server._receive_goal(message)
        assert put[-1] == (Goal(0.0, 0.0, yaw_rad), "", 0.02, 30.0, None)
    for limits in ({"tolerance": -1.0}, {"tolerance": math.inf}, {"timeout": math.nan}, {"timeout": -1e-9}):
        handle = Handle(**limits)
        server._receive_action(handle)
        assert handle.ends[0][0] == "set_rejected" and "tolerance and timeout" in handle.ends[0][1].reason
    assert len(put) == 6 and logged == ["logerr"] * 4
    logged.clear()
    monkeypatch.setattr(server, "_requests", mock.Mock(spec=server._requests))
    for outcome, end, level in (
        (("", False, 0.004, 2.0), "set_succeeded", "loginfo"),
        (("cancelled", True, 0.1, 2.0), "set_canceled", "loginfo"),
        (("an obstacle", False, 0.1, 2.0), "set_aborted", "logwarn"),
    ):
        for handle in (Handle(), None):
            server._end(ask(0.3, handle=handle), *outcome)
            assert logged.pop() == level
            if handle is not None:
                ((name, result, reason),) = handle.ends
                assert name == end and reason == result.reason == outcome[0]
                assert (result.reached, result.distance, result.elapsed) == (end == "set_succeeded", *outcome[2:])
    for handle, level in ((None, "logdebug"), (Handle(), "loginfo")):
        server._end(ask(0.3, handle=handle), "another goal came", True, 0.1, 2.0)
        assert logged.pop() == level, "goals on the topic may come as a stream"
    link.silent_s["odom"] = 2.0
    handle = Handle()
    server._accept(ask(0.3, handle=handle))
    server._show_progress(ask(0.3, handle=handle), 0.2, 1.0)
    assert [name for name, *_ in handle.ends] == ["set_accepted", "publish_feedback"]
    assert (handle.ends[1][1].distance, handle.ends[1][1].elapsed) == (0.2, 1.0)
