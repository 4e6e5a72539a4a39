"""Controllers over grids of starts, goals and obstacles, on a body with the lags of the real one."""

import itertools
import math
import random

import pytest

from hero_client.controllers.avoidance import WanderMemory, find_in_path, split_sectors, wander
from hero_client.controllers.unicycle import FollowLaw, GoToLaw, follow, go_to_point, go_to_pose
from hero_node import STOP, Pose, wrap_angle
from hero_node.robot_constants import BODY_RADIUS_M
from hero_test.nonempty import nonempty

INF = math.inf
FREE = [INF] * 8

STEP_S = 0.1
LAG_S = 0.5
"""Of the robot's speed controller."""


class Body:
    """A robot on a plane: speeds follow commands with a lag, stopping is quick."""

    def __init__(self, pose):
        self.pose = pose
        self.linear_m_s = self.angular_rad_s = 0.0

    def step(self, command):
        for _ in range(10):
            share = STEP_S / 10.0 / (0.05 if command == STOP else LAG_S)
            self.linear_m_s += share * (command.linear_m_s - self.linear_m_s)
            self.angular_rad_s += share * (command.angular_rad_s - self.angular_rad_s)
            x_m, y_m, yaw_rad = self.pose
            travel_m = self.linear_m_s * STEP_S / 10.0
            self.pose = Pose(
                x_m + travel_m * math.cos(yaw_rad),
                y_m + travel_m * math.sin(yaw_rad),
                yaw_rad + self.angular_rad_s * STEP_S / 10.0,
            )


def distance_m(pose, x_m, y_m):
    return math.hypot(pose.x_m - x_m, pose.y_m - y_m)


GRID = [
    (distance, bearing, heading)
    for distance, bearing, heading in itertools.product(
        (0.05, 0.3, 1.0), [i * math.pi / 6 for i in range(12)], [i * math.pi / 4 for i in range(8)]
    )
]


def test_go_to_point_arrives_from_every_side_and_stays():
    law, longest_s = GoToLaw(), 40.0
    for distance, bearing, heading in GRID:
        body = Body(Pose(0.0, 0.0, heading))
        x_m, y_m = distance * math.cos(bearing), distance * math.sin(bearing)
        arrived_s = None
        for index in nonempty(range(int(longest_s / STEP_S))):
            command = go_to_point(body.pose, x_m, y_m, law)
            assert abs(command.linear_m_s) <= law.max_linear_m_s + 1e-12
            assert abs(command.angular_rad_s) <= law.max_angular_rad_s + 1e-12
            body.step(command)
            if command == STOP:
                arrived_s = index * STEP_S
                break
        assert arrived_s is not None, (distance, bearing, heading, body.pose)
        for _ in range(20):
            body.step(go_to_point(body.pose, x_m, y_m, law))
        assert distance_m(body.pose, x_m, y_m) < law.tolerance_m + 0.002


def test_go_to_pose_arrives_with_the_heading_from_every_side():
    for (distance, bearing, heading), goal_yaw in itertools.product(GRID[::3], (0.0, 1.5, 3.0, -2.0)):
        goal = Pose(distance * math.cos(bearing), distance * math.sin(bearing), goal_yaw)
        body = Body(Pose(0.0, 0.0, heading))
        at_goal = False
        for _ in range(900):
            at_goal = at_goal or distance_m(body.pose, goal.x_m, goal.y_m) < 0.01
            command = go_to_pose(body.pose, goal, at_goal=at_goal)
            body.step(command)
            if command == STOP:
                break
        assert command == STOP, (distance, bearing, heading, goal_yaw, body.pose)
        assert distance_m(body.pose, goal.x_m, goal.y_m) < 0.02
        assert abs(wrap_angle(body.pose.yaw_rad - goal_yaw)) < 0.1


def test_follow_keeps_the_gap_behind_a_leader_that_drives_a_curve():
    law = FollowLaw()
    leader, follower = Body(Pose(0.3, 0.0, 0.0)), Body(Pose(0.0, 0.0, 1.0))
    gaps_m = []
    for index in range(600):
        leader.step(go_to_point(leader.pose, 0.5 * math.cos(index / 100), 0.5 * math.sin(index / 100)))
        command = follow(follower.pose, leader.pose, law)
        assert command.linear_m_s >= 0.0
        follower.step(command)
        gaps_m.append(distance_m(follower.pose, leader.pose.x_m, leader.pose.y_m))
    assert min(gaps_m) > 0.09
    assert max(gaps_m[300:]) < 0.30


def test_each_beam_counts_for_its_sector():
    for index, sector in ((0, 1), (1, 0), (7, 2)):
        ranges = list(FREE)
        ranges[index] = 0.1
        seen = split_sectors(ranges)
        assert seen[sector] == 0.1 and sum(math.isinf(value) for value in seen) == 2
    for index in (2, 3, 4, 5, 6):
        ranges = list(FREE)
        ranges[index] = 0.05
        assert split_sectors(ranges) == (INF, INF, INF)


def test_only_what_the_body_would_touch_is_in_its_path():
    assert find_in_path(FREE) == (INF, None)
    free_m, obstacle = find_in_path([0.12] + [INF] * 7)
    assert free_m == pytest.approx(0.12 - BODY_RADIUS_M) and obstacle == (0.12, 0.0)
    assert find_in_path([0.12] + [INF] * 7, backward=True) == (INF, None)
    rear = [INF] * 4 + [0.10, 0.05, INF, INF]
    assert find_in_path(rear, backward=True)[1] == pytest.approx((0.05, -0.75 * math.pi))
    # 45 degrees aside: touched only if nearer than the body is wide; to the side: never.
    assert find_in_path([INF, 0.06, 0.04] + [INF] * 5) == (INF, None)
    assert find_in_path([INF, 0.0] + [INF] * 6)[0] == pytest.approx(0.017, abs=0.001)
    assert find_in_path([0.0] + [INF] * 7)[0] == pytest.approx(0.01)


def test_a_path_that_a_sensor_does_not_tell_of_is_never_free():
    for index, is_backward in ((0, False), (1, False), (7, False), (3, True), (4, True), (5, True)):
        ranges = list(FREE)
        ranges[index] = math.nan
        free_m, obstacle = find_in_path(ranges, is_backward)
        assert math.isnan(free_m) and obstacle is None
        assert find_in_path(ranges, not is_backward) == (INF, None), "the other side is known"
        ranges[4 if is_backward else 0] = 0.12
        assert find_in_path(ranges, is_backward)[1] is not None or index in (0, 4), "what is seen counts"
    assert math.isnan(find_in_path([])[0])


def cast_in_box(pose, half_m):
    """Return the eight ranges inside a square room, inf beyond what the sensors see."""
    ranges = []
    for index in range(8):
        angle = pose.yaw_rad + index * math.pi / 4
        hits = []
        for place, way in ((pose.x_m, math.cos(angle)), (pose.y_m, math.sin(angle))):
            if abs(way) > 1e-9:
                hits.append(((half_m if way > 0 else -half_m) - place) / way)
        range_m = min(hits)
        ranges.append(range_m if range_m < 0.2368 else INF)
    return ranges


def test_a_wanderer_never_touches_the_walls_of_a_room_and_sees_most_of_it():
    half_m, body_m = 0.5, 0.0369
    for seed in range(6):
        rng = random.Random(seed)
        body = Body(Pose(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-3.0, 3.0)))
        memory, cells, ranges = WanderMemory(), set(), FREE
        for index in range(6000):
            if index % 2 == 0:
                ranges = cast_in_box(body.pose, half_m)
            command, memory = wander(ranges, memory, rng.random())
            body.step(command)
            assert max(abs(body.pose.x_m), abs(body.pose.y_m)) < half_m - body_m, (seed, index, body.pose)
            cells.add((int((body.pose.x_m + half_m) / 0.2), int((body.pose.y_m + half_m) / 0.2)))
        assert len(cells) >= 20, (seed, len(cells))
