"""The laws for one robot: limits, directions and the curve to a pose."""

import math

import pytest

from hero_client.controllers.unicycle import FOLLOW, GO_TO, TOLERANCE_RAD, follow, go_to_point, go_to_pose
from hero_node import STOP, Pose, measure_distance, wrap_angle

STEP_S = 0.02
PLACES = [(0.6, 0.0), (0.3, 0.4), (-0.2, 0.5), (-0.5, -0.1), (0.1, -0.4)]


def advance(pose, command):
    """Return the pose after a step of perfect wheels."""
    yaw_rad = pose.yaw_rad + command.angular_rad_s * STEP_S / 2.0
    return Pose(
        pose.x_m + command.linear_m_s * math.cos(yaw_rad) * STEP_S,
        pose.y_m + command.linear_m_s * math.sin(yaw_rad) * STEP_S,
        wrap_angle(pose.yaw_rad + command.angular_rad_s * STEP_S),
    )


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("yaw_rad", [-2.0, 0.0, 1.0, math.pi])
def test_a_smooth_curve_ends_at_the_place_with_the_heading(place, yaw_rad):
    pose, goal, fastest_m_s = Pose(0.0, 0.0, 0.0), Pose(*place, yaw_rad), 0.0
    at_goal = False
    for _ in range(3000):
        at_goal = at_goal or measure_distance(pose, goal) < GO_TO.tolerance_m
        command = go_to_pose(pose, goal, at_goal=at_goal)
        assert abs(command.linear_m_s) <= GO_TO.max_linear_m_s + 1e-9
        assert abs(command.angular_rad_s) <= GO_TO.max_angular_rad_s + 1e-9
        if command == STOP:
            break
        fastest_m_s = max(fastest_m_s, command.linear_m_s)
        pose = advance(pose, command)
    assert measure_distance(pose, goal) < 1.5 * GO_TO.tolerance_m
    assert abs(wrap_angle(pose.yaw_rad - yaw_rad)) < TOLERANCE_RAD
    assert fastest_m_s > 0.5 * GO_TO.max_linear_m_s


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("yaw_rad", [-2.0, 0.5, 3.0])
def test_a_turn_that_is_too_fast_slows_the_same_curve_down(place, yaw_rad):
    pose, goal = Pose(0.0, 0.0, 0.3), Pose(*place, yaw_rad)
    free = go_to_pose(pose, goal, GO_TO._replace(max_angular_rad_s=1e6))
    slow = go_to_pose(pose, goal, GO_TO._replace(max_angular_rad_s=0.01))
    assert slow.linear_m_s > 0.0
    assert slow.angular_rad_s == pytest.approx(math.copysign(0.01, free.angular_rad_s))
    assert slow.angular_rad_s / slow.linear_m_s == pytest.approx(free.angular_rad_s / free.linear_m_s)


def test_robots_are_driven_as_fast_as_the_documents_say():
    assert (GO_TO.max_linear_m_s, GO_TO.max_angular_rad_s, GO_TO.tolerance_m) == (0.12, 1.5, 0.01)
    assert (FOLLOW.gap_m, FOLLOW.max_linear_m_s, FOLLOW.max_angular_rad_s) == (0.15, 0.15, 2.0)


def test_the_curve_is_that_of_the_paper():
    # Equation 13 by hand: r = 0.5 m straight ahead, theta = 1 rad, delta = 0, k1 = 1, k2 = 2.
    command = go_to_pose(Pose(0.0, 0.0, 0.0), Pose(0.5, 0.0, 1.0))
    curvature_1_m = -(2.0 * (0.0 - math.atan(-1.0)) + (1.0 + 1.0 / 2.0) * 0.0) / 0.5
    assert command.angular_rad_s / command.linear_m_s == pytest.approx(curvature_1_m)
    assert command.linear_m_s == pytest.approx(0.12 / (1.0 + 0.003 * curvature_1_m**2))
    # delta = -0.5, theta = -0.5: the heading of the goal is that of the robot.
    command = go_to_pose(Pose(0.0, 0.0, -0.5), Pose(0.5, 0.0, -0.5))
    curvature_1_m = -(2.0 * (-0.5 - math.atan(0.5)) + (1.0 + 1.0 / 1.25) * math.sin(-0.5)) / 0.5
    assert command.angular_rad_s / command.linear_m_s == pytest.approx(curvature_1_m)


def test_near_its_goal_a_robot_slows_down_and_at_last_drives_straight():
    assert go_to_pose(Pose(0.0, 0.0, 0.0), Pose(0.05, 0.0, 0.0)) == pytest.approx((0.8 * 0.05, 0.0))
    for side in (0.01, -0.01):
        docking = go_to_pose(Pose(0.0, 0.0, 0.0), Pose(0.02, side, 2.0))
        assert docking == pytest.approx(go_to_point(Pose(0.0, 0.0, 0.0), 0.02, side))
    arrived = go_to_pose(Pose(0.0, 0.0, 0.0), Pose(0.009, 0.0, 0.2))
    assert arrived == pytest.approx((0.0, 1.5 * 0.2))
    assert go_to_pose(Pose(0.0, 0.0, 0.0), Pose(0.009, 0.0, -3.0)) == (0.0, -GO_TO.max_angular_rad_s)


def test_a_point_is_approached_by_the_nearer_end():
    law = GO_TO
    ahead, behind = go_to_point(Pose(0.0, 0.0, 0.0), 0.1, 0.01), go_to_point(Pose(0.0, 0.0, 0.0), -0.1, 0.01)
    angle_rad, distance_m = math.atan2(0.01, 0.1), math.hypot(0.1, 0.01)
    assert ahead == pytest.approx((0.8 * distance_m * math.cos(angle_rad), 1.5 * angle_rad))
    assert behind == pytest.approx((-ahead.linear_m_s, -ahead.angular_rad_s))
    assert go_to_point(Pose(0.0, 0.0, 0.0), 5.0, 0.0) == (law.max_linear_m_s, 0.0)
    assert go_to_point(Pose(0.0, 0.0, 0.1), 0.0, 5.0).angular_rad_s == law.max_angular_rad_s
    assert go_to_point(Pose(1.0, 2.0, 0.0), 1.0 + 0.99 * law.tolerance_m, 2.0) == STOP
    assert go_to_point(Pose(1.0, 2.0, 0.0), 1.0 + 1.01 * law.tolerance_m, 2.0) != STOP


def test_a_follower_keeps_its_gap_and_never_drives_backwards():
    def see(x_m, y_m=0.0):
        return follow(Pose(0.0, 0.0, 0.0), Pose(x_m, y_m, 1.0))

    assert see(FOLLOW.gap_m + 0.05) == pytest.approx((0.05, 0.0))
    assert see(FOLLOW.gap_m - 0.05) == (0.0, 0.0)
    assert see(9.0) == (FOLLOW.max_linear_m_s, 0.0)
    assert see(-9.0, -0.1) == (0.0, -FOLLOW.max_angular_rad_s)
    aside = see(0.2, 0.1)
    angle_rad = math.atan2(0.1, 0.2)
    assert aside.angular_rad_s == pytest.approx(2.0 * angle_rad)
    assert aside.linear_m_s == pytest.approx((math.hypot(0.2, 0.1) - FOLLOW.gap_m) * math.cos(angle_rad))
