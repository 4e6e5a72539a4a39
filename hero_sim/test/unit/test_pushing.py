"""Robots push discs and polygons: directions, twists, traction, walls and piles, against what theory gives."""

import math
import random

import pytest

from hero_node import Pose
from hero_sim.errors import OptionError
from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.world.arena_file import load_arena
from hero_sim.world.pushing import pushing as pushing_module
from hero_sim.world.pushing.pushing import MAX_PUSH_N, Pushing
from hero_sim.world.pushing.shapes import (
    Disc,
    Polygon,
    PushedBody,
    find_contacts,
    list_outlines,
    touch_circle,
    touch_walls,
)

STEP_M = 0.001
"""A robot at 0.1 m/s in 10 ms."""

BOX = Polygon([(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)])
BELOW_M = -0.1 - BODY_RADIUS_M
"""y of a robot that touches the box from below."""

GRAVITY_M_S2 = 9.81
FRICTION = 0.3


def place(shape, x_m=0.0, y_m=0.0, yaw_rad=0.0, push_n=0.5):
    """A body on which push_n through its center is just enough."""
    return PushedBody(shape, Pose(x_m, y_m, yaw_rad), push_n / (FRICTION * GRAVITY_M_S2), FRICTION)


def drive_north(pushing, places_m, steps):
    for _ in range(steps):
        places_m = pushing.step(places_m, [(x_m, y_m + STEP_M) for x_m, y_m in places_m])
    return places_m


def test_the_friction_radius_of_a_box_is_that_of_uniform_pressure():
    assert BOX.friction_radius_m == pytest.approx(0.0968, abs=5e-5)
    assert Disc(0.3).friction_radius_m == pytest.approx(0.2)
    # A polygon with many corners is nearly a disc.
    corners = [(math.cos(k * math.pi / 50.0), math.sin(k * math.pi / 50.0)) for k in range(100)]
    assert Polygon(corners).friction_radius_m == pytest.approx(2.0 / 3.0, rel=2e-3)


def test_the_origin_of_a_polygon_is_its_center_of_area():
    assert Polygon([(5.0, 5.0), (5.3, 5.0), (5.0, 5.6)]).corners_m[0] == pytest.approx((-0.1, -0.2))


@pytest.mark.parametrize("corners", [[(0, 0), (1, 0)], [(0, 0), (0, 1), (1, 0)], [(0, 0), (2, 0), (1, 0.1), (1, 2)]])
def test_what_is_no_convex_polygon_is_refused(corners):
    with pytest.raises(ValueError, match="convex"):
        Polygon(corners)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, -2.0])
def test_a_push_through_the_center_turns_nothing(yaw_rad):
    # Two robots beside the center line hold the direction; the box is turned, and so are they.
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    box = place(BOX, 0.0, 0.0, yaw_rad)
    pushing = Pushing([box], [])
    place_m = (-sine * BELOW_M, cosine * BELOW_M)
    for _ in range(200):
        after_m = (place_m[0] - sine * STEP_M, place_m[1] + cosine * STEP_M)
        (place_m,) = pushing.step([place_m], [after_m])
    assert abs(math.degrees(box.pose.yaw_rad - yaw_rad)) < 1.0
    assert box.pose.x_m == pytest.approx(-sine * 0.2, abs=2e-3)
    assert box.pose.y_m == pytest.approx(cosine * 0.2, abs=2e-3)


@pytest.mark.parametrize("offset_m", [0.0, 0.02, 0.05, 0.1])
def test_without_contact_friction_the_twist_is_that_of_the_limit_surface(offset_m, monkeypatch):
    monkeypatch.setattr(pushing_module, "CONTACT_FRICTION", 0.0)
    box = place(BOX)
    Pushing([box], []).step([(offset_m, BELOW_M)], [(offset_m, BELOW_M + STEP_M)])
    # The force f along y turns into (0, f, h f / c^2); its point moves as far as the robot.
    rotation_by_m = offset_m / BOX.friction_radius_m**2
    y_m = STEP_M / (1.0 + offset_m * rotation_by_m)
    assert box.pose.x_m == pytest.approx(0.0, abs=1e-9)
    assert box.pose.y_m == pytest.approx(y_m, rel=0.01)
    assert box.pose.yaw_rad == pytest.approx(y_m * rotation_by_m, rel=0.01)


@pytest.mark.parametrize("offset_m", [0.02, 0.05, 0.1])
def test_with_friction_the_point_sticks_or_the_force_is_on_its_cone(offset_m):
    box = place(BOX)
    Pushing([box], []).step([(offset_m, BELOW_M)], [(offset_m, BELOW_M + STEP_M)])
    x_m, y_m, rotation_rad = box.pose
    slide_m = x_m + 0.1 * rotation_rad
    # By the limit surface the force is along (x, y, c^2 w).
    cone = abs(x_m) / y_m
    assert abs(slide_m) < 0.01 * STEP_M or cone == pytest.approx(pushing_module.CONTACT_FRICTION, rel=0.01)
    assert cone <= pushing_module.CONTACT_FRICTION * 1.01
    assert rotation_rad * BOX.friction_radius_m**2 == pytest.approx(offset_m * y_m + 0.1 * x_m, rel=0.01)


@pytest.mark.parametrize("needed", [1, 2, 3, 4])
def test_a_body_that_needs_n_robots_moves_for_n_and_not_for_one_less(needed):
    for robots in (needed - 1, needed):
        long = Polygon([(0.0, 0.0), (0.5, 0.0), (0.5, 0.2), (0.0, 0.2)])
        body = place(long, push_n=(needed - 0.5) * MAX_PUSH_N)
        # They arrive one after the other.
        places_m = [((k - (robots - 1) / 2.0) * 0.09, BELOW_M - 0.0003 * k) for k in range(robots)]
        drive_north(Pushing([body], []), places_m, 200)
        if robots < needed:
            assert body.pose == (0.0, 0.0, 0.0)
        else:
            assert body.pose.y_m > 0.1 and abs(body.pose.yaw_rad) < math.radians(1.0)


def test_an_untouched_object_stays():
    bodies = [place(BOX), place(Disc(0.05), 0.0, 0.15)]
    drive_north(Pushing(bodies, []), [(0.5, -0.2)], 50)
    assert bodies[0].pose == (0.0, 0.0, 0.0) and bodies[1].pose == (0.0, 0.15, 0.0)


def test_a_robot_that_leaves_pulls_nothing():
    box = place(BOX)
    Pushing([box], []).step([(0.0, BELOW_M + 0.0001)], [(0.0, BELOW_M - STEP_M)])
    assert box.pose == (0.0, 0.0, 0.0)


def test_walls_stop_what_is_pushed_and_the_robot_behind_it():
    wall = [(-1.0, 0.3, 1.0, 0.3)]
    for shape, half_m in ((BOX, 0.1), (Disc(0.08), 0.08)):
        body = place(shape)
        pushing = Pushing([body], wall)
        ((_, y_m),) = drive_north(pushing, [(0.0, -half_m - BODY_RADIUS_M)], 250)
        assert body.pose.y_m == pytest.approx(0.3 - half_m, abs=5e-4)
        assert y_m <= body.pose.y_m - half_m - BODY_RADIUS_M + 5e-4


def test_a_pushed_body_pushes_others_and_their_friction_adds_up():
    def push_row(count):
        row = [place(Disc(0.05), 0.0, 0.1 * k, push_n=0.35 * MAX_PUSH_N) for k in range(count)]
        drive_north(Pushing(row, []), [(0.0, -0.05 - BODY_RADIUS_M)], 100)
        return [body.pose.y_m for body in row]

    assert push_row(2) == pytest.approx([0.1, 0.2], abs=2e-3)
    assert push_row(3) == [0.0, 0.1, 0.2]  # 1.05 times its traction


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_in_a_pile_nothing_overlaps_or_outruns_its_pushers(seed):
    rng = random.Random(seed)
    walls = [(-0.5, -0.5, 0.5, -0.5), (0.5, -0.5, 0.5, 0.5), (0.5, 0.5, -0.5, 0.5), (-0.5, 0.5, -0.5, -0.5)]
    shapes = [
        Disc(0.04),
        Polygon([(0, 0), (0.1, 0), (0.1, 0.06), (0, 0.06)]),
        Polygon([(0, 0), (0.1, 0), (0, 0.1)]),
    ]
    bodies = [
        place(shapes[k % 3], -0.3 + 0.2 * (k % 4), -0.2 + 0.2 * (k // 4), rng.uniform(-3.0, 3.0), push_n=0.1)
        for k in range(12)
    ]
    pushing = Pushing(bodies, walls)
    places_m = [(-0.42, -0.4 + 0.2 * k) for k in range(4)]
    headings_rad = [rng.uniform(-0.3, 0.3) for _ in places_m]
    worst_m = 0.0
    for _ in range(300):
        after_m = []
        for (x_m, y_m), heading_rad in zip(places_m, headings_rad):
            x_m, y_m = x_m + STEP_M * math.cos(heading_rad), y_m + STEP_M * math.sin(heading_rad)
            limit_m = 0.5 - BODY_RADIUS_M
            after_m.append((min(max(x_m, -limit_m), limit_m), min(max(y_m, -limit_m), limit_m)))
        before = [body.pose for body in bodies]
        places_m = pushing.step(places_m, after_m)
        moved_m = [math.hypot(b.pose.x_m - a.x_m, b.pose.y_m - a.y_m) for a, b in zip(before, bodies)]
        assert max(moved_m) <= 2.0 * STEP_M, seed
        for k, body in enumerate(bodies):
            touching = touch_walls(body, walls, 0.0)
            touching += [contact for other in bodies[:k] for contact in find_contacts(other, body, 0.0)]
            touching += [
                contact for p in places_m for contact in [touch_circle(*p, BODY_RADIUS_M, body)] if contact.depth_m > 0
            ]
            worst_m = max([worst_m, *(contact.depth_m for contact in touching)])
    assert worst_m < 5e-4, seed


def test_the_same_pushes_give_the_same_bytes():
    def run():
        bodies = [place(BOX), place(Disc(0.05), 0.1, 0.16)]
        drive_north(Pushing(bodies, []), [(0.05, BELOW_M), (-0.05, BELOW_M)], 100)
        return [body.pose for body in bodies]

    assert run() == run()


ARENA = """
walls_m: [[[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]]
objects:
  - {circle_m: [0.3, 0.0, 0.05], mass_kg: 0.03, friction: 0.3}
  - {polygon_m: [[-0.3, 0.2], [-0.1, 0.2], [-0.1, 0.3], [-0.3, 0.3]], mass_kg: 0.05, friction: 0.3}
starts_m_deg: [[0.14, 0, 0], [-0.2, 0, 90], [0.5, -0.7, 0]]
"""


@pytest.fixture
def swarm(tmp_path):
    path = tmp_path / "arena.yaml"
    path.write_text(ARENA)
    return StepSwarm(3, seed=2, arena=str(path), worlds=2)


def test_robots_see_objects_and_push_them_in_each_world_for_itself(swarm):
    disc, block = swarm.rows.world.list_objects()
    assert swarm[0].proximity[0] == pytest.approx(0.16 - 0.05, abs=0.02)
    assert swarm[2].nearest() is None
    for robot in swarm.worlds[0].robots[:2]:
        robot.drive(0.1, 0.0)
    swarm.sleep(2.0)
    poses = swarm.rows.world.object_poses
    pushed, lifted = swarm.rows.world.list_objects()
    assert poses[0, :, 0].tolist() == [pushed.x_m, lifted.x_m] and poses[1, 0, :2] == pytest.approx((0.3, 0.0))
    assert pushed.x_m > disc.x_m + 0.05 and abs(pushed.y_m) < 0.02
    assert swarm[0].fresh_proximity()[0] == pytest.approx(0.0368 + 0.01, abs=0.02)
    other = swarm.rows.world.observe().obstacles[1][1]
    assert other[0].tolist() == pytest.approx([0.3, 0.0, 0.05])
    in_robots_m, in_walls_m = swarm.rows.world.measure_overlaps()
    assert in_robots_m.max() < 5e-4 and in_walls_m.max() < 1e-6


@pytest.mark.parametrize(
    "wrong",
    [
        "{mass_kg: 0.1, friction: 0.3}",
        "{circle_m: [0, 0, 0.1], polygon_m: [], mass_kg: 0.1, friction: 0.3}",
        "{circle_m: [0, 0, -1], mass_kg: 0.1, friction: 0.3}",
        "{circle_m: [0, 0, 0.1], mass_kg: 0, friction: 0.3}",
        "{circle_m: [0, 0, 0.1], mass_kg: 0.1}",
        "{polygon_m: [[0, 0], [0, 1], [1, 0]], mass_kg: 0.1, friction: 0.3}",
        "[1, 2]",
    ],
)
def test_a_wrong_object_in_an_arena_is_refused_in_one_line(wrong, tmp_path):
    path = tmp_path / "arena.yaml"
    path.write_text("bounds_m: [-1, -1, 1, 1]\nobjects: [%s]\n" % wrong)
    with pytest.raises(OptionError) as caught:
        load_arena(str(path))
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("mass_kg", "friction"), [(0.0, 0.3), (0.1, -1.0), (math.nan, 0.3)])
def test_a_body_without_mass_or_friction_is_refused(mass_kg, friction):
    with pytest.raises(ValueError, match="must be more than 0"):
        PushedBody(Disc(0.1), Pose(0.0, 0.0, 0.0), mass_kg, friction)


TRIANGLE = Polygon([(0.0, 0.0), (0.2, 0.02), (0.05, 0.15)])
HEXAGON = Polygon([(0.1 * math.cos(turn + 0.2), 0.06 * math.sin(turn + 0.2)) for turn in (0, 1, 2, 3, 4, 5)])
SHAPES = [Disc(0.07), BOX, TRIANGLE, HEXAGON]


def put(shape, x_m=0.0, y_m=0.0, yaw_rad=0.0):
    return place(shape, x_m, y_m, yaw_rad)


def draw_places(count, seed=5):
    """Return random x, y (m) and headings."""
    rng = random.Random(seed)
    return [(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-3.0, 3.0)) for _ in range(count)]


def list_outline(body, per_edge=200):
    """Return points of a body's outline, near enough to each other to find the nearest one among them."""
    if isinstance(body.shape, Disc):
        radius_m, turns = body.shape.radius_m, [math.tau * k / 1000 for k in range(1000)]
        return [(body.x_m + radius_m * math.cos(turn), body.y_m + radius_m * math.sin(turn)) for turn in turns]
    corners_m = list(body.corners_m)
    edges = zip(corners_m, [*corners_m[1:], corners_m[0]])
    shares = [k / per_edge for k in range(per_edge)]
    return [(a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])) for a, b in edges for s in shares]


def holds(body, x_m, y_m):
    """Return whether a place lies in a body: to the left of all its edges."""
    if isinstance(body.shape, Disc):
        return math.hypot(x_m - body.x_m, y_m - body.y_m) < body.shape.radius_m
    corners_m = list(body.corners_m)
    edges = zip(corners_m, [*corners_m[1:], corners_m[0]])
    return all((b[0] - a[0]) * (y_m - a[1]) - (b[1] - a[1]) * (x_m - a[0]) > 0.0 for a, b in edges)


@pytest.mark.parametrize("shape", SHAPES[1:])
def test_a_polygon_turns_about_its_center_and_knows_its_reach_and_friction(shape):
    body, (low, high) = put(shape), (-0.2, 0.2)
    step_m = (high - low) / 300
    axis = [low + (k + 0.5) * step_m for k in range(300)]
    inside = [(x_m, y_m) for x_m in axis for y_m in axis if holds(body, x_m, y_m)]
    center_m = [sum(values) / len(inside) for values in zip(*inside)]
    assert center_m == pytest.approx([0.0, 0.0], abs=3e-4)
    assert shape.friction_radius_m == pytest.approx(sum(math.hypot(*point) for point in inside) / len(inside), rel=3e-3)
    assert shape.reach_m == pytest.approx(max(math.hypot(*point) for point in list_outline(body)))
    turned = put(shape, 0.5, -0.2, 0.8)
    for (x_m, y_m), (turned_x_m, turned_y_m) in zip(body.corners_m, turned.corners_m):
        distance_m, angle_rad = math.hypot(x_m, y_m), math.atan2(y_m, x_m) + 0.8
        expected_m = (0.5 + distance_m * math.cos(angle_rad), -0.2 + distance_m * math.sin(angle_rad))
        assert (turned_x_m, turned_y_m) == pytest.approx(expected_m)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_circle_is_as_deep_in_a_body_as_it_is_from_the_nearest_way_out(shape):
    body = put(shape, 0.02, -0.03, 0.7)
    outline_m = list_outline(body, 500)
    for x_m, y_m, _ in draw_places(60):
        contact = touch_circle(x_m, y_m, 0.04, body)
        away_m = min(math.hypot(x - x_m, y - y_m) for x, y in outline_m)
        is_inside = holds(body, x_m, y_m)
        assert contact.depth_m == pytest.approx(0.04 + away_m if is_inside else 0.04 - away_m, abs=1e-4)
        # The normal leads from the circle into the body, along the shortest way.
        assert math.hypot(contact.normal_x, contact.normal_y) == pytest.approx(1.0)
        sign = -1.0 if is_inside else 1.0
        reached_m = (x_m + sign * away_m * contact.normal_x, y_m + sign * away_m * contact.normal_y)
        assert min(math.hypot(x - reached_m[0], y - reached_m[1]) for x, y in outline_m) < 2e-3
        if isinstance(shape, Disc):
            expected_m = (x_m + 0.04 * contact.normal_x, y_m + 0.04 * contact.normal_y)
        else:
            expected_m = (x_m, y_m) if is_inside else reached_m
        assert (contact.x_m, contact.y_m) == pytest.approx(expected_m, abs=2e-3)


def measure_gap(first, second):
    """Return how far two bodies are apart; below 0 if one holds a place of the other's outline."""
    outlines = list_outline(first, 60)[::5], list_outline(second, 60)[::5]
    gap_m = min(math.hypot(a[0] - b[0], a[1] - b[1]) for a in outlines[0] for b in outlines[1])
    overlap = any(holds(second, *point) for point in outlines[0]) or any(holds(first, *point) for point in outlines[1])
    return -gap_m - 1e-3 if overlap else gap_m


@pytest.mark.parametrize(("one", "other"), [(a, b) for k, a in enumerate(SHAPES) for b in SHAPES[k:]])
def test_bodies_touch_where_they_overlap_and_come_apart_along_the_normal(one, other):
    first, near = put(one, 0.01, 0.02, 0.4), 0
    for x_m, y_m, yaw_rad in draw_places(12):
        second = put(other, x_m / 2.0, y_m / 2.0, yaw_rad)
        gap_m = measure_gap(first, second)
        contacts = find_contacts(first, second, 0.004)
        if abs(gap_m - 0.004) > 0.008:
            assert bool(contacts) == (gap_m < 0.004) or 0.0 < gap_m < 0.03, (x_m, y_m, yaw_rad)
        if gap_m < -1e-3 and isinstance(one, Disc) and contacts:
            near += 1
            contact = contacts[0]
            # Out by the depth, they only touch.
            shift_m = contact.depth_m + 2e-3
            apart_m = x_m / 2.0 + shift_m * contact.normal_x, y_m / 2.0 + shift_m * contact.normal_y
            assert measure_gap(first, put(other, *apart_m, yaw_rad)) == pytest.approx(2e-3, abs=4e-3)
        assert all(contact.depth_m > -0.004 for contact in contacts)
    assert near or not isinstance(one, Disc)


def test_two_boxes_touch_at_their_corners_with_normals_into_the_second():
    for yaw_rad in (0.0, 1.0):
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        for gap_m in (-0.001, 0.003):
            away_m = 0.3 + gap_m
            # The second one lies 0.05 aside: two corners of each are beside the other.
            second = put(BOX, cosine * away_m - sine * 0.05, sine * away_m + cosine * 0.05, yaw_rad)
            contacts = find_contacts(put(BOX, 0.0, 0.0, yaw_rad), second, 0.004)
            assert [contact.depth_m for contact in contacts if abs(contact.depth_m + gap_m) < 1e-9]
            for contact in contacts:
                assert (contact.normal_x, contact.normal_y) == pytest.approx((cosine, sine))
                assert contact.depth_m == pytest.approx(-gap_m)
        assert not find_contacts(put(BOX, 0.0, 0.0, yaw_rad), put(BOX, cosine * 0.305, sine * 0.305, yaw_rad), 0.004)


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("yaw_rad", [0.0, 2.2])
def test_a_wall_presses_bodies_to_the_side_on_which_they_are(side, yaw_rad):
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)

    def turn(x_m, y_m):
        return cosine * x_m - sine * y_m, sine * x_m + cosine * y_m

    wall = [(*turn(-0.5, 0.0), *turn(0.5, 0.0))]
    for shape, half_m in ((BOX, 0.1), (Disc(0.07), 0.07)):
        for depth_m in (0.003, -0.003):
            body = put(shape, *turn(0.1, side * (half_m - depth_m)), yaw_rad)
            contacts = touch_walls(body, wall, 0.004)
            assert len(contacts) == (1 if isinstance(shape, Disc) else 2)
            for contact in contacts:
                assert (contact.normal_x, contact.normal_y) == pytest.approx(turn(0.0, side))
                assert contact.depth_m == pytest.approx(depth_m)
            if isinstance(shape, Disc):
                assert (contacts[0].x_m, contacts[0].y_m) == pytest.approx(turn(0.1, 0.0))
            else:
                expected_m = sorted(turn(0.1 + end_m, -side * depth_m) for end_m in (-0.15, 0.15))
                assert sorted((contact.x_m, contact.y_m) for contact in contacts) == [
                    pytest.approx(point_m) for point_m in expected_m
                ]
        assert not touch_walls(put(shape, *turn(0.1, side * (half_m + 0.005)), yaw_rad), wall, 0.004)
        assert not touch_walls(put(shape, *turn(0.5 + 0.2, 0.0), yaw_rad), wall, 0.004), "beyond its end"


def test_the_end_of_a_wall_presses_the_edge_that_it_pokes():
    for ends in ((0.14, 0.0, 0.6, 0.0), (0.6, 0.0, 0.14, 0.0)):
        (contact,) = touch_walls(put(BOX), [ends], 0.004)
        assert (contact.x_m, contact.y_m) == pytest.approx((0.14, 0.0))
        assert (contact.normal_x, contact.normal_y) == pytest.approx((-1.0, 0.0))
        assert contact.depth_m == pytest.approx(0.01)
        (contact,) = touch_walls(put(Disc(0.15)), [ends], 0.004)
        assert contact.depth_m == pytest.approx(0.01) and contact.normal_x == pytest.approx(-1.0)


def test_a_box_pushed_at_the_end_of_a_wall_stops_there_and_comes_off_again():
    box = place(BOX)
    pushing = Pushing([box], [(0.05, 0.2, 0.05, 0.6)])
    drive_north(pushing, [(0.0, BELOW_M)], 150)
    assert box.pose.y_m == pytest.approx(0.1, abs=1e-3)
    place_m = (-0.15 - BODY_RADIUS_M, box.pose.y_m)
    for _ in range(60):
        before = box.pose
        (place_m,) = pushing.step([place_m], [(place_m[0] + STEP_M, place_m[1])])
        assert math.hypot(box.pose.x_m - before.x_m, box.pose.y_m - before.y_m) < 2.0 * STEP_M
    assert box.pose.x_m > 0.04


def test_a_round_obstacle_stops_what_is_pushed():
    for shape, half_m in ((BOX, 0.1), (Disc(0.08), 0.08)):
        body = place(shape)
        pushing = Pushing([body], [], [(0.0, 0.3, 0.05)])
        drive_north(pushing, [(0.0, -half_m - BODY_RADIUS_M)], 250)
        assert body.pose.y_m == pytest.approx(0.25 - half_m, abs=5e-4)


def test_a_wide_robot_pushes_with_its_own_radius():
    body = place(BOX)
    pushing = Pushing([body], [], radii_m=[0.06])
    ((_, y_m),) = drive_north(pushing, [(0.0, -0.1 - 0.06)], 50)
    assert body.pose.y_m == pytest.approx(0.05, abs=1e-3) and y_m == pytest.approx(body.pose.y_m - 0.16, abs=1e-3)


def test_outlines_are_the_edges_and_discs_where_they_are():
    disc, box = place(Disc(0.05), 0.4, 0.1), place(BOX, 0.0, 0.0, math.pi / 2.0)
    edges_m, discs_m = list_outlines([disc, box])
    assert discs_m == [(0.4, 0.1, 0.05)]
    corners_m = [(0.1, -0.15), (0.1, 0.15), (-0.1, 0.15), (-0.1, -0.15)]
    assert edges_m == [pytest.approx((*a, *b)) for a, b in zip(corners_m, [*corners_m[1:], corners_m[0]])]


def test_the_force_of_a_body_and_its_work_are_those_of_the_limit_surface():
    body = PushedBody(BOX, Pose(0.0, 0.0, 0.0), 0.5, 0.4)
    assert body.friction_n == pytest.approx(0.5 * 0.4 * 9.81)
    assert body.radius_m2 == pytest.approx(BOX.friction_radius_m**2)
    work_j = body.friction_n * math.sqrt(0.03**2 + 0.04**2 + (BOX.friction_radius_m * 0.2) ** 2)
    assert body.measure_work((0.03, 0.04, 0.2)) == pytest.approx(work_j)


@pytest.mark.parametrize("rotation_rad", [0.4, -0.3, 0.01])
def test_a_body_keeps_its_shape_however_often_it_turns(rotation_rad):
    body = place(BOX)
    for _ in range(500):
        body.move((0.001, -0.002, rotation_rad))
    assert body.pose == pytest.approx((0.5, -1.0, 500 * rotation_rad))
    expected = put(BOX, 0.5, -1.0, 500 * rotation_rad)
    for corner_m, expected_m in zip(body.corners_m, expected.corners_m):
        assert corner_m == pytest.approx(expected_m, abs=0.02 if abs(rotation_rad) > 0.1 else 1e-6)
    assert max(math.hypot(x_m - 0.5, y_m + 1.0) for x_m, y_m in body.corners_m) == pytest.approx(BOX.reach_m)
