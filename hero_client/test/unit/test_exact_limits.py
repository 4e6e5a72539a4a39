"""Limits at their very values, which random cases never meet: what still counts, and what does not any more."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hero_client.controllers.avoidance import (
    BODY_M,
    bend_around,
    find_in_path,
)
from hero_client.controllers.go_to_goal import BLIND_S, FREE_S, PROGRESS_M, PROGRESS_S, Goal, GoToGoalController
from hero_client.controllers.heading_check import MAX_TURN_RAD, MIN_DRIVE_M, MIN_SHARE, HeadingCheck, is_upside_down
from hero_client.controllers.lateness import COVERED_S, REPORT_PERIOD_S, STOP_S, Lateness
from hero_client.controllers.motion import AIM_SHARE, BLOCKED_S, SILENCE_S, STALL_S, State
from hero_client.controllers.orca import AvoidanceLaw, avoid_others, avoid_sensed, keep_apart
from hero_client.controllers.pose_check import FROZEN_S, JUMP_M, JUMP_WINDOW_S, FrozenCheck, PoseCheck, is_apart
from hero_client.controllers.swarm_go_to import DOCKING_M as SWARM_DOCKING_M
from hero_client.controllers.swarm_go_to import NUDGE_RAD, PATIENCE_S, SwarmGoToController
from hero_client.controllers.swarm_go_to import PROGRESS_M as SWARM_PROGRESS_M
from hero_client.controllers.unicycle import DOCKING_M, TOLERANCE_RAD, GoToLaw, go_to_point, go_to_pose
from hero_client.values.object_sensing import (
    NOTHING,
    OBJECT,
    ROBOT,
    Objects,
    PlacedObjects,
    Sight,
    sense_objects,
    sense_sight,
)
from hero_client.values.readings import MAX_POSITION_M, find_nearest, front_first, is_plausible
from hero_client.values.sensing import Binary, Neighbors, sense_binary, sense_neighbors
from hero_client.values.stamped_history import StampedHistory, interpolate_pose
from hero_node import STOP, Pose, Velocity
from hero_node.robot_constants import BODY_RADIUS_M

HERE = Pose(0.0, 0.0, 0.0)
FREE = [math.inf] * 8
STEP_S = 0.125  # of which sums are exact


def see(range_m, index=0):
    return [range_m if beam == index else math.inf for beam in range(8)]


def below(value):
    return float(np.nextafter(value, -np.inf))


def test_what_is_beside_a_robot_or_its_goal_is_not_in_the_way():
    assert find_in_path(see(math.nan, 2)) == (math.inf, None)
    command = Velocity(0.1, 0.0)
    assert bend_around(command, math.radians(100.0), 1.0, see(0.1)) == (command, 0)
    for range_m, is_creeping in ((BODY_M + 0.02, True), (below(BODY_M + 0.02), False)):
        ranges = see(range_m)
        ranges[2] = 0.1  # pushes on, past the one ahead
        assert (bend_around(command, 0.0, 1.0, ranges, -1)[0].linear_m_s > 0.0) == is_creeping


@pytest.mark.parametrize(("ranges", "limit_s"), [([math.nan] * 8, BLIND_S), (FREE, PROGRESS_S)])
def test_a_goal_with_detours_fails_once_its_time_has_passed(ranges, limit_s):
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0, avoid=True)
    controller._check_wheels = lambda odometry, command, seen_s: None
    for index in range(int(limit_s / STEP_S) + 2):
        assert controller.state is State.ACTIVE, index
        controller.step(HERE, ranges, STEP_S * index)
    assert controller.state is State.FAILED


def test_a_detour_keeps_its_side_and_progress_is_more_than_its_least():
    for free_s, is_kept in ((FREE_S, True), (FREE_S + STEP_S, False)):
        controller = GoToGoalController(Goal(1.0, 0.0), 0.0, avoid=True)
        controller.step(HERE, see(0.1, 1), 0.0)
        for index in range(1, int(free_s / STEP_S)):
            controller.step(HERE, FREE, STEP_S * index)
        assert (controller.step(HERE, see(0.1), free_s).angular_rad_s < 0.0) == is_kept
    controller = GoToGoalController(Goal(0.0, 0.0), 0.0, avoid=True)
    for x_m, nearest_m in ((1.0, 1.0), (1.0 - PROGRESS_M, 1.0), (0.75, 0.75)):
        controller.step(Pose(-x_m, 0.0, 0.0), FREE, 0.0)
        assert controller._min_distance_m == nearest_m


def test_a_blocked_way_and_wheels_that_stand_end_a_motion_in_time():
    for ranges, limit_s in ((see(BODY_RADIUS_M + 0.01), BLOCKED_S), (FREE, STALL_S)):
        controller = GoToGoalController(Goal(1.0, 0.0), 0.0)
        for index in range(int(limit_s / STEP_S) + 1):
            assert controller.state is State.ACTIVE
            controller.step(HERE, ranges, STEP_S * index)
        assert controller.state is State.FAILED


def test_a_pause_that_no_driver_minds_is_no_new_beginning_of_a_stall():
    for pause_s, begins_anew in ((SILENCE_S, False), (SILENCE_S + 0.001, True)):
        controller, index = GoToGoalController(Goal(1.0, 0.0), 0.0), 0
        controller.step(HERE, FREE, 0.0)
        while controller.state is State.ACTIVE:
            controller.step(HERE, FREE, pause_s + STEP_S * index)
            index += 1
        # Of a pause 0.2 s count.
        assert (index - 1 > int((STALL_S - 0.2) / STEP_S) + 1) == begins_anew and "do not turn" in controller.reason


def test_a_goal_begins_to_count_within_its_share_and_an_obstacle_before_it():
    aside = GoToGoalController(Goal(AIM_SHARE * 0.125, 0.0), 0.0, tolerance_m=0.125)
    assert aside.step(HERE, FREE, 0.0).linear_m_s > 0.0
    beyond, ranges = GoToGoalController(Goal(0.0625, 0.0), 0.0), see(BODY_RADIUS_M + 0.0625)
    free_m = find_in_path(ranges)[0]
    beyond.distance_m = free_m
    assert beyond._slow_for_obstacle(Velocity(0.125, 0.0), ranges, 0.0) == (0.125, 0.0), "it stands behind the goal"
    beyond.distance_m = free_m + 1e-9
    assert beyond._slow_for_obstacle(Velocity(0.125, 0.0), ranges, 0.0).linear_m_s < 0.04
    beyond._obstacle = find_nearest(see(0.0))
    assert "too close to measure" in beyond._describe_obstacle()


def test_a_place_is_reached_below_its_tolerance_and_a_goal_beside_is_ahead():
    law = GoToLaw(turn_gain=0.1, tolerance_m=0.125)
    for x_m, is_there in ((0.125, False), (below(0.125), True)):
        assert (go_to_point(HERE, x_m, 0.0, law) == STOP) == is_there
        assert (go_to_pose(HERE, Pose(x_m, 0.0, 0.0), law) == STOP) == is_there
    assert go_to_point(HERE, 0.0, 1.0, law).angular_rad_s == pytest.approx(0.05 * math.pi)
    for yaw_rad, is_turned in ((TOLERANCE_RAD, False), (below(TOLERANCE_RAD), True)):
        assert (go_to_pose(HERE, Pose(0.0, 0.0, yaw_rad)) == STOP) == is_turned
    for x_m, is_docking in ((DOCKING_M, False), (below(DOCKING_M), True)):
        assert (go_to_pose(HERE, Pose(x_m, 0.0, 1.0)).angular_rad_s == 0.0) == is_docking


def test_poses_are_apart_frozen_or_jumping_from_their_limits_on():
    assert not is_apart(HERE, Pose(0.25, 0.0, 0.5), 0.25, 0.5)
    assert is_apart(HERE, Pose(0.25, 0.0, 0.5), below(0.25), 0.5) and is_apart(
        HERE, Pose(0.25, 0.0, 0.5), 0.25, below(0.5)
    )
    frozen = FrozenCheck()
    assert [bool(frozen.add(HERE, Pose(now_s, 0.0, 0.0), now_s)) for now_s in (0.0, below(FROZEN_S), FROZEN_S)] == [
        False,
        False,
        True,
    ]
    for last_s, jump_m, is_told in (
        (JUMP_WINDOW_S, 0.125, True),
        (JUMP_WINDOW_S + STEP_S, 0.125, False),
        (JUMP_WINDOW_S, JUMP_M, False),
    ):
        check, told = PoseCheck(), ""
        for number, now_s in enumerate((-1.0, 0.0, 5.0, last_s)):
            told = check.add(Pose(jump_m if number % 2 else 0.0, 0.0, 0.0), HERE, now_s)
        assert bool(told) == is_told, (last_s, jump_m)


def test_headings_are_compared_over_long_straight_and_free_drives():
    moved_m = MIN_SHARE * MIN_DRIVE_M
    for seen, odometry, counts in (
        (Pose(moved_m, 0.0, 0.0), Pose(MIN_DRIVE_M, 0.0, MAX_TURN_RAD), True),
        (Pose(below(moved_m), 0.0, 0.0), Pose(MIN_DRIVE_M, 0.0, 0.0), False),
        (Pose(1.0, 0.0, 0.0), Pose(below(MIN_DRIVE_M), 0.0, 0.0), False),
        (Pose(1.0, 0.0, 0.0), Pose(1.0, 0.0, MAX_TURN_RAD + 1e-9), False),
    ):
        check = HeadingCheck()
        check.add(HERE, HERE)
        check.add(seen, odometry)
        assert bool(check.errors_rad) == counts, (seen, odometry)
    assert not is_upside_down(math.radians(135.0)) and is_upside_down(-math.radians(135.1))
    check = PoseCheck()
    for step in range(4):
        told = check.add(Pose(0.0625 * step, -0.0625 * step, 0.0), Pose(0.0884 * step, 0.0, 0.0), 0.0)
    assert told == "", "45 degrees are not more than 45"


def test_lateness_is_told_and_stops_robots_beyond_its_limits():
    def ask(period_s, age_s, planned_s=0.125):
        lateness = Lateness(planned_s)
        for now_s in (0.0, period_s):
            lateness.step(now_s)
        return lateness.find_share(age_s), lateness.take_warning()

    share, text = ask(0.125, STOP_S)
    assert share > 0.0 and text.endswith("percent meanwhile") and text.startswith("poses are 0.9 s old")
    assert ask(0.125, STOP_S + 1e-9)[0] == 0.0
    assert ask(0.125, COVERED_S) == (1.0, "")
    assert ask(0.375, 0.25)[1].startswith("commands are late by 0.5 s"), "half of it is the poses' age"
    lateness = Lateness(0.125)
    for now_s in (0.0, 0.5, 1.0, *(1.125 + 0.125 * index for index in range(14))):
        lateness.step(now_s)
    assert lateness.find_share(0.0) == pytest.approx(0.45), "counts from the last of them"
    lateness, told_s = Lateness(0.125), []
    for now_s in (0.0, 1.0, below(1.0 + REPORT_PERIOD_S), 1.0 + REPORT_PERIOD_S):
        lateness.step(now_s)
        lateness.find_share(0.0)
        told_s += [now_s] if lateness.take_warning() else []
    assert told_s == [1.0, 6.0]


def test_robots_and_walls_count_within_reach_alone():
    law = AvoidanceLaw(body_m=0.0)
    for range_m, is_near in ((law.sense_m, False), (below(law.sense_m), True)):
        _, _, bounds = avoid_sensed(np.zeros(1), [see(range_m)], np.zeros((1, 2)), law)
        assert np.isfinite(bounds).any() == is_near
    reach_m = 2.0 * (law.radius_m + law.max_linear_m_s * law.horizon_s)
    for apart_m, is_near in ((reach_m, False), (below(reach_m), True)):
        _, bounds = avoid_others(np.array([(0.0, 0.0), (apart_m, 0.0)]), np.zeros((2, 2)), law, 0.1)
        assert np.isfinite(bounds).any() == is_near


def test_discs_that_touch_come_apart_and_meeting_ones_pass_on_the_right():
    touching, _ = keep_apart(np.array([(0.125, 0.0)]), np.array([(0.5, 0.25)]), 0.125, 3.0, 0.1)
    assert touching[0] == pytest.approx((-0.75 / math.hypot(0.75, 0.25), 0.25 / math.hypot(0.75, 0.25)))
    for sign in (1.0, -1.0):
        head_on, _ = keep_apart(np.array([(sign, 0.0)]), np.array([(sign * 0.5, 0.0)]), 0.125, 3.0, 0.1)
        assert sign * head_on[0, 1] < 0.0


class Swarm:
    """A controller of robots that all go to one place, each alone in its world."""

    def __init__(self, robots, tolerance_m=0.01):
        self.law = AvoidanceLaw()
        self.controller = SwarmGoToController([(0.0, 0.0)] * robots, self.law, STEP_S, tolerance_m)
        self.robots = robots

    def wait(self, elapsed_s, distance_m=1.0):
        return self.controller._find_turns(np.full(self.robots, distance_m), elapsed_s)


def test_robots_of_a_jam_go_aside_after_their_patience_to_either_side():
    swarm = Swarm(400)
    swarm.wait(STEP_S)
    assert np.abs(swarm.wait(PATIENCE_S)).max() <= NUDGE_RAD, "not more than their patience"
    aside_rad = swarm.wait(0.5)
    sizes_rad = np.abs(aside_rad)
    assert 0.5 <= sizes_rad.min() < 0.53 and 2.47 < sizes_rad.max() <= 2.5 and abs((aside_rad > 0.0).mean() - 0.5) < 0.1
    assert (swarm.wait(1.5) == aside_rad).all(), "2 s aside, in one direction"
    assert np.abs(swarm.wait(STEP_S)).max() <= NUDGE_RAD
    for nearer_m, is_aside in ((SWARM_PROGRESS_M, True), (1.01 * SWARM_PROGRESS_M, False)):
        swarm = Swarm(1)
        swarm.wait(STEP_S)
        swarm.wait(PATIENCE_S, 1.0 - nearer_m)
        assert (abs(swarm.wait(STEP_S, 1.0 - nearer_m)[0]) > NUDGE_RAD) == is_aside


def test_a_robot_of_a_swarm_docks_and_has_arrived_below_its_distances():
    for x_m, is_docking in ((SWARM_DOCKING_M, False), (below(SWARM_DOCKING_M), True)):
        (command,) = Swarm(1).controller.step([Pose(-x_m, 0.0, 0.0)])
        assert (command.angular_rad_s == 0.0) == is_docking and command.linear_m_s > 0.0
    swarm = Swarm(1, tolerance_m=0.125)
    for x_m, has_arrived in ((AIM_SHARE * 0.125, False), (0.0625, True), (below(0.125), True), (0.125, False)):
        swarm.controller.step([Pose(-x_m, 0.0, 0.0)])
        assert swarm.controller.arrived == [has_arrived], x_m


class Never:
    """Random numbers that are not to be drawn: they would change those that follow."""

    def __getattr__(self, name):
        raise AssertionError(name)


class Always:
    """Random numbers that are all a quarter."""

    def random(self, *shape):
        return np.full(shape, 0.25)


def test_sensors_draw_numbers_for_their_own_errors_alone():
    poses = np.array([[(0.0, 0.0, 0.0), (0.0, 0.5, 0.0), (0.5, 0.0, 0.0), (0.25, BODY_RADIUS_M, 0.0)]])
    near = sense_neighbors(poses, Neighbors(field_rad=math.pi), Never())
    assert near.seen[0].tolist() == [False, True, True, True] and not near.seen[2].any()
    assert sense_binary(poses[:, [0, 3]], Binary(), Never()).tolist() == [False, False], "a beam that touches the rim"
    beside = np.array([[(0.0, 0.0, 0.0), (BODY_RADIUS_M, 1.05 * BODY_RADIUS_M, 0.0)]])
    assert sense_binary(beside, Binary()).tolist() == [False, False], "it just does not touch the sensor"
    assert sense_binary(poses, Binary(error=0.25), Always()).tolist() == sense_binary(poses, Binary()).tolist()
    assert sense_neighbors(poses, Neighbors(dropout=0.25), Always()).seen[0].tolist() == [False, True, True, True]
    assert sense_neighbors(poses, Neighbors(occlusion=True), Never()).seen[0, 2], "what touches the line hides nothing"


def test_objects_are_sensed_up_to_the_range_and_not_behind_robots():
    radii_m = np.array([BODY_RADIUS_M])
    poses = np.array([[(0.0, 0.0, 0.0), (0.75, 0.0, 0.0)]])
    gap_m = 0.75 - BODY_RADIUS_M - BODY_RADIUS_M
    far, same = (PlacedObjects(np.array([[(x_m, 0.0, 0.0)]]), radii_m) for x_m in (3.0, 0.75))
    for things, range_m, expected in (
        (far, gap_m, ROBOT),
        (far, below(gap_m), NOTHING),
        (same, gap_m, OBJECT),
        (PlacedObjects(np.array([[(BODY_RADIUS_M, BODY_RADIUS_M, 0.0)]]), radii_m), gap_m, ROBOT),
        (PlacedObjects(np.array([[(0.0, 0.0, 0.0)]]), radii_m), gap_m, ROBOT),
    ):
        assert sense_sight(poses, things, Sight(range_m))[0] == expected
    for range_m, is_seen in ((0.75, True), (below(0.75), False)):
        assert sense_objects(poses, same, Objects(range_m)).seen[0, 0] == is_seen


def test_numbers_of_robots_are_plausible_up_to_their_limits():
    for x_m, y_m, is_meant in ((MAX_POSITION_M, 0.0, True), (0.0, -MAX_POSITION_M, True), (0.0, 1000.1, False)):
        assert is_plausible(Pose(x_m, y_m, 0.0)) == is_meant
    for angle_min, increment, beams in (
        (-math.tau, math.pi / 4.0, 8),
        (0.0, 0.01, 0),
        (0.0, math.inf, 0),
        (-6.3, 1.0, 0),
    ):
        scan = SimpleNamespace(angle_min=angle_min, angle_increment=increment, ranges=[MAX_POSITION_M, *[0.0] * 7])
        assert len(front_first(scan)) == beams
    assert front_first(SimpleNamespace(angle_min=0.0, angle_increment=1.0, ranges=[MAX_POSITION_M] * 8)) == [1000.0] * 8
    assert find_nearest([math.inf] * 7 + [MAX_POSITION_M]).range_m == MAX_POSITION_M


def test_a_history_goes_on_for_what_it_keeps_and_begins_anew_beyond():
    history = StampedHistory(2.0, interpolate_pose)
    for stamp_s in (8.0, 10.0, 8.0):
        history.add(stamp_s, Pose(stamp_s, 0.0, 0.0))
    assert history.find(8.0) == (8.0, 0.0, 0.0) and history.newest_s == 10.0
    history.add(10.0, HERE)
    assert history.newest == (10.0, 0.0, 0.0), "one that is not newer is left out"
    history.add(7.5, Pose(7.5, 0.0, 0.0))
    assert history.newest_s == 7.5 and history.find(8.0) is None
