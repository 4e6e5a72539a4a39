"""The frame of every motion: its limits in time and space, one by one."""

import math
import random

import pytest

from hero_client.controllers.go_to_goal import PROGRESS_S, Goal, GoToGoalController
from hero_client.controllers.motion import (
    BLOCKED_S,
    DEFAULT_TIMEOUT_S,
    MAX_STEP_S,
    SETTLE_S,
    STALL_S,
    MotionController,
    State,
)
from hero_client.controllers.pose_check import FROZEN_S
from hero_client.controllers.straight_and_turn import ForwardController, TurnController
from hero_node import STOP, Pose, Velocity, transform_pose
from hero_node.robot_constants import BODY_RADIUS_M

HERE = Pose(0.0, 0.0, 0.0)
FREE = [math.inf] * 8
STEP_S = 0.1


class Steady(MotionController):
    """A motion that always wants the same, far from its end."""

    def __init__(self, *wanted):
        super().__init__(0.0, 100.0)
        self._wanted = Velocity(*wanted)
        self.distance_m = 1.0

    def _offset(self, pose):
        return 9.0

    def _approach(self, pose, ranges, seen_s):
        return self._wanted


def see(ahead_m, index=0):
    """Return ranges with one thing, so far from the rim."""
    ranges = list(FREE)
    ranges[index] = BODY_RADIUS_M + ahead_m
    return ranges


def step_until_end(controller, read_pose, longest_s, ranges=None, odometry=None):
    """Return the seconds after which the motion has ended, or longest_s."""
    for index in range(int(longest_s / STEP_S)):
        now_s = STEP_S * index
        controller.step(read_pose(now_s), ranges, now_s, odometry and odometry(now_s))
        if controller.state is not State.ACTIVE:
            return now_s
    return longest_s


def test_a_goal_is_reached_half_a_second_after_the_stop():
    controller = GoToGoalController(Goal(0.0, 0.0), 0.0)
    assert step_until_end(controller, lambda now_s: HERE, 2.0) == pytest.approx(SETTLE_S, abs=0.11)
    assert controller.state is State.REACHED
    exact = GoToGoalController(Goal(0.0, 0.0), 0.0)
    for index in range(5):
        exact.step(HERE, None, 0.125 * index)
        assert (exact.state is State.REACHED) == (0.125 * index >= SETTLE_S)
    pushed = GoToGoalController(Goal(0.0, 0.0), 0.0)
    # Inside 0.7 of the tolerance it stops, outside all of it it starts anew, and the half second with it.
    for index, (x_m, is_stopped) in enumerate(
        ((0.0, True), (0.009, True), (0.011, False), (0.009, False), (0.006, True))
    ):
        assert (pushed.step(Pose(x_m, 0.0, math.pi), None, 0.2 * index) == STOP) == is_stopped
    for number in range(1, 4):
        assert pushed.state is State.ACTIVE
        pushed.step(HERE, None, 0.8 + 0.2 * number)
    assert pushed.state is State.REACHED


def test_a_goal_with_a_heading_is_not_reached_before_it_has_turned():
    controller = GoToGoalController(Goal(0.0, 0.0, 1.0), 0.0)
    assert controller.step(HERE, None, 0.0) == (0.0, 1.5)
    assert step_until_end(controller, lambda now_s: Pose(0.0, 0.0, min(1.0, now_s)), 5.0) == pytest.approx(
        1.5, abs=0.11
    )
    assert controller.state is State.REACHED


def test_pauses_of_the_program_count_little_except_for_the_time_limit():
    for stopped_s in (60.0, MAX_STEP_S):
        controller = GoToGoalController(Goal(0.0, 0.0), 0.0)
        controller.step(HERE, None, 0.0)
        controller.step(HERE, None, stopped_s)
        controller.step(HERE, None, stopped_s + 0.2)
        assert controller.state is State.ACTIVE
    late = GoToGoalController(Goal(1.0, 0.0), 10.0, timeout_s=5.0)
    late.step(HERE, None, 15.0)
    assert late.state is State.ACTIVE
    late.step(HERE, None, 15.01)
    assert late.state is State.FAILED and late.reason == "not there after 5 s, 1.000 m are left"


def test_the_nearer_an_obstacle_in_the_way_the_slower():
    for ahead_m, speed_m_s in ((0.2, 0.12), (0.17, 0.12), (0.07, 0.04), (0.033, 0.0104), (0.032, 0.0), (0.0, 0.0)):
        for sign, index in ((1.0, 0), (-1.0, 4)):
            command = Steady(sign * 0.12, 0.3).step(HERE, see(ahead_m, index), 0.0)
            assert command == pytest.approx((sign * speed_m_s, 0.3))
            assert Steady(-sign * 0.12, 0.3).step(HERE, see(ahead_m, index), 0.0) == (-sign * 0.12, 0.3)
    beyond = Steady(0.12, 0.0)
    beyond.distance_m = 0.06
    assert beyond.step(HERE, see(0.061), 0.0) == (0.12, 0.0), "the goal is nearer"


def test_a_blocked_motion_fails_after_two_seconds_without_a_break():
    assert step_until_end(Steady(0.1, 0.3), lambda now_s: HERE, 9.0, see(0.03)) == pytest.approx(BLOCKED_S, abs=0.11)
    controller = Steady(0.1, 0.3)
    for index in range(40):
        # Every second there is room to creep on.
        controller.step(Pose(0.01 * index, 0.0, 0.0), see(0.04 if index % 10 == 9 else 0.02), STEP_S * index)
    assert controller.state is State.ACTIVE
    turning = step_until_end(Steady(0.0, 0.3), lambda now_s: Pose(0.0, 0.0, 0.3 * now_s), 9.0, see(0.0))
    assert turning == 9.0, "nothing is in the way of a turn on the spot"


def test_wheels_that_stand_still_are_told_from_slow_commands_and_noise():
    for wanted, is_stalled in (
        ((0.02, 0.0), True),
        ((-0.02, 0.0), True),
        ((-0.019, 0.19), False),
        ((0.0, -0.2), True),
    ):
        ended_s = step_until_end(Steady(*wanted), lambda now_s: HERE, 9.0)
        assert ended_s == (pytest.approx(STALL_S, abs=0.11) if is_stalled else 9.0)
    for far, turn, is_stalled in ((0.004, 0.0, True), (0.006, 0.0, False), (0.0, 0.04, True), (0.0, 0.06, False)):
        controller = Steady(0.1, 0.0)

        def swing(now_s, far=far, turn=turn):
            return Pose(far, 0.0, turn) if int(now_s) % 2 else HERE

        assert (step_until_end(controller, swing, 9.0) < 9.0) == is_stalled


def test_wheels_that_a_pause_of_the_program_stopped_have_their_time_anew():
    for pause_s, goes_on in ((0.39, False), (0.41, True)):
        controller, now_s = Steady(0.1, 0.0), 0.0
        for _ in range(int(0.8 * STALL_S / STEP_S)):
            now_s += STEP_S
            controller.step(HERE, None, now_s)
        now_s += pause_s
        for _ in range(int(0.8 * STALL_S / STEP_S)):
            controller.step(HERE, None, now_s)
            now_s += STEP_S
        assert (controller.state is State.ACTIVE) == goes_on


def test_a_frozen_pose_is_told_from_blocked_wheels():
    frozen, held = Steady(0.1, 0.0), Steady(0.1, 0.0)

    def freeze_after_a_second(now_s):
        return Pose(0.1 * min(now_s, 1.0), 0.0, 0.0)

    ended_s = step_until_end(frozen, freeze_after_a_second, 9.0, odometry=lambda now_s: Pose(0.1 * now_s, 0.0, 0.0))
    assert ended_s == pytest.approx(1.0 + FROZEN_S, abs=0.2)
    assert "its wheels turn, but its pose stays the same" in frozen.reason
    assert step_until_end(held, lambda now_s: HERE, 9.0, odometry=lambda now_s: HERE) < STALL_S + 0.2
    assert "its wheels do not turn" in held.reason


def test_a_pose_against_the_odometry_ends_the_motion():
    turned = Steady(0.1, 0.0)
    step_until_end(
        turned, lambda now_s: Pose(-0.1 * now_s, 0.0, 0.0), 9.0, odometry=lambda now_s: Pose(0.1 * now_s, 0.0, 0.0)
    )
    assert "about 180 degrees off" in turned.reason.replace("-180", "180")
    assert turned.step(HERE, None, 9.0) == STOP


def test_straight_and_turn_slow_down_to_their_least_speeds():
    for left_m, speed_m_s in ((1.0, 0.15), (0.1, 0.08), (0.01, 0.02), (-0.1, -0.08), (-0.01, -0.02)):
        assert ForwardController(left_m, 0.0, 0.15).step(HERE, None, 0.0) == pytest.approx((speed_m_s, 0.0))
    for left_rad, speed_rad_s in ((3.0, 2.0), (1.0, 1.5), (0.1, 0.2), (-1.0, -1.5), (-0.05, -0.2)):
        assert TurnController(left_rad, 0.0, 2.0).step(HERE, None, 0.0) == pytest.approx((0.0, speed_rad_s))
    for off_rad, turn_rad_s in ((0.1, -0.15), (-0.2, 0.3), (2.0, -1.0)):
        controller = ForwardController(1.0, 0.0, 0.1)
        controller.step(Pose(0.0, 0.0, 3.0), None, 0.0)
        assert controller.step(Pose(0.0, 0.0, 3.0 + off_rad), None, 0.1).angular_rad_s == pytest.approx(turn_rad_s)
    turning = TurnController(4.0, -DEFAULT_TIMEOUT_S, 1.0)
    for index in range(12):
        turning.step(Pose(0.0, 0.0, math.remainder(3.0 + 0.1 * index, math.tau)), None, STEP_S * (index - 10))
    assert turning.reason == "not there after 120 s, 3.00 rad are left"


def test_another_goal_on_the_way_has_its_own_time_and_place():
    controller = GoToGoalController(Goal(0.0, 0.0), 0.0, timeout_s=1.0)
    for index in range(4):
        controller.step(HERE, None, STEP_S * index)
    controller.change_goal(Goal(0.02, 0.0), 0.05, 2.0, 0.5)
    assert controller.step(HERE, None, 0.6) == STOP and controller.state is State.ACTIVE, "the half second begins anew"
    controller.change_goal(Goal(0.036, 0.0), 0.05, 2.0, 0.7)
    assert controller.step(HERE, None, 0.8).linear_m_s > 0.0, "within the tolerance, but not 0.7 of it"
    controller.step(Pose(-0.1, 0.0, 0.0), None, 2.7)
    assert controller.state is State.ACTIVE
    controller.step(Pose(-0.1, 0.0, 0.0), None, 2.71)
    assert controller.state is State.FAILED


def test_another_goal_on_the_way_may_be_farther_than_the_first_one_was():
    controller = GoToGoalController(Goal(0.1, 0.0), 0.0, avoid=True)
    for index in range(int(1.5 * PROGRESS_S / STEP_S)):
        controller.step(Pose(0.011 * index, 0.0, 0.0), FREE, STEP_S * index)
        if index == 5:
            controller.change_goal(Goal(9.0, 0.0), 0.01, 100.0, STEP_S * index)
    assert controller.state is State.ACTIVE, controller.reason


def test_the_side_of_a_detour_is_kept_for_a_while():
    for free_s, is_kept in ((1.3, True), (1.7, False)):
        controller = GoToGoalController(Goal(1.0, 0.0), 0.0, avoid=True)
        left, right = list(FREE), list(FREE)
        left[1] = right[7] = 0.1
        assert controller.step(HERE, left, 0.0).angular_rad_s < 0.0
        for number in range(1, int(free_s / STEP_S) + 1):
            controller.step(Pose(0.01 * number, 0.0, 0.0), FREE, STEP_S * number)
        ahead = list(FREE)
        ahead[0] = 0.1
        turn_rad_s = controller.step(Pose(0.2, 0.0, 0.0), ahead, free_s + STEP_S).angular_rad_s
        assert (turn_rad_s < 0.0) == is_kept
        assert (
            controller._describe_obstacle()
            == "an obstacle is in the way, 0.10 m from the robot's center, at +0 degrees"
        )


def test_a_detour_that_comes_nearer_now_and_then_goes_on():
    for nearer_m, goes_on in ((0.009, False), (0.011, True)):
        controller = GoToGoalController(Goal(1.0, 0.0), 0.0, avoid=True)
        for index in range(int(1.5 * PROGRESS_S / STEP_S)):
            x_m = nearer_m if index >= 0.9 * PROGRESS_S / STEP_S else 0.0
            controller.step(Pose(x_m, 0.0, 0.1 * (index % 2)), FREE, STEP_S * index)
        assert (controller.state is State.ACTIVE) == goes_on


def test_a_motion_is_the_same_wherever_its_frame_begins():
    rng = random.Random(4)
    for trial in range(60):
        origin = Pose(*(rng.uniform(-3.0, 3.0) for _ in range(3)))
        pose = Pose(*(rng.uniform(-0.5, 0.5) for _ in range(2)), rng.uniform(-3.0, 3.0))
        goal = Pose(*(rng.uniform(-0.5, 0.5) for _ in range(2)), rng.uniform(-3.0, 3.0))
        ranges = [rng.choice((math.inf, math.nan, 0.06, 0.12, 0.17)) for _ in range(8)]
        commands = []
        for here, there in ((pose, goal), (transform_pose(origin, pose), transform_pose(origin, goal))):
            place = Goal(there.x_m, there.y_m, there.yaw_rad if trial % 2 else None)
            controller = GoToGoalController(place, 0.0, avoid=trial % 3 > 0)
            commands.append(controller.step(here, ranges, 0.0))
        assert commands[1] == pytest.approx(commands[0], abs=1e-9)
