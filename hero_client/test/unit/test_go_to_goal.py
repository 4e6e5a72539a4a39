"""One goal to its end: reached, or failed with a reason."""

import math

import pytest
from test_controllers import STEP_S, Body, cast_in_box

from hero_client.controllers.go_to_goal import BLIND_S, PROGRESS_S, Goal, GoToGoalController
from hero_client.controllers.motion import BLOCKED_S, SILENT_STEPS, State
from hero_node import STOP, Pose

HERE = Pose(0.0, 0.0, 0.0)


def drive(controller, body, longest_s=120.0, look=None):
    """Return the seconds until the controller ends."""
    now_s = 0.0
    while controller.state is State.ACTIVE and now_s < longest_s:
        body.step(controller.step(body.pose, look(body.pose) if look else None, now_s))
        now_s += STEP_S
    return now_s


def test_a_goal_is_reached_within_its_tolerance_and_at_rest():
    for x_m, y_m in ((0.3, 0.0), (-0.2, 0.1), (0.0, -0.3), (0.001, 0.001)):
        body = Body(HERE)
        controller = GoToGoalController(Goal(x_m, y_m), 0.0)
        drive(controller, body)
        assert controller.state is State.REACHED and controller.reason == ""
        assert math.hypot(body.pose.x_m - x_m, body.pose.y_m - y_m) < 0.01
        assert abs(body.linear_m_s) < 1e-3
        assert controller.step(body.pose, None, 1000.0) == STOP


def test_a_goal_with_a_heading_ends_in_it():
    body = Body(HERE)
    drive(GoToGoalController(Goal(0.3, 0.2, -2.0), 0.0), body)
    assert abs(math.remainder(body.pose.yaw_rad + 2.0, 2.0 * math.pi)) < 0.1


def test_a_robot_that_falls_silent_fails_and_stops():
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0)
    assert controller.step(HERE, None, 0.0) != STOP
    for _ in range(SILENT_STEPS):
        assert controller.state is State.ACTIVE
        assert controller.step(None, None, 60.0) == STOP  # however late: the program itself may have stood still
    assert controller.state is State.FAILED and "no pose" in controller.reason


@pytest.mark.parametrize("avoid", [False, True])
def test_a_goal_behind_a_wall_fails_without_a_touch(avoid):
    half_m = 0.5
    for yaw_rad in (0.0, 0.4, 2.0):
        body = Body(Pose(0.0, 0.0, yaw_rad))
        controller = GoToGoalController(Goal(1.0, 0.1), 0.0, avoid=avoid)

        def look(pose, body=body):
            assert max(abs(pose.x_m), abs(pose.y_m)) < half_m - 0.037
            return cast_in_box(pose, half_m)

        assert drive(controller, body, look=look) < (60.0 if avoid else 20.0)
        assert controller.state is State.FAILED and "an obstacle is in the way" in controller.reason


def test_an_obstacle_on_the_way_is_gone_around():
    """A round obstacle of the size of a robot is between the robot and its goal."""
    thing, radius_m, body_m = (0.3, 0.01), 0.037, 0.037

    def look(pose):
        ranges = []
        for index in range(8):
            angle = pose.yaw_rad + index * math.pi / 4
            seen = []
            for ray in (angle - 0.21, angle, angle + 0.21):  # a sensor sees a cone
                ahead = (thing[0] - pose.x_m) * math.cos(ray) + (thing[1] - pose.y_m) * math.sin(ray)
                aside = (thing[1] - pose.y_m) * math.cos(ray) - (thing[0] - pose.x_m) * math.sin(ray)
                if ahead > 0.0 and abs(aside) < radius_m:
                    seen.append(ahead - math.sqrt(radius_m**2 - aside**2))
            nearest = min(seen, default=math.inf)
            ranges.append(nearest if nearest < 0.2368 else math.inf)
        assert math.hypot(pose.x_m - thing[0], pose.y_m - thing[1]) > radius_m + body_m
        return ranges

    body = Body(HERE)
    controller = GoToGoalController(Goal(0.7, 0.0), 0.0, timeout_s=60.0, avoid=True)
    drive(controller, body, look=look)
    assert controller.state is State.REACHED, controller.reason


def test_an_obstacle_that_leaves_in_time_ends_no_motion():
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0)
    near = [0.06] + [math.inf] * 7
    steps = int(0.6 * BLOCKED_S / STEP_S)
    for number in range(2 * steps + 1):
        is_free = number == steps
        command = controller.step(HERE, [math.inf] * 8 if is_free else near, STEP_S * number)
        assert (command.linear_m_s > 0.0) == is_free
    assert controller.state is State.ACTIVE


def test_a_goal_before_an_obstacle_or_beside_one_is_reached():
    """The goal is 0.05 m from a wall, center to wall, and the way along another wall is 0.01 m from the body."""
    half_m = 0.5
    for start, goal in ((HERE, Goal(0.45, 0.0)), (Pose(0.0, 0.453, 0.0), Goal(0.3, 0.453))):
        body = Body(start)
        controller = GoToGoalController(goal, 0.0)
        drive(controller, body, look=lambda pose: cast_in_box(pose, half_m))
        assert controller.state is State.REACHED, controller.reason


def test_a_robot_in_a_dead_end_gives_up_when_it_comes_no_nearer():
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0, avoid=True)
    for index in range(int(PROGRESS_S / STEP_S) + 2):
        # It turns to and fro, so its wheels are not stuck.
        controller.step(Pose(0.0, 0.0, 0.1 * (index % 2)), [0.06] * 8, STEP_S * index)
    assert controller.state is State.FAILED and "no nearer" in controller.reason


def test_a_robot_that_is_to_go_around_obstacles_but_sees_nothing_fails():
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0, avoid=True)
    steps = 0
    while controller.state is State.ACTIVE and steps < 100:
        assert controller.step(HERE, [math.nan] * 8, 0.1 * steps) == STOP
        steps += 1
    assert controller.state is State.FAILED and 0.1 * steps == pytest.approx(BLIND_S, abs=0.3)
    assert controller.reason.startswith("it cannot go around obstacles: ")
