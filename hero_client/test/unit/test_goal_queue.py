"""Goals that come while a robot drives: which replace it, which turn it, how each ends, and what is reported."""

import math
from types import SimpleNamespace

import pytest
from linkless_robot import make_robot

from hero_client.apps.goals import FEEDBACK_PERIOD_S, MAX_QUEUED_GOALS, GoalQueue, GoalRequest, InvalidGoalError
from hero_client.controllers.go_to_goal import Goal
from hero_node import Pose


class NotedQueue(GoalQueue):
    """Notes what happens: the goal's x by the word."""

    def __init__(self, robot, avoid):
        super().__init__(robot, avoid)
        self.notes, self.outcomes, self.progress = [], [], []

    def accept_goal(self, request):
        self.notes.append(("accept", request.goal.x_m))

    def show_progress(self, request, distance_m, elapsed_s):
        self.progress.append((round(self.robot.now_s - 100.0, 3), request.goal.x_m, distance_m, elapsed_s))

    def end_goal(self, request, outcome):
        self.notes.append(("end", request.goal.x_m))
        self.outcomes.append(outcome)


def make_queue(avoid=False):
    robot, link = make_robot()
    return NotedQueue(robot, avoid), link


def ask(x_m, frame="", handle=None, tolerance_m=0.01, timeout_s=20.0):
    return GoalRequest(Goal(x_m, 0.0), frame, tolerance_m, timeout_s, handle)


def drive(queue, link, later=()):
    """Drive to the next goal; later: (s, what happens then)."""
    waiting = sorted(later, key=lambda item: item[0])

    def wait(duration_s):
        link.clock.sleep(min(duration_s, 0.05))
        while waiting and link.clock.now_s >= 100.0 + waiting[0][0]:
            waiting.pop(0)[1]()

    return queue.drive_to_next(wait)


def test_a_goal_is_driven_to_and_reported_twice_a_second():
    queue, link = make_queue()
    assert not queue.busy and not drive(queue, link)
    queue.put(ask(0.2))
    assert queue.busy and drive(queue, link) and not queue.busy and queue.reached
    assert queue.notes == [("accept", 0.2), ("end", 0.2)]
    (outcome,) = queue.outcomes
    assert (outcome.reached, outcome.gave_up, outcome.reason) == (True, False, "")
    assert outcome.distance_m < 0.01 and outcome.elapsed_s == pytest.approx(link.clock.now_s - 100.0, abs=0.12)
    times_s = [at_s for at_s, *_ in queue.progress]
    assert times_s[0] == 0.0 and len(times_s) > 5
    assert all(
        FEEDBACK_PERIOD_S - 0.01 < end_s - begin_s < FEEDBACK_PERIOD_S + 0.11
        for begin_s, end_s in zip(times_s, times_s[1:])
    )
    assert all(elapsed_s == pytest.approx(at_s, abs=0.01) for at_s, _, _, elapsed_s in queue.progress)
    assert queue.progress[0][2] == pytest.approx(0.2) and queue.progress[1][2] < 0.16


def test_of_goals_that_wait_only_the_newest_is_driven_to():
    queue, link = make_queue()
    for x_m in (5.0, 6.0, 0.1):
        queue.put(ask(x_m))
    assert drive(queue, link) and not queue.busy
    assert queue.notes == [("end", 5.0), ("end", 6.0), ("accept", 0.1), ("end", 0.1)]
    assert [(one.reached, one.gave_up, one.elapsed_s) for one in queue.outcomes[:2]] == [(False, True, 0.0)] * 2
    assert math.isnan(queue.outcomes[0].distance_m) and queue.outcomes[0].reason == "another goal came"
    for _ in range(MAX_QUEUED_GOALS):
        queue.put(ask(1.0))
    with pytest.raises(InvalidGoalError, match="more than 100 goals at once"):
        queue.put(ask(1.0))


def test_a_goal_of_the_same_frame_turns_the_robot_and_another_one_stops_it():
    for first, second, turns in (("", "", True), ("map", "map", True), ("", "map", False), ("robot", "robot", False)):
        queue, link = make_queue()
        queue.put(ask(1.0, first))
        assert drive(
            queue, link, [(1.0, lambda queue=queue, second=second: queue.put(ask(0.3, second, timeout_s=9.0)))]
        )
        stops = [velocity for at_s, *velocity in link.sent if velocity == [0.0, 0.0] and at_s < 2.0]
        assert queue.notes[:2] == [("accept", 1.0), ("end", 1.0)]
        assert queue.outcomes[0].reason == "another goal came" and queue.outcomes[0].gave_up
        assert queue.outcomes[0].elapsed_s == pytest.approx(1.0, abs=0.15)
        assert 0.8 < queue.outcomes[0].distance_m < 1.0
        assert queue.busy != turns
        if turns:
            assert stops == [] and queue.notes[2:] == [("accept", 0.3), ("end", 0.3)]
            assert queue.outcomes[1].elapsed_s == pytest.approx(link.clock.now_s - 101.0, abs=0.25)
        else:
            assert link.velocity == (0.0, 0.0) and drive(queue, link) and queue.reached


def test_a_goal_is_driven_to_in_its_frame():
    for frame, x_m in (("", 0.2), ("map", -0.3), ("odom", 0.2)):
        queue, link = make_queue()
        link.origin = Pose(0.5, 0.0, 0.0)
        queue.put(ask(0.2, frame))
        assert drive(queue, link) and queue.reached and link.pose.x_m == pytest.approx(x_m, abs=0.01)


def test_each_goal_on_the_way_has_its_own_limits():
    queue, link = make_queue()
    queue.put(ask(5.0, timeout_s=3.0))
    assert drive(queue, link, [(2.0, lambda: queue.put(ask(9.0, timeout_s=4.0)))])
    assert link.clock.now_s == pytest.approx(106.1, abs=0.25) and "not there after 4 s" in queue.outcomes[1].reason
    assert not queue.outcomes[1].gave_up and not queue.reached


def test_a_goal_ends_by_its_own_cancellation_only():
    queue, link = make_queue()
    queue.put(ask(0.2, handle="mine"))
    assert drive(queue, link, [(0.5, lambda: queue.cancel("other"))]) and queue.reached
    queue.put(ask(5.0, handle="mine"))
    assert drive(queue, link, [(0.0, lambda: queue.cancel("mine"))])
    outcome = queue.outcomes[-1]
    assert (outcome.reached, outcome.gave_up, outcome.reason) == (False, True, "cancelled")
    assert outcome.elapsed_s < 0.5 and link.velocity == (0.0, 0.0) and not queue.reached and not queue.busy
    queue.put(ask(5.0))
    assert drive(queue, link, [(0.0, queue.give_up)])
    assert queue.outcomes[-1].reason == "the program ends" and queue.outcomes[-1].gave_up
    queue.put(ask(0.1))
    assert not drive(queue, link)


def test_a_goal_fails_with_the_robots_reason():
    queue, link = make_queue()
    link.ready_s = math.inf
    queue.put(ask(0.2, timeout_s=3.0))
    assert drive(queue, link)
    assert queue.outcomes[0].reason == "hero_3 is not ready after 3 s: nothing subscribes"
    assert not queue.outcomes[0].gave_up and math.isnan(queue.outcomes[0].distance_m)
    link.ready_s, link.ranges = 0.0, [0.06] + [math.inf] * 7
    queue.put(ask(0.5))
    assert drive(queue, link) and "an obstacle is in the way" in queue.outcomes[1].reason


def test_only_a_queue_that_avoids_drives_around_obstacles():
    for avoid in (True, False):
        queue, link = make_queue(avoid)
        link.ranges[0] = 0.06
        advance = link.advance

        def turn_away(step_s, link=link, advance=advance):
            advance(step_s)
            link.ranges[0] = 0.06 if abs(link.pose.yaw_rad) < 0.6 and link.pose.x_m < 0.1 else math.inf

        link.advance = turn_away
        queue.put(ask(0.4, timeout_s=30.0))
        assert drive(queue, link) and queue.reached == avoid, queue.outcomes


def test_a_server_gives_each_goal_its_own_limits_or_those_of_the_server(monkeypatch):
    server_module = pytest.importorskip("hero_client.apps.go_to_goal_server", reason="actionlib is ROS's")
    from geometry_msgs.msg import PoseStamped

    from hero_msgs.msg import GoToGoal

    logged = []
    for name in ("loginfo", "logwarn", "logerr", "logdebug"):
        monkeypatch.setattr(server_module.rospy, name, lambda *said, name=name: logged.append(name))
    server = server_module.GoToGoalServer.__new__(server_module.GoToGoalServer)
    robot, link = make_robot()
    server.robot, server._tolerance_m, server._timeout_s = robot, 0.02, 30.0
    put = []
    server.put = put.append
    server._news = SimpleNamespace(set=lambda: None)
    server._log = server_module.rospy.loginfo

    class Handle:
        def __init__(self, **limits):
            self.ends = []
            wanted = GoToGoal(use_heading=False, **limits)
            wanted.target.pose.position.x, wanted.target.header.frame_id = 0.3, "map"
            self.get_goal = lambda: wanted

        def __getattr__(self, name):
            return lambda *result: self.ends.append((name, *result))

    for limits, expected in (({}, (0.02, 30.0)), ({"tolerance": 0.05}, (0.05, 30.0)), ({"timeout": 2.0}, (0.02, 2.0))):
        server._receive_action(Handle(**limits))
        assert put[-1][:4] == (Goal(0.3, 0.0), "map", *expected) and put[-1].handle is not None
    message = PoseStamped()
    for z, yaw_rad in ((0.0, None), (1.0, math.pi)):
        message.pose.orientation.z = z
        server._receive_goal(message)
        assert put[-1] == (Goal(0.0, 0.0, yaw_rad), "", 0.02, 30.0, None)
    for limits in ({"tolerance": -1.0}, {"timeout": math.nan}):
        handle = Handle(**limits)
        server._receive_action(handle)
        assert handle.ends[0][0] == "set_rejected" and "tolerance and timeout" in handle.ends[0][1].reason
    assert len(put) == 5 and logged == ["logerr"] * 2
    logged.clear()
    for outcome, end, level in (
        ((True, False, "", 0.004, 2.0), "set_succeeded", "loginfo"),
        ((False, True, "cancelled", 0.1, 2.0), "set_canceled", "loginfo"),
        ((False, False, "an obstacle", 0.1, 2.0), "set_aborted", "logwarn"),
    ):
        for handle in (Handle(), None):
            server.end_goal(ask(0.3, handle=handle), server_module.goals.GoalOutcome(*outcome))
            assert logged.pop() == level
            if handle is not None:
                ((name, result, reason),) = handle.ends
                assert name == end and reason == result.reason == outcome[2]
                assert (result.reached, result.distance, result.elapsed) == (outcome[0], *outcome[3:])
    for handle, level in ((None, "logdebug"), (Handle(), "loginfo")):
        outcome = server_module.goals.GoalOutcome(False, True, "another goal came", 0.1, 2.0)
        server.end_goal(ask(0.3, handle=handle), outcome)
        assert logged.pop() == level, "goals on the topic may come as a stream"
    link.silent_s["odom"] = 2.0
    handle = Handle()
    server.accept_goal(ask(0.3, handle=handle))
    server.show_progress(ask(0.3, handle=handle), 0.2, 1.0)
    assert [name for name, *_ in handle.ends] == ["set_accepted", "publish_feedback"]
    assert (handle.ends[1][1].distance, handle.ends[1][1].elapsed) == (0.2, 1.0)
