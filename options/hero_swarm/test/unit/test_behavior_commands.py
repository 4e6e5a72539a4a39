"""What behaviors command in places where that can be computed by hand: signs, gains, limits, and who counts."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hero_client.controllers import steer
from hero_client.values import BODY_RADIUS_M, NO_OBJECTS, Neighbors, PlacedObjects
from hero_swarm import metrics
from hero_swarm.behavior import PULSES, Random, derive_seed, sense
from hero_swarm.behaviors import find_behavior, list_names

SEPARATION_M = 0.063
STILL = (0.0, 0.0)


class Fixed:
    """Random numbers that are all the same."""

    def __init__(self, share=0.99, normal=0.0):
        self.share, self.offset = share, normal

    def random(self, columns=None):
        return np.full((ROBOTS[0],) if columns is None else (ROBOTS[0], columns), self.share)

    def normal(self, columns=None):
        return np.full((ROBOTS[0],) if columns is None else (ROBOTS[0], columns), self.offset)


ROBOTS = [0]


def act(name, *robots, memory=None, things=NO_OBJECTS, time_s=0.0, chance=None, ranges_m=(), **parameters):
    """Return the commands of all robots [(m/s, rad/s), ...] and the memory; ranges_m: {beam: m} of each robot."""
    ROBOTS[0] = len(robots)
    behavior, random = find_behavior(name)(**parameters), chance or Fixed()
    infrared_m = np.full((len(robots), 8), math.inf)
    for row, seen in enumerate(ranges_m):
        for beam, range_m in seen.items():
            infrared_m[row, beam] = range_m
    readings = SimpleNamespace(proximity_m=infrared_m, counts=np.zeros_like(infrared_m))
    sensed = sense(behavior, time_s, np.array([robots], dtype=float), random, things, robots=readings)
    linear_m_s, angular_rad_s, memory = behavior.step(sensed, memory, random)
    return [
        tuple(map(float, command))
        for command in zip(linear_m_s + np.zeros(len(robots)), angular_rad_s + np.zeros(len(robots)))
    ], memory


def close_to(*commands):
    return [pytest.approx(command, abs=1e-9) for command in commands]


def test_wheels_of_one_bit_behaviors_turn_as_published():
    pair = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0))  # the first one sees the second one
    assert act("aggregation", *pair)[0] == close_to((0.0, -5.02), (-0.108, -0.75))
    milling = {"left0": 0.8, "right0": 1.0, "left1": 0.5, "right1": 0.6}
    for name, nothing, robot, numbers in (
        ("evolved_aggregation", (-0.7, -1.0), (1.0, -1.0), {}),
        ("dispersal", (0.2, 0.7), (-0.5, -0.1), {}),
        ("wheel_genome", (0.8, 1.0), (0.5, 0.6), milling),
    ):
        expected = [
            (0.12 * (left + right) / 2.0, 0.12 * (right - left) / SEPARATION_M) for left, right in (robot, nothing)
        ]
        assert act(name, *pair, **numbers)[0] == close_to(*expected), name


def test_behaviors_step_as_often_as_they_were_tuned_for():
    rates_hz = {name: find_behavior(name)().rate_hz for name in list_names()}
    evolved = dict.fromkeys(("evolved_aggregation", "dispersal", "wheel_genome"), 1e3 / 60.0)
    slow = {
        "coverage": 5.0,
        "voter": 2.0,
        "majority": 2.0,
        "wall_following": 10.0,
        "random_fields": 10.0,
        "molecules": 10.0,
    }
    assert rates_hz == {**dict.fromkeys(list_names(), 20.0), **evolved, **slow}
    pulses = {name for name in list_names() if find_behavior(name)().drive == PULSES}
    assert pulses == {"aggregation", *evolved}


def test_a_point_before_the_axle_is_slowed_down_in_its_direction():
    for forward, left, expected in (
        (0.05, 0.03, (0.05, 0.5)),
        (0.2, 0.06, (0.1, 0.5)),
        (-0.2, 0.0, (-0.1, 0.0)),
        (0.05, -0.3, (0.025, -2.5)),
    ):
        assert steer(np.array([forward]), np.array([left]), 0.1) == pytest.approx(np.array(expected)[:, None])


def test_robots_meet_at_the_mean_place_of_their_neighbors():
    assert act("rendezvous", (0, 0, 0), (0.1, 0, 0))[0] == close_to((0.05, 0.0), (-0.05, 0.0))
    assert act("rendezvous", (0, 0, 0), (1.9, 0, 0))[0][0] == pytest.approx((0.1, 0.0))
    assert act("rendezvous", (0, 0, 0), (2.1, 0, 0))[0] == close_to(STILL, STILL)
    assert act("rendezvous", (0, 0, 0), (0.1, 0.02, 0), (-0.02, 0.1, 0))[0][0] == pytest.approx((0.02, 0.03 / 0.06))


def test_a_follower_keeps_its_gap_and_never_backs_off():
    for gap_m, speed_m_s in ((0.25, 0.1), (0.15, 0.0), (0.1, 0.0), (0.9, 0.12)):
        commands, _ = act("leader_followers", (gap_m, 0, 0), (0, 0, 0), (-0.2, 0, 0))
        assert commands == close_to((0.05, 0.08), (speed_m_s, 0.0), (0.05, 0.0))
    commands, _ = act("leader_followers", (0, 0, 0), (0, -0.16, 0))
    assert commands[1] == pytest.approx((0.0, 0.01 / 0.06), abs=1e-9), "turned towards the one before it"
    unknown, _ = act("leader_followers", (math.nan,) * 3, (0, 0, 0))
    assert unknown[1] == pytest.approx(STILL)


def test_a_formation_rests_as_a_polygon_and_pulls_towards_it():
    for count in (2, 3, 5, 6):
        radius_m = 0.25 / (2.0 * math.sin(math.pi / count))
        angles = [2.0 * math.pi * index / count for index in range(count)]
        polygon = [(radius_m * math.cos(angle), radius_m * math.sin(angle), angle) for angle in angles]
        assert act("formation", *polygon)[0] == close_to(*[STILL] * count)
    apart_m = 0.35
    speed_m_s = 0.6 * (apart_m**2 - 0.25**2) * apart_m
    assert act("formation", (0, 0, 0), (apart_m, 0, 0))[0] == close_to((speed_m_s, 0.0), (-speed_m_s, 0.0))


def test_corners_of_a_formation_are_taken_in_the_order_around_its_center():
    angles = [2.0 * math.pi * index / 5 for index in (0, 3, 1, 4, 2)]
    radius_m = 0.25 / (2.0 * math.sin(math.pi / 5))
    assert act("formation", *[(radius_m * math.cos(a), radius_m * math.sin(a), 1.0) for a in angles])[0] == close_to(
        *[STILL] * 5
    )


def ring(*angles_rad, radius_m=0.45):
    """Return robots on a circle, each headed along it, counter-clockwise."""
    return [(radius_m * math.cos(a), radius_m * math.sin(a), a + math.pi / 2.0) for a in angles_rad]


def test_robots_mill_around_their_center_and_turn_in_from_outside():
    quarters = [0.5 * math.pi * index for index in range(4)]
    assert act("milling", *ring(*quarters))[0] == close_to(*[(0.08, 0.0)] * 4)
    for radius_m, inward in ((0.54, 0.2), (0.36, -0.2), (0.95, 1.0)):
        commands, _ = act("milling", *ring(*quarters, radius_m=radius_m))
        turn_rad_s = 0.08 * inward / 0.06
        assert commands == close_to(*[(0.08, turn_rad_s)] * 4), radius_m
    seen = [{2: 0.1}, {0: 0.1}, {6: 0.05}, {0: math.nan}]
    (beside, before, away, blind), _ = act("milling", *ring(*quarters), ranges_m=seen)
    assert beside == pytest.approx((0.08, -0.08 / 0.06)), "away from what infrared sensors see"
    assert before == pytest.approx((0.0, 0.0), abs=1e-9) and away[1] > 0.0 and blind == pytest.approx((0.08, 0.0))
    assert act("milling", (0, 0, 0), (math.nan,) * 3)[0][1] == pytest.approx(STILL)


def test_a_robot_with_more_room_ahead_pursues_faster():
    commands, _ = act("cyclic_pursuit", *ring(0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi))
    assert commands == close_to(*[(0.08, 0.0)] * 4)
    places = ring(0.0, 0.45 * math.pi, math.pi, 1.45 * math.pi)  # the center stays
    speeds_m_s = [linear for linear, _ in act("cyclic_pursuit", *places)[0]]
    assert speeds_m_s == pytest.approx([0.072, 0.08, 0.072, 0.08], abs=1e-3), "as fast as wheels may"


def test_a_wall_is_followed_at_its_distance_and_corners_are_turned_in():
    on_wall = {6: 0.08, 7: math.sqrt(2.0) * 0.08}
    for seen, expected in (
        (on_wall, (0.07, 0.0)),
        ({6: 0.07, 7: math.sqrt(2.0) * 0.07}, (0.07, 10.0 * 0.01 * (1.0 + math.sqrt(2.0)))),
        ({6: 0.1, 7: math.sqrt(2.0) * 0.1}, (0.07, -10.0 * 0.02 * (1.0 + math.sqrt(2.0)))),
        ({}, (0.07, 0.0)),
        ({6: 0.1}, (0.07, 0.0)),
        ({**on_wall, 0: 0.1}, (0.0, 1.2)),
        ({**on_wall, 1: 0.07}, (0.0, 1.2)),
        (dict.fromkeys(range(8), math.nan), (0.07, 0.0)),
    ):
        commands, _ = act("wall_following", (0, 0, 0), ranges_m=[seen])
        assert commands == close_to(expected), seen


def test_a_flock_keeps_its_spacing_and_its_heading():
    for range_m, speed_m_s in ((0.25, 0.05), (0.35, 0.05 + 0.15 * 0.1 * 0.25 / 0.35), (0.05, 0.02), (0.81, 0.05)):
        assert act("flocking", (0, 0, 0), (range_m, 0, 0))[0][0] == pytest.approx((speed_m_s, 0.0))
    turned, _ = act("flocking", (0, 0, 0), (0.25, 0, math.pi / 2.0))
    assert turned[0] == pytest.approx((0.025, 0.1 / 0.06))
    half, _ = act("flocking", (0, 0, 0), (0.25, 0, math.pi / 2.0), (0.25, 0.0, 0.0))
    assert half[0] == pytest.approx((0.0375, 0.05 / 0.06)), "the mean of all neighbors"


def test_robots_repel_each_other_up_to_their_spacing():
    for range_m, speed_m_s in ((0.3, 0.08), (0.1, 0.1), (0.5, 0.0), (0.6, 0.0)):
        assert act("dispersion", (0, 0, 0), (range_m, 0, 0))[0] == close_to((-speed_m_s, 0.0), (speed_m_s, 0.0))
    both, _ = act("dispersion", (0, 0, 0), (0.45, 0, 0), (-0.45, 0, 0))
    assert both[0] == pytest.approx(STILL)


def test_groups_gather_and_keep_away_from_others():
    def drive(second, range_m, chance=None):
        places = [(50.0 + 9.0 * index, 0.0, 0.0) for index in range(4)]
        places[0], places[second] = (0, 0, 0), (range_m, 0, 0)
        (first, *_), groups = act("segregation", *places, chance=chance, near=Neighbors(range_m=2.0))
        assert groups.tolist() == [0, 1, 0, 1]
        return first

    for second, range_m, speed_m_s in (
        (2, 0.25, 0.04),
        (2, 0.1, -0.02),
        (2, 0.15, 0.0),
        (1, 0.9, -0.04),
        (1, 1.1, 0.0),
    ):
        assert drive(second, range_m) == pytest.approx((speed_m_s, 0.0), abs=1e-9)
    assert drive(1, 1.1, Fixed(normal=1.0)) == pytest.approx((0.03, 0.03 / 0.06))
    crowd, _ = act(
        "segregation", (0, 0, 0), (9, 0, 0), (0.25, 0, 0), (9, 9, 0), (0.25, 0, 0), near=Neighbors(range_m=2.0)
    )
    assert crowd[0][0] == pytest.approx(4.0 / math.sqrt(2.0) * 0.02), "less from each of many"
    colors = find_behavior("segregation")().colors(np.arange(7))
    palette = [[1, 0, 0], [0, 0, 1], [0, 1, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1]]
    assert colors.tolist() == [*palette, palette[0]]


def test_robots_drive_to_the_middles_of_their_cells():
    assert act("coverage", (0.1, 0.0, math.pi))[0] == close_to((0.05, 0.0))
    assert act("coverage", (0.4, 0.0, 0.0), (-0.4, 0.0, 0.0))[0] == close_to((0.05, 0.0), (-0.05, 0.0))
    assert act("coverage", (0.1, 0.05, 0.0), height_m=1.0, width_m=1.0)[0] == close_to((-0.05, -0.025 / 0.06))
    known, _ = act("coverage", (0.1, 0.0, 0.0), (math.nan,) * 3)
    assert known == close_to((-0.05, 0.0), STILL)


def test_opinions_are_taken_over_now_and_then_from_those_in_sight():
    places = [(0, 0, 0), (0.3, 0, 0), (0.3, 0.2, 0), (5.0, 0, 0)]
    _, first = act("voter", *places)
    assert first.tolist() == [0, 0, 1, 1]
    for share, opinions in ((0.249, [0, 0, 0, 1]), (0.251, [0, 0, 1, 1])):
        _, after = act("voter", *places, memory=first, chance=Fixed(share))
        assert after.tolist() == opinions, "half a time a second, the first neighbor's"
    for opinions, decided in (([0, 1, 1, 0], [1, 1, 1, 0]), ([0, 1, 0, 1], [0, 0, 0, 1]), ([1, 0, 0, 0], [0, 0, 0, 0])):
        _, after = act("majority", *places, memory=np.array(opinions), chance=Fixed(0.0))
        assert after.tolist() == decided
    tie, _ = act("majority", (0, 0, 0), (0.3, 0, 0), memory=np.array([0, 1]), chance=Fixed(0.0))[::-1]
    assert tie.tolist() == [0, 1]
    turns, drives_on = (0.0, 1.5), (0.1, 0.75)
    for seen, expected in (
        *(({beam: 0.15}, turns) for beam in (0, 1, 7)),
        *((seen, drives_on) for seen in ({2: 0.1}, {0: 0.17}, {0: math.nan})),
    ):
        commands, _ = act("voter", (0, 0, 0), chance=Fixed(normal=0.5), ranges_m=[seen])
        assert commands[0] == pytest.approx(expected)
    assert find_behavior("voter")().colors(np.array([0, 1])).tolist() == [[1, 0, 0], [0, 0, 1]]


def make_things(x_m, y_m, radius_m=0.1):
    return PlacedObjects(np.array([[(x_m, y_m, 0.0)]]), np.array([radius_m]))


def test_wheels_of_object_clustering_turn_by_what_is_touched():
    for things, robots, (left, right) in (
        (make_things(9.0, 9.0), [(0, 0, 0)], (0.5, 1.0)),
        (make_things(0.5, 0.0), [(0, 0, 0)], (1.0, 0.5)),
        (make_things(9.0, 9.0), [(0, 0, 0), (0.5, 0, 0)], (0.1, 0.5)),
    ):
        commands, _ = act("object_clustering", *robots, things=things)
        assert commands[0] == pytest.approx((0.12 * (left + right) / 2.0, 0.12 * (right - left) / SEPARATION_M))


def test_an_object_is_pushed_where_it_hides_the_goal_and_left_at_the_goal():
    behind = (-0.5, 0.0, 0.0)
    for things, robot, expected in (
        (make_things(-0.3, 0.0), behind, (0.08, 0.0)),  # the goal is the origin
        (make_things(-0.04, 0.0), behind, STILL),  # it has arrived
        (make_things(-0.06, 0.0), behind, (0.08, 0.0)),
        (make_things(-0.3, 0.0), (-0.5, 0.059, 0.0), (0.08 * 0.2 / math.hypot(0.2, 0.059), None)),
    ):
        (command,), _ = act("cooperative_transport", robot, things=things)
        assert command[0] == pytest.approx(expected[0])
        assert expected[1] is None or command[1] == pytest.approx(expected[1])
    # Beside the object it goes around on the shorter side, at gap_m: straight back along the object.
    around_m = 0.1 + BODY_RADIUS_M + 0.05
    for side in (1.0, -1.0):
        (command,), _ = act("cooperative_transport", (-0.3, side * around_m, math.pi), things=make_things(-0.3, 0.0))
        assert command == pytest.approx((0.08, 0.0), abs=1e-9)
    (away, _), _ = act("cooperative_transport", behind, (-0.5, 0.1, 0.0), things=make_things(-0.3, 0.0))
    assert away == pytest.approx((0.08, -2.0 * (2.0 * BODY_RADIUS_M + 0.05 - 0.1) / 0.06))
    (lost,), _ = act("cooperative_transport", (math.nan,) * 3, things=make_things(-0.3, 0.0))
    assert lost == STILL


def test_the_way_around_an_object_keeps_its_gap():
    around_m, things = 0.1 + BODY_RADIUS_M + 0.05, make_things(-0.3, 0.0)
    for off_m, inward in ((0.1, 0.4), (0.3, 1.0), (-0.02, -0.08)):
        # Beside the object, headed to the goal: backwards, and to the side by what the gap is off.
        (command,), _ = act("cooperative_transport", (-0.3, -around_m - off_m, 0.0), things=things)
        excess = max(1.0, 0.08 * inward / 0.06 / 2.5)
        assert command == pytest.approx((-0.08 / excess, 0.08 * inward / 0.06 / excess)), off_m
    shade_m = 0.6 * 0.1
    for aside_m, hides in ((0.99 * shade_m, True), (1.01 * shade_m, False), (-0.99 * shade_m, True)):
        (command,), _ = act("cooperative_transport", (-0.6, aside_m, 0.0), things=things)
        assert (command[0] == pytest.approx(0.08 * 0.3 / math.hypot(0.3, aside_m))) == hides
    before, _ = act("cooperative_transport", (-0.1, 0.0, math.pi), things=things)
    assert before[0][0] != pytest.approx(0.08), "not from the goal's side"


def test_robots_behind_a_box_line_up_from_right_to_left():
    row_m, things = 0.1 + BODY_RADIUS_M + 0.05, make_things(-1.0, 0.0)
    places = [(-1.0 - row_m - 0.05, y_m, 0.0) for y_m in (0.1, -0.085, 0.0)]
    commands, pushes = act("box_pushing", *places, things=things)
    assert not pushes.any()
    ahead_m_s, aside_m_s = 1.5 * 0.05, -1.5 * 0.015
    assert commands == close_to((ahead_m_s, aside_m_s / 0.06), (ahead_m_s, 0.0), (ahead_m_s, 0.0))
    worlds = np.array([[(-1.0 - row_m, y_m, 0.0) for y_m in (-0.0425, 0.0425 + off_m)] for off_m in (0.0, 0.05)])
    both = PlacedObjects(np.repeat(things.poses, 2, axis=0), things.radii_m)
    behavior = find_behavior("box_pushing")()
    sensed = sense(behavior, 0.0, worlds, Fixed(), both)
    assert behavior.step(sensed, None, Fixed())[2].tolist() == [True, True, False, False], "each world by itself"


def move_all(poses, turn_rad, shift_m, mirror):
    x_m, y_m, yaw_rad = np.moveaxis(poses * (1.0, mirror, mirror), -1, 0)
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    x_m, y_m = cosine * x_m - sine * y_m + shift_m, sine * x_m + cosine * y_m - shift_m
    return np.stack((x_m, y_m, yaw_rad + turn_rad), axis=-1)


@pytest.mark.parametrize(
    "name",
    ["rendezvous", "formation", "flocking", "dispersion", "segregation", "cooperative_transport", "box_pushing"],
)
@pytest.mark.parametrize(("turn_rad", "shift_m", "mirror"), [(2.0, 0.5, 1.0), (0.0, 0.0, -1.0), (-1.0, -3.0, -1.0)])
def test_a_behavior_is_the_same_wherever_and_however_its_world_lies(name, turn_rad, shift_m, mirror):
    random = np.random.RandomState(5)
    for _ in range(5):
        poses = random.uniform((-0.4, -0.4, -3.0), (0.4, 0.4, 3.0), (5, 3))
        things = make_things(*random.uniform(-0.3, 0.3, 2))
        goal = {"goal_x_m": 0.2, "goal_y_m": -0.3} if "object" in "".join(find_behavior(name)().sensors()) else {}
        commands, _ = act(name, *poses, things=things, **goal)
        if goal:
            goal_x_m, goal_y_m, _ = move_all(np.array((0.2, -0.3, 0.0)), turn_rad, shift_m, mirror)
            goal = {"goal_x_m": goal_x_m, "goal_y_m": goal_y_m}
        moved = PlacedObjects(move_all(things.poses, turn_rad, shift_m, mirror), things.radii_m)
        found, _ = act(name, *move_all(poses, turn_rad, shift_m, mirror), things=moved, **goal)
        assert np.allclose(found, np.array(commands) * (1.0, mirror), atol=1e-9)


def test_a_box_is_pushed_when_all_are_in_place_and_until_one_is_far_off():
    row_m, things = 0.1 + BODY_RADIUS_M + 0.05, make_things(-1.0, 0.0)
    right, left = (-1.0 - row_m, -0.0425, 0.0), (-1.0 - row_m, 0.0425, 0.0)
    for robots in ((right, left), (left, right)):
        commands, pushes = act("box_pushing", *robots, things=things)
        assert commands == close_to((0.08, 0.0), (0.08, 0.0)) and pushes.tolist() == [True, True]

    def move(pose, back_m, aside_m):
        return pose[0] - back_m, pose[1] + aside_m, 0.0

    for back_m, aside_m, was_pushing, pushes_on in (
        (0.029, 0.0, False, True),
        (0.031, 0.0, False, False),
        (0.0, 0.029, False, True),
        (0.0, 0.031, False, False),
        (0.0, 0.089, True, True),
        (0.0, 0.091, True, False),
        (0.2, 0.0, True, True),
        (0.2, 0.0, False, False),
    ):
        memory = np.array([was_pushing] * 2)
        _, pushes = act("box_pushing", right, move(left, back_m, aside_m), things=things, memory=memory)
        assert pushes.tolist() == [pushes_on] * 2, (back_m, aside_m, was_pushing)
    commands, _ = act("box_pushing", right, move(left, 0.04, 0.0), things=things)
    assert commands == close_to(STILL, (1.5 * 0.04, 0.0)), "the others wait"
    near, _ = act("box_pushing", (-1.0 - 0.3 * row_m, 0.0, 0.0), things=things, memory=np.array([True]))
    assert near == close_to((0.08, 0.0)), "whoever pushes does not go around"
    for name in ("box_pushing", "cooperative_transport"):
        assert act(name, right, things=make_things(0.0, 0.0))[0] == close_to(STILL), "it is where it shall be"
    around, _ = act("box_pushing", (-1.0 + row_m, 0.0, math.pi / 2.0), things=things)
    assert around == close_to((0.08, 0.0))


def test_streams_of_random_numbers_depend_on_the_seed_of_their_world_alone():
    both, alone = Random([3, 4], 5), Random([4], 5)
    assert both.normal(2)[5:].tolist() == alone.normal(2).tolist()
    first = both.random()
    assert first[5:].tolist() == alone.random().tolist() and first.shape == (10,)
    drawn = []
    for columns in (1, 7, None, 2) * 10:  # beyond what is drawn at once
        values = [stream.random(columns) for stream in (both, alone)]
        assert values[0][5:].tolist() == values[1].tolist()
        drawn += both.normal(columns).ravel().tolist() + values[0].ravel().tolist()
        assert alone.normal(columns).size == 5 * (columns or 1)
    assert len(set(drawn)) == len(drawn)
    assert derive_seed(3, "places") != derive_seed(3, "objects") != derive_seed(4, "objects")


def test_metrics_by_name_are_those_of_places_with_their_units():
    poses = np.array([[(0.0, 0.0, 0.0), (0.49, 0.0, math.pi), (0.98, 0.0, 0.0)]])
    velocities = np.array([[(0.0, 0.1, 0.0), (0.0, 0.009, 0.0), (0.0, -0.1, 0.0)]])
    values = {name: float(metric(poses, velocities, poses)[0]) for name, metric in metrics.METRICS.items()}
    assert math.isnan(values.pop("wall_following")), "no arena is known"
    assert values["algebraic_connectivity"] == pytest.approx(1.0), "0.5 m connect"
    assert values["rotation"] == pytest.approx(2.0 / 3.0) and values["order"] == pytest.approx(2.0 / 3.0)
    assert values["object_distance"] == pytest.approx(0.49) and values["dispersion"] == pytest.approx(0.98)
    assert values["nearest_neighbor"] == pytest.approx(0.49) and values["collisions"] == 0.0
    assert set(metrics.UNITS) < set(values)
    touching = np.array(
        [[(0.0, 0.0), (2.0 * BODY_RADIUS_M - 1e-6, 0.0), (0.5, 0.0), (0.5 + 2.0 * BODY_RADIUS_M + 1e-6, 0.0)]]
    )
    assert metrics.collisions(touching).tolist() == [1]
    assert metrics.collisions(touching, tolerance_m=0.001).tolist() == [2]
