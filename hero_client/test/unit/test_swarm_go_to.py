"""Many robots to their goals: what each wants, when it has arrived, and what ends a jam."""

import math

import numpy as np
import pytest

from hero_client.controllers.half_planes import nearest_allowed, steer
from hero_client.controllers.orca import AvoidanceLaw, avoid_others, avoid_sensed, keep_apart
from hero_client.controllers.swarm_go_to import (
    ASIDE_S,
    DOCKING_M,
    NUDGE_RAD,
    PATIENCE_S,
    PROGRESS_M,
    SwarmGoToController,
)
from hero_node import STOP, Pose
from hero_node.robot_constants import BODY_RADIUS_M

LAW = AvoidanceLaw()
STEP_S = 0.1
HERE = Pose(0.0, 0.0, 0.0)


def make(*goals, **options):
    return SwarmGoToController(goals, LAW, STEP_S, **options)


def test_all_stop_while_one_pose_is_not_known_and_no_speed_follows_from_it():
    controller = make((2.0, 0.0), (-2.0, 0.5))
    far = Pose(9.0, 0.0, math.pi)
    first = controller.step([HERE, far])
    assert first[0].linear_m_s > 0.07
    assert controller.step([HERE, None]) == [STOP, STOP]
    # hero_1 was carried to a place 0.5 m ahead, where it stands: by the speed of its way hero_0 would turn away.
    linear_m_s, angular_rad_s = controller.step([HERE, Pose(0.5, 0.0, math.pi)])[0]
    assert linear_m_s > 0.03 and abs(angular_rad_s) < 0.3


def test_a_robot_that_comes_fast_is_avoided_by_its_measured_speed():
    for came_m, is_avoided in ((0.0, False), (0.02, True)):
        controller = make((2.0, 0.0), (-2.0, 0.0))
        controller.step([HERE, Pose(0.7 + came_m, 0.0, math.pi)])
        command = controller.step([Pose(0.008, 0.0, 0.0), Pose(0.7, 0.0, math.pi)])[0]
        assert (command.linear_m_s < 0.075) == is_avoided


def test_a_robot_wants_straight_to_its_goal_but_for_a_nudge(monkeypatch):
    asked = []
    monkeypatch.setattr(
        "hero_client.controllers.swarm_go_to.avoid_sensed",
        lambda yaws_rad, ranges, wanted, law: (asked.append(wanted), avoid_sensed(yaws_rad, ranges, wanted, law))[1],
    )
    for distance_m, speed_m_s in ((1.0, 0.08), (0.1, 0.08), (0.05, 0.04)):
        controller = make((0.0, distance_m), (5.0, 0.0))
        asked.clear()
        for _ in range(39):  # less than its patience
            controller.step([HERE, Pose(4.0, 0.0, 0.0)])
        wanted = np.array(asked)[:, 0]
        assert np.hypot(*wanted.T) == pytest.approx(speed_m_s)
        turns_rad = np.arctan2(-wanted[:, 0], wanted[:, 1])
        assert -NUDGE_RAD <= turns_rad.min() < -0.7 * NUDGE_RAD and 0.7 * NUDGE_RAD < turns_rad.max() <= NUDGE_RAD
    make(tuple(HERE[:2])).step([HERE])
    assert asked[-1].tolist() == [[0.0, 0.0]]


def test_a_jam_is_left_to_the_side_for_two_seconds_and_judged_anew():
    controller = make((1.0, 0.0), (0.0, 1.0))
    turns_rad = np.array([controller._find_turns(np.array((1.0, 9.0 - 0.1 * step)), STEP_S) for step in range(130)])
    assert np.abs(turns_rad[:, 1]).max() <= NUDGE_RAD, "it makes progress"
    aside = np.abs(turns_rad[:, 0]) > NUDGE_RAD
    assert 0.49 < np.abs(turns_rad[aside, 0]).min() <= np.abs(turns_rad[aside, 0]).max() < 2.51
    begins = np.flatnonzero(aside[1:] & ~aside[:-1]) + 1
    assert [begins[0] * STEP_S, (begins[1] - begins[0]) * STEP_S] == pytest.approx(
        [PATIENCE_S, PATIENCE_S + ASIDE_S], abs=0.21
    )
    assert len(set(turns_rad[aside, 0])) == 2, "one angle each time"
    assert aside[: begins[1]].sum() * STEP_S == pytest.approx(ASIDE_S, abs=0.11)
    for nearer_m, is_jam in ((0.009, True), (PROGRESS_M, True), (0.011, False)):
        controller = make((1.0, 0.0))
        for index in range(60):
            turn_rad = controller._find_turns(np.array([1.0 if index < 30 else 1.0 - nearer_m]), STEP_S)[0]
        assert (abs(turn_rad) > NUDGE_RAD) == is_jam


def test_a_robot_arrives_within_a_share_of_the_tolerance_and_leaves_beyond():
    controller = make((0.0, 0.0), (5.0, 0.0))
    other = Pose(4.0, 0.0, 0.0)
    for x_m, has_arrived in (
        (0.02, False),
        (0.009, False),
        (0.006, True),
        (0.009, True),
        (0.011, False),
        (0.009, False),
    ):
        commands = controller.step([Pose(x_m, 0.0, 0.0), other])
        assert controller.arrived == [has_arrived, False]
        assert (commands[0] == STOP) == has_arrived and commands[1] != STOP


def test_near_its_goal_a_free_robot_steers_its_center():
    # Beside its goal, 0.03 m to the left: the point ahead of the axle would go sideways at once.
    for distance_m, is_docking in ((DOCKING_M - 0.001, True), (DOCKING_M + 0.001, False)):
        controller = make((0.0, distance_m))
        command = controller.step([HERE])[0]
        # The center's law turns by 1.5 rad/s per rad; the steered point would move along its left at 0.8 * distance.
        expected_rad_s = 1.5 * math.pi / 2.0 if is_docking else 0.8 * distance_m / LAW.lookahead_m
        assert command.angular_rad_s == pytest.approx(min(expected_rad_s, 1.5 if is_docking else 2.5), abs=0.02)
    # With something in the way it stays with what is allowed.
    blocked = make((DOCKING_M - 0.01, 0.0))
    ranges = [[BODY_RADIUS_M + 0.03] + [math.inf] * 7]
    assert blocked.step([HERE], ranges)[0].linear_m_s == pytest.approx(0.0, abs=0.003)


def test_what_is_sensed_turns_the_wanted_velocity_to_the_right():
    for gap_m, speed_m_s, expected in (
        (0.10, 0.08, (0.08, 0.0)),
        (0.0999, 0.08, (0.0699, -0.0101)),
        (0.05, 0.08, (0.02, -0.06)),
        (0.03, 0.08, (0.0, -0.08)),
        (0.02, 0.08, (-0.01, -0.08)),
        (0.0, 0.08, (-0.02, -0.08)),
        (0.0, 0.0, (-0.02, 0.0)),
        (0.0, -0.03, (-0.03, 0.0)),
    ):
        ranges = [BODY_RADIUS_M + gap_m] + [math.inf] * 7
        wanted, normals, bounds = avoid_sensed(np.zeros(1), [ranges], np.array([(speed_m_s, 0.0)]), LAW)
        assert wanted[0] == pytest.approx(expected) and normals[0, 0] == pytest.approx((-1.0, 0.0))
        limit = -max(gap_m - 0.03, -0.02) if gap_m < LAW.sense_m else -math.inf
        assert bounds[0] == pytest.approx([limit] + [-math.inf] * 7)


def test_robots_that_overlap_come_apart_within_a_step():
    for offset in ((0.1, 0.0), (0.0, -0.05)):
        offset, radius_m = np.array(offset), 0.15
        for velocity in (np.zeros(2), np.array([0.05, 0.02])):
            normal, depth = keep_apart(offset, velocity, radius_m, 3.0, 0.1)
            changed = velocity + normal * depth
            assert np.hypot(*(offset - changed * 0.1)) == pytest.approx(radius_m)
    normal, depth = keep_apart(np.zeros(2), np.zeros(2), 0.15, 3.0, 0.1)
    assert normal.tolist() == [-1.0, 0.0] and depth == pytest.approx(1.5)


def test_each_robot_takes_half_of_the_change_and_looks_at_the_nearest_ones():
    places, ahead = np.array([(0.0, 0.0), (0.3, 0.0)]), np.array((0.08, 0.0))
    gap_m = 0.3 - 2.0 * LAW.radius_m

    def avoid(places, wanted):
        planes = avoid_others(places, np.zeros_like(places), LAW, STEP_S)
        return nearest_allowed(np.tile(wanted, (len(places), 1)), *planes, LAW.max_linear_m_s)

    # Head on, from rest: together they may close the gap within the horizon, each half of it.
    assert avoid(places, ahead)[0] == pytest.approx((0.5 * gap_m / LAW.horizon_s, 0.0))
    assert avoid(places, np.zeros(2)).tolist() == [[0.0, 0.0], [0.0, 0.0]]
    crowd = np.vstack((places, [(-0.2, 0.001 * index) for index in range(LAW.neighbors)]))
    assert avoid(crowd, ahead)[0, 0] > 0.07 and LAW.neighbors == 6, "as many as fit around one are nearer"
    assert avoid(crowd[:-1], ahead)[0, 0] < 0.07
    assert avoid(places[:1], ahead).tolist() == [[0.08, 0.0]], "a robot alone"


def test_commands_beyond_the_limits_are_slowed_down_as_a_whole():
    for velocity, expected in (
        ((0.08, 0.0), (0.08, 0.0)),
        ((0.16, 0.03), (0.08, 0.5)),
        ((0.02, -0.15), (0.01, -2.5)),
        ((-0.1, 0.0), (-0.08, 0.0)),
    ):
        assert steer(*velocity, LAW.max_linear_m_s, LAW.lookahead_m) == pytest.approx(expected)
