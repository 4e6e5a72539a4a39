"""One goal to its end: reached, or failed with a reason."""

import math

import pytest
from test_controllers import STEP_S, Body, cast_in_box

from hero_client.controllers.go_to_goal import LAWS, SILENCE_S, Goal, GoToGoalController, State
from hero_client.geometry import STOP, Pose

HERE = Pose(0.0, 0.0, 0.0)


def drive(controller, body, longest_s=120.0, look=None):
    """Return the seconds until the controller ends."""
    now_s = 0.0
    while controller.state is State.ACTIVE and now_s < longest_s:
        body.step(controller.step(body.pose, look(body.pose) if look else None, now_s))
        now_s += STEP_S
    return now_s


@pytest.mark.parametrize("law", sorted(LAWS))
def test_a_goal_is_reached_within_its_tolerance_and_at_rest(law):
    for x_m, y_m in ((0.3, 0.0), (-0.2, 0.1), (0.0, -0.3), (0.001, 0.001)):
        body = Body(HERE)
        controller = GoToGoalController(Goal(x_m, y_m), 0.0, law=law)
        drive(controller, body)
        assert controller.state is State.REACHED and controller.reason == ""
        assert math.hypot(body.pose.x_m - x_m, body.pose.y_m - y_m) < 0.01
        assert abs(body.linear_m_s) < 1e-3
        assert controller.step(body.pose, None, 1000.0) == STOP


def test_the_smooth_law_ends_in_the_heading():
    body = Body(HERE)
    drive(GoToGoalController(Goal(0.3, 0.2, -2.0), 0.0), body)
    assert abs(math.remainder(body.pose.yaw_rad + 2.0, 2.0 * math.pi)) < 0.1


def test_the_time_limit_fails_with_what_is_left():
    controller = GoToGoalController(Goal(5.0, 0.0), 0.0, timeout_s=3.0)
    assert drive(controller, Body(HERE)) < 3.3
    assert controller.state is State.FAILED
    assert "not there after 3 s" in controller.reason and "are left" in controller.reason


def test_a_robot_that_falls_silent_fails_and_stops():
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0)
    assert controller.step(HERE, None, 0.0) != STOP
    assert controller.step(None, None, 0.1) == STOP
    assert controller.state is State.ACTIVE
    controller.step(None, None, SILENCE_S + 0.1)
    assert controller.state is State.FAILED and "no odometry" in controller.reason


def test_a_law_that_is_not_there_is_an_error_with_those_that_are():
    with pytest.raises(ValueError, match="tutorial, brisk, smooth"):
        GoToGoalController(Goal(1.0, 0.0), 0.0, law="fast")


def test_a_goal_behind_a_wall_fails_without_a_touch():
    half_m = 0.5
    for yaw_rad in (0.0, 0.4, 2.0):
        body = Body(Pose(0.0, 0.0, yaw_rad))
        controller = GoToGoalController(Goal(1.0, 0.1), 0.0, timeout_s=30.0)

        def look(pose, body=body):
            assert max(abs(pose.x_m), abs(pose.y_m)) < half_m - 0.037
            return cast_in_box(pose, half_m)

        drive(controller, body, look=look)
        assert controller.state is State.FAILED and "in the way" in controller.reason


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
    controller = GoToGoalController(Goal(0.7, 0.0), 0.0, timeout_s=60.0)
    drive(controller, body, look=look)
    assert controller.state is State.REACHED, controller.reason
