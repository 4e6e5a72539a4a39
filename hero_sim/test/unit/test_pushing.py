"""Robots push discs and polygons: directions, twists, traction, walls and piles, against what theory gives."""

import math
import random

import pytest

from hero_node.geometry import Pose
from hero_sim.errors import OptionError
from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.world.arena_file import load_arena
from hero_sim.world.pushing import pushing as pushing_module
from hero_sim.world.pushing.pushed_body import PushedBody
from hero_sim.world.pushing.pushing import MAX_PUSH_N, Pushing
from hero_sim.world.pushing.shapes import Disc, Polygon, find_contacts, touch_circle, touch_walls

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


@pytest.mark.parametrize(
    "corners", [[(0, 0), (1, 0)], [(0, 0), (0, 1), (1, 0)], [(0, 0), (2, 0), (1, 0.1), (1, 2)]]
)
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
            touching = touch_walls(body.body, walls, 0.0)
            touching += [
                contact for other in bodies[:k] for contact in find_contacts(other.body, body.body, 0.0)
            ]
            touching += [
                contact
                for p in places_m
                for contact in [touch_circle(*p, BODY_RADIUS_M, body.body)]
                if contact.depth_m > 0
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
    pushed, lifted = swarm.rows.world.list_objects()
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
