"""Shapes of what robots push: where they touch, and what holds them to the floor."""

import math
import random

import pytest

from hero_node import Pose
from hero_sim.world.pushing.shapes import (
    Disc,
    Polygon,
    PushedBody,
    find_contacts,
    list_outlines,
    touch_circle,
    touch_walls,
)
from hero_test.nonempty import nonempty

BOX = Polygon([(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)])
GRAVITY_M_S2 = 9.81
FRICTION = 0.3


def place(shape, x_m=0.0, y_m=0.0, yaw_rad=0.0, push_n=0.5):
    """A body on which push_n through its center is just enough."""
    return PushedBody(shape, Pose(x_m, y_m, yaw_rad), push_n / (FRICTION * GRAVITY_M_S2), FRICTION)


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
    for (x_m, y_m), (turned_x_m, turned_y_m) in nonempty(zip(body.corners_m, turned.corners_m)):
        distance_m, angle_rad = math.hypot(x_m, y_m), math.atan2(y_m, x_m) + 0.8
        expected_m = (0.5 + distance_m * math.cos(angle_rad), -0.2 + distance_m * math.sin(angle_rad))
        assert (turned_x_m, turned_y_m) == pytest.approx(expected_m)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_circle_is_as_deep_in_a_body_as_it_is_from_the_nearest_way_out(shape):
    body = put(shape, 0.02, -0.03, 0.7)
    outline_m = list_outline(body, 500)
    for x_m, y_m, _ in nonempty(draw_places(60)):
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
    for x_m, y_m, yaw_rad in nonempty(draw_places(12)):
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
        assert min((contact.depth_m for contact in contacts), default=0.0) > -0.004
    assert near or not isinstance(one, Disc)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_box_that_hangs_over_an_edge_is_held_from_its_corner_to_the_end(side):
    contacts = find_contacts(put(BOX), put(BOX, side * 0.2, 0.2), 0.001)
    assert sorted(side * contact.x_m for contact in contacts) == pytest.approx([0.05, 0.15])
    assert [contact.normal_y for contact in contacts] == pytest.approx([1.0, 1.0])


def test_two_boxes_touch_at_their_corners_with_normals_into_the_second():
    for yaw_rad in (0.0, 1.0):
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        for gap_m in (-0.001, 0.003):
            away_m = 0.3 + gap_m
            # The second one lies 0.05 aside: two corners of each are beside the other.
            second = put(BOX, cosine * away_m - sine * 0.05, sine * away_m + cosine * 0.05, yaw_rad)
            contacts = find_contacts(put(BOX, 0.0, 0.0, yaw_rad), second, 0.004)
            assert [contact.depth_m for contact in contacts if abs(contact.depth_m + gap_m) < 1e-9]
            for contact in nonempty(contacts):
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
            for contact in nonempty(contacts):
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


def test_a_corner_right_at_the_end_of_a_wall_is_pressed():
    body = put(BOX, 0.0, 0.101)
    (left_m, y_m), (right_m, _) = sorted(body.corners_m, key=lambda corner_m: (corner_m[1] > 0.1, corner_m[0]))[:2]
    for ends in ((left_m, 0.0, right_m, 0.0), (right_m, 0.0, left_m, 0.0)):
        contacts = touch_walls(body, [ends], 0.004)
        found = sorted((contact.x_m, contact.y_m) for contact in contacts)
        assert found == [(left_m, 0.0), (left_m, y_m), (right_m, 0.0), (right_m, y_m)]
        assert {(contact.normal_x, contact.normal_y) for contact in contacts} == {(0.0, 1.0)}


def test_outlines_are_the_edges_and_discs_where_they_are():
    disc, box = place(Disc(0.05), 0.4, 0.1), place(BOX, 0.0, 0.0, math.pi / 2.0)
    edges_m, discs_m = list_outlines([disc, box])
    assert discs_m == [(0.4, 0.1, 0.05)]
    corners_m = [(0.1, -0.15), (0.1, 0.15), (-0.1, 0.15), (-0.1, -0.15)]
    assert edges_m == [pytest.approx((*a, *b)) for a, b in zip(corners_m, [*corners_m[1:], corners_m[0]])]


def test_the_force_of_a_body_and_its_radius_are_those_of_the_limit_surface():
    body = PushedBody(BOX, Pose(0.0, 0.0, 0.0), 0.5, 0.4)
    assert body.friction_n == pytest.approx(0.5 * 0.4 * 9.81)


@pytest.mark.parametrize("rotation_rad", [0.4, -0.3, 0.01])
def test_a_body_keeps_its_shape_however_often_it_turns(rotation_rad):
    body = place(BOX)
    for _ in range(500):
        body.move((0.001, -0.002, rotation_rad))
    assert body.pose == pytest.approx((0.5, -1.0, 500 * rotation_rad))
    expected = put(BOX, 0.5, -1.0, 500 * rotation_rad)
    for corner_m, expected_m in nonempty(zip(body.corners_m, expected.corners_m)):
        assert corner_m == pytest.approx(expected_m, abs=0.02 if abs(rotation_rad) > 0.1 else 1e-6)
    assert max(math.hypot(x_m - 0.5, y_m + 1.0) for x_m, y_m in body.corners_m) == pytest.approx(BOX.reach_m)
