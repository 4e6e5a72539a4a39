"""Robots push discs and polygons: directions, twists, traction, walls and piles, against what theory gives."""

import math
import random

import numpy as np
import pytest

from hero_node import Pose
from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.errors import OptionError
from hero_sim.stepped.swarm import StepSwarm
from hero_sim.world.arena import Arena
from hero_sim.world.arena_file import load_arena
from hero_sim.world.pushing.shapes import (
    Disc,
    Polygon,
    PushedBody,
    find_contacts,
    touch_circle,
    touch_walls,
)
from hero_sim.world.robot_errors import MASS_KG, draw_errors, set_known
from hero_sim.world.world import World
from hero_test.nonempty import nonempty

MAX_PUSH_N = MASS_KG * 9.81 * (0.85 * 0.5 + 0.15 * 0.2)
"""Traction of a nominal robot: its wheels and its caster."""

CREEP_SHARE = 0.06
"""Share of their speed that wheels lose when they push nearly as much as they can; see CREEP_M_S."""

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


class Bench:
    """Nominal robots that roll at 0.1 m/s, and bodies, in a world without more than walls and circles.

    Attributes:
        world: all of it.
        bodies: where they are now; those given when it was made do not move.
    """

    def __init__(self, bodies, walls=(), circles=(), robots=(), heading_rad=math.pi / 2.0, known=()):
        walls, circles = np.reshape(walls, (-1, 4)).astype(float), np.reshape(circles, (-1, 3)).astype(float)
        arena = Arena("bench", walls, circles, (), np.array([-2.0, -2.0, 2.0, 2.0]), (), tuple(bodies))
        headings = np.broadcast_to(heading_rad, len(robots))
        poses = np.array([(*place_m, yaw_rad) for place_m, yaw_rad in zip(robots, headings)])
        errors = draw_errors([np.random.RandomState(0) for _ in robots], 0.0)
        for text in known:
            set_known(errors, 0, text)
        self.world = World(arena, poses, [np.random.RandomState(0)], errors)
        self.roll(0.1)

    def roll(self, speed_m_s):
        self.world.speeds_m_s[:] = self.world.commands_m_s[:] = speed_m_s

    def step(self, steps=1):
        """Take steps; return the places of the robots."""
        for _ in range(steps):
            self.world.step()
        return self.world.poses[:, :2].copy()

    @property
    def bodies(self):
        return self.world.list_objects()


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, -2.0])
def test_a_push_through_the_center_turns_nothing(yaw_rad):
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    robot_m = (-sine * BELOW_M, cosine * BELOW_M)
    bench = Bench([place(BOX, 0.0, 0.0, yaw_rad)], robots=[robot_m], heading_rad=yaw_rad + math.pi / 2.0)
    bench.step(200)
    (box,) = bench.bodies
    assert abs(math.degrees(box.pose.yaw_rad - yaw_rad)) < 1.0
    assert (box.x_m, box.y_m) == pytest.approx((-sine * 0.2, cosine * 0.2), abs=0.2 * CREEP_SHARE)


@pytest.mark.parametrize("offset_m", [0.0, 0.02, 0.05, 0.1])
def test_without_contact_friction_the_twist_is_that_of_the_limit_surface(offset_m):
    bench = Bench([place(BOX, push_n=0.1)], robots=[(offset_m, BELOW_M)], known=["friction=0"])
    ((_, robot_y_m),) = bench.step()
    (box,) = bench.bodies
    # The force f along y turns into (0, f, h f / c^2); its point moves as far as the robot.
    rotation_by_m = offset_m / BOX.friction_radius_m**2
    y_m = (robot_y_m - BELOW_M) / (1.0 + offset_m * rotation_by_m)
    assert robot_y_m - BELOW_M == pytest.approx(STEP_M, rel=CREEP_SHARE)
    assert box.pose.x_m == pytest.approx(0.0, abs=1e-9)
    assert box.pose.y_m == pytest.approx(y_m, rel=0.01)
    assert box.pose.yaw_rad == pytest.approx(y_m * rotation_by_m, rel=0.01)


@pytest.mark.parametrize("offset_m", [0.02, 0.05, 0.1])
def test_with_friction_the_point_sticks_or_the_force_is_on_its_cone(offset_m):
    bench = Bench([place(BOX, push_n=0.1)], robots=[(offset_m, BELOW_M)])
    bench.step()
    (box,) = bench.bodies
    x_m, y_m, rotation_rad = box.pose
    robot_x_m, _, yaw_rad = bench.world.poses[0]
    slide_m = x_m + 0.1 * rotation_rad - (robot_x_m - offset_m) + BODY_RADIUS_M * (yaw_rad - math.pi / 2.0)
    # By the limit surface the force is along (x, y, c^2 w).
    cone = abs(x_m) / y_m
    assert abs(slide_m) < 0.05 * STEP_M or cone == pytest.approx(FRICTION, rel=0.02)
    assert cone <= FRICTION * 1.02
    assert rotation_rad * BOX.friction_radius_m**2 == pytest.approx(offset_m * y_m + 0.1 * x_m, rel=0.02)


@pytest.mark.parametrize("needed", [1, 2, 3, 4])
def test_a_body_that_needs_n_robots_moves_for_n_and_not_for_one_less(needed):
    for robots in nonempty(range(max(needed - 1, 1), needed + 1)):
        long = Polygon([(0.0, 0.0), (0.5, 0.0), (0.5, 0.2), (0.0, 0.2)])
        body = place(long, push_n=(needed - 0.5) * MAX_PUSH_N)
        # They arrive one after the other.
        places_m = [((k - (robots - 1) / 2.0) * 0.09, BELOW_M - 0.0003 * k) for k in range(robots)]
        bench = Bench([body], robots=places_m)
        bench.step(200)
        (body,) = bench.bodies
        if robots < needed:
            assert body.pose == (0.0, 0.0, 0.0)
        else:
            assert body.pose.y_m > 0.1 and abs(body.pose.yaw_rad) < math.radians(1.0)


def test_an_untouched_object_stays():
    bench = Bench([place(BOX), place(Disc(0.05), 0.0, 0.15)], robots=[(0.5, -0.2)])
    bench.step(50)
    assert [body.pose for body in bench.bodies] == [(0.0, 0.0, 0.0), (0.0, 0.15, 0.0)]


def test_a_robot_that_leaves_pulls_nothing():
    bench = Bench([place(BOX)], robots=[(0.0, BELOW_M)])
    bench.roll(-0.1)
    bench.step(5)
    assert bench.bodies[0].pose == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_walls_stop_what_is_pushed_and_the_robot_behind_it():
    wall = [(-1.0, 0.3, 1.0, 0.3)]
    for shape, half_m in ((BOX, 0.1), (Disc(0.08), 0.08)):
        bench = Bench([place(shape)], wall, robots=[(0.0, -half_m - BODY_RADIUS_M)])
        ((_, y_m),) = bench.step(300)
        (body,) = bench.bodies
        assert body.pose.y_m == pytest.approx(0.3 - half_m, abs=5e-4)
        assert y_m <= body.pose.y_m - half_m - BODY_RADIUS_M + 5e-4


def test_a_pushed_body_pushes_others_and_their_friction_adds_up():
    def push_row(count):
        row = [place(Disc(0.05), 0.0, 0.1 * k, push_n=0.35 * MAX_PUSH_N) for k in range(count)]
        bench = Bench(row, robots=[(0.0, -0.05 - BODY_RADIUS_M)])
        bench.step(100)
        return [body.pose.y_m for body in bench.bodies]

    assert push_row(2) == pytest.approx([0.1, 0.2], abs=0.1 * CREEP_SHARE)
    assert push_row(3) == pytest.approx([0.0, 0.1, 0.2], abs=1e-4)  # 1.05 times its traction


@pytest.mark.slow
def test_two_boxes_in_a_row_neither_overlap_nor_turn():
    row = [place(BOX, push_n=0.1), place(BOX, 0.0, 0.2, push_n=0.1)]
    bench = Bench(row, robots=[(0.0, BELOW_M)])
    for _ in range(500):
        bench.step()
        first, second = bench.bodies
        assert second.pose.y_m - first.pose.y_m - 0.2 > -1e-5
    assert first.pose.y_m == pytest.approx(0.5, abs=0.5 * CREEP_SHARE)
    assert [body.pose.yaw_rad for body in (first, second)] == pytest.approx([0.0, 0.0], abs=1e-6)


@pytest.mark.parametrize(("push_n", "pivots"), [(0.6, True), (0.85, False)])
def test_a_box_at_the_end_of_a_wall_pivots_as_its_moments_say(push_n, pivots):
    """Without friction the wall's end holds its point of the box only from above.

    A turn w about it moves the center by hold w and costs push_n sqrt(hold^2 + c^2) w; the robot's push gives
    (hold + offset) w for each newton.
    """
    offset_m, hold_m = 0.05, 0.1
    bench = Bench(
        [place(BOX, push_n=push_n)], [(hold_m, 0.1, hold_m, 0.4)], robots=[(-offset_m, BELOW_M)], known=["friction=0"]
    )
    ((_, robot_y_m),) = bench.step(5)
    (box,) = bench.bodies
    needed_n = push_n * math.hypot(hold_m, BOX.friction_radius_m) / (hold_m + offset_m)
    assert (needed_n < MAX_PUSH_N - 0.15 * MASS_KG * 9.81 * 0.2) == pivots
    turned_rad = -box.pose.yaw_rad
    if pivots:
        assert turned_rad == pytest.approx((robot_y_m - BELOW_M) / (hold_m + offset_m), rel=0.04)
        assert box.pose.y_m == pytest.approx(hold_m * turned_rad, rel=0.04)
        assert robot_y_m - BELOW_M == pytest.approx(5 * STEP_M, rel=CREEP_SHARE)
    else:
        assert turned_rad == pytest.approx(0.0, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
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
    places_m = [(-0.42, -0.4 + 0.2 * k) for k in range(4)]
    bench = Bench(bodies, walls, robots=places_m, heading_rad=[rng.uniform(-0.3, 0.3) for _ in places_m])
    worst_m = 0.0
    for _ in range(150):
        before = [body.pose for body in bench.bodies]
        places_m = bench.step()
        bodies = bench.bodies
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
        bench = Bench([place(BOX), place(Disc(0.05), 0.1, 0.16)], robots=[(0.05, BELOW_M), (-0.05, BELOW_M)])
        bench.step(100)
        return [body.pose for body in bench.bodies]

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


def test_a_box_pushed_at_the_end_of_a_wall_turns_about_it():
    bench = Bench([place(BOX, push_n=0.2)], [(0.05, 0.2, 0.05, 0.6)], robots=[(0.0, BELOW_M)])
    for _ in range(300):
        bench.step()
        (box,) = bench.bodies
        assert max(contact.depth_m for contact in touch_walls(box, [(0.05, 0.2, 0.05, 0.6)], 1.0)) < 5e-4
    assert box.pose.y_m > 0.1 - 1e-3 and box.pose.yaw_rad < -0.05


def test_a_round_obstacle_stops_what_is_pushed():
    for shape, half_m in ((BOX, 0.1), (Disc(0.08), 0.08)):
        bench = Bench([place(shape)], [], [(0.0, 0.3, 0.05)], [(0.0, -half_m - BODY_RADIUS_M)])
        bench.step(250)
        assert bench.bodies[0].pose.y_m == pytest.approx(0.25 - half_m, abs=5e-4)


def test_a_wide_robot_pushes_with_its_own_radius():
    bench = Bench([place(BOX, push_n=0.1)], robots=[(0.0, -0.1 - 0.06)], known=["radius_m=0.06"])
    ((_, y_m),) = bench.step(50)
    (body,) = bench.bodies
    assert body.pose.y_m == pytest.approx(0.05, abs=0.05 * CREEP_SHARE)
    assert y_m == pytest.approx(body.pose.y_m - 0.16, abs=1e-4)
