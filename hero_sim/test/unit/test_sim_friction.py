"""Friction and traction where bodies touch, against closed forms and the balance of the floor's forces."""

import math

import numpy as np
import pytest

from hero_node.robot_constants import BODY_RADIUS_M, WHEEL_SEPARATION_M
from hero_sim.world.arena import Arena, build_rectangle
from hero_sim.world.body_loops import CASTER_M, CREEP_M_S, GRAVITY_M_S2
from hero_sim.world.robot_errors import MASS_KG, draw_errors, set_known
from hero_sim.world.world import STEP_MS, World

STEP_S = STEP_MS / 1000.0
FRAME_S = 2.0 * STEP_S
"""Contacts are solved as often."""
ACROSS_M = 2.0 * BODY_RADIUS_M
FIELD = build_rectangle(10.0, 10.0, 1)
EDGE_M = 5.0 - BODY_RADIUS_M
"""x of a robot that touches the wall at the right."""


def build_world(poses, speeds_m_s, known=(), arena=FIELD):
    """Return nominal robots that roll at speeds_m_s, one or (left, right) for each, without lag."""
    errors = draw_errors([np.random.RandomState(0) for _ in poses], 0.0)
    for text in known:
        set_known(errors, 0, text)
    world = World(arena, np.array(poses, dtype=float), [np.random.RandomState(0)], errors)
    speeds = [np.broadcast_to(speed, 2) for speed in speeds_m_s]
    world.speeds_m_s[:] = world.commands_m_s[:] = np.array(speeds, dtype=float)
    return world


def run(world, time_s):
    for _ in range(round(time_s / STEP_S)):
        world.step()
    return world.poses.copy()


def measure_twist(world, settle_s=1.0, row=0):
    """Return how fast a robot moves (m/s in world, rad/s), and by how much that differs from its wheels (the same).

    Once forces are steady; also its heading (rad) where its wheels took it.
    """
    before = run(world, settle_s)[row]
    after = run(world, FRAME_S)[row]
    left_m, right_m = world.speeds_m_s[row] * FRAME_S
    travel_m, turn_rad = (left_m + right_m) / 2.0, (right_m - left_m) / WHEEL_SEPARATION_M
    chord_rad = before[2] + turn_rad / 2.0
    free = np.array((travel_m * math.cos(chord_rad), travel_m * math.sin(chord_rad), turn_rad))
    return (after - before) / FRAME_S, (after - before - free) / FRAME_S, before[2] + turn_rad


def press_at(degrees, friction, speeds_m_s=0.1, others=()):
    known = ["robot_friction=0.3,wall_friction=%g,caster_friction=0" % friction, *others]
    return build_world([(EDGE_M - 1e-4, 0.0, math.radians(degrees))], [speeds_m_s], known)


@pytest.mark.parametrize("degrees", [0, 10, 30, 60, 80])
def test_without_friction_a_robot_slides_along_a_wall(degrees):
    x_m, y_m, yaw_rad = run(press_at(degrees, 0.0), 3.0)[0]
    assert y_m == pytest.approx(0.3 * math.sin(math.radians(degrees)), abs=1e-6)
    assert x_m == pytest.approx(EDGE_M, abs=1e-9) and yaw_rad == pytest.approx(math.radians(degrees), abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("degrees", "friction"), [(10, 0.1), (30, 0.5), (60, 0.3), (80, 0.1), (80, 0.5)])
def test_with_friction_a_robot_turns_in_and_stays(degrees, friction):
    world = press_at(degrees, friction)
    yaws_deg = [degrees] + [math.degrees(run(world, 0.1)[0, 2]) for _ in range(200)]
    assert (np.diff(yaws_deg) < 1e-9).all() and abs(yaws_deg[-1]) < 0.1, "towards the wall, without overshoot"
    before_m, after_m = world.poses[0, :2].copy(), run(world, 5.0)[0, :2]
    assert after_m == pytest.approx(before_m, abs=1e-5), "its wheels slip in place"


def balance(world, slip, yaw_rad, row=0):
    """Return the force (x, y in N) and moment (N m) of the floor on a robot without a caster, by its slip alone."""
    errors = world.errors
    cosine, sine, turn = math.cos(yaw_rad), math.sin(yaw_rad), slip[2]
    ahead, aside = cosine * slip[0] + sine * slip[1], cosine * slip[1] - sine * slip[0]
    load_n = MASS_KG * GRAVITY_M_S2 * errors.wheel_load[row, 0]
    on_wheel_n, force, moment = errors.wheel_friction[row, 0] * load_n / 2.0, np.zeros(2), 0.0
    for y_m in (WHEEL_SEPARATION_M / 2.0, -WHEEL_SEPARATION_M / 2.0):
        of_wheel = np.array((ahead - turn * y_m, aside))
        pull_n = -on_wheel_n * of_wheel / max(np.hypot(*of_wheel), CREEP_M_S)
        force += pull_n
        moment -= y_m * pull_n[0]
    return np.array((cosine * force[0] - sine * force[1], sine * force[0] + cosine * force[1])), moment


@pytest.mark.parametrize("speeds_m_s", [(0.1, 0.1), (0.05, 0.15), (0.15, 0.05), (-0.02, 0.12), (0.12, -0.02)])
@pytest.mark.parametrize("degrees", [0, 15, 30])
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.4])
def test_what_a_wall_does_to_a_robot_balances_the_floor(speeds_m_s, degrees, friction):
    """Also one that spins at the wall: the contact's pressure, drag and moment are those that the slips ask for."""
    world = press_at(degrees, friction, speeds_m_s)
    twist, slip, yaw_rad = measure_twist(world, 0.2)
    # The force on the robot by the floor: the wall gives the opposite.
    (pressure_n, drag_n), moment = balance(world, slip, yaw_rad)
    slid_m_s = twist[1] + BODY_RADIUS_M * twist[2]
    assert pressure_n > 0.0 and twist[0] == pytest.approx(0.0, abs=1e-3)
    assert abs(drag_n) <= 1.1 * friction * pressure_n + 0.005
    assert moment == pytest.approx(BODY_RADIUS_M * drag_n, abs=3e-3), "the drag acts at the rim"
    if abs(drag_n) < 0.8 * friction * pressure_n - 0.005:
        assert slid_m_s == pytest.approx(0.0, abs=3e-3), "it rolls along the wall"
    elif friction and abs(slid_m_s) > 2e-3:
        assert slid_m_s * drag_n > 0.0, "the wall drags against the slide"


@pytest.mark.parametrize("standing", [1, 2, 4, 8])
def test_one_robot_pushes_no_other_and_no_row(standing):
    """Their traction is equal: a row of n moves at a creep, CREEP_M_S / n."""
    world = build_world([(ACROSS_M * k, 0.0, 0.0) for k in range(standing + 1)], [0.1] + [0.0] * standing)
    moved_m = run(world, 3.0)[:, 0] - ACROSS_M * np.arange(standing + 1)
    assert moved_m == pytest.approx(np.full(standing + 1, 3.0 * CREEP_M_S / standing), rel=0.05, abs=1e-4)
    assert np.abs(world.poses[:, 1:]).max() < 1e-9


@pytest.mark.parametrize("standing", [1, 4, 8])
def test_wheels_that_creep_without_end_let_one_robot_push_any_number(standing):
    """As in published simulators: all slip alike, and the wheels' speed is shared."""
    poses = [(ACROSS_M * k, 0.0, 0.0) for k in range(standing + 1)]
    world = build_world(poses, [0.1] + [0.0] * standing, ["friction=0,creep_m_s=10"])
    moved_m = run(world, 1.0)[:, 0] - ACROSS_M * np.arange(standing + 1)
    assert moved_m == pytest.approx(np.full(standing + 1, 0.1 / (standing + 1)), rel=0.02, abs=1e-4)


def test_a_robot_with_more_traction_pushes_a_standing_one():
    known = ["wheel_friction=0.4,caster_friction=0", "robot=0,wheel_friction=0.8"]
    world = build_world([(0.0, 0.0, 0.0), (ACROSS_M, 0.0, 0.0)], [0.1, 0.0], known)
    twist, *_ = measure_twist(world)
    assert twist[0] == pytest.approx(0.1 - CREEP_M_S * 0.4 / 0.8, rel=0.01), "its wheels creep by the force's share"


@pytest.mark.parametrize(("first", "second", "moves"), [(0.5, 0.5, 0), (0.6, 0.4, 1), (0.45, 0.9, -1)])
def test_of_two_robots_head_on_the_one_with_more_traction_wins(first, second, moves):
    known = ["caster_friction=0", "robot=0,wheel_friction=%g" % first, "robot=1,wheel_friction=%g" % second]
    world = build_world([(0.0, 0.0, 0.0), (ACROSS_M, 0.0, math.pi)], [0.1, 0.1], known)
    twist, *_ = measure_twist(world)
    speed_m_s = 0.1 - CREEP_M_S * min(first, second) / max(first, second)
    assert twist[0] == pytest.approx(moves * speed_m_s, rel=0.01, abs=1e-6)
    assert np.abs(world.poses[:, 1]).max() < 1e-9


def test_the_caster_is_where_a_robot_is_held_behind_its_wheels():
    """A push from the side turns a robot about a point behind its axle: its front gives way."""
    world = build_world([(0.0, 0.0, 0.0), (0.0, -ACROSS_M, math.pi / 2.0)], [0.0, 0.1], ["robot=1,wheel_friction=2"])
    twist, *_ = measure_twist(world, 0.1)
    assert twist[1] > 0.05 and twist[2] > 0.05 and CASTER_M < 0.0


def build_door(width_m):
    """Return two rooms of 1 m with a door between them."""
    half_m = width_m / 2.0
    edges = build_rectangle(2.4, 1.2, 1).segments_m
    walls_m = np.vstack((edges, [(0.0, half_m, 0.0, 0.6), (0.0, -0.6, 0.0, -half_m)]))
    return Arena("door", walls_m, np.empty((0, 3)), (), np.array([-1.2, -0.6, 1.2, 0.6]))


@pytest.mark.slow
@pytest.mark.parametrize("diameters", [1.15, 1.5, 3.0])
def test_robots_that_crowd_at_a_door_do_not_overlap_or_shake(diameters):
    rng = np.random.RandomState(1)
    places = [(-0.95 + 0.11 * (k % 6), -0.44 + 0.22 * (k // 6), rng.uniform(-0.3, 0.3)) for k in range(30)]
    world = build_world(places, [0.1] * 30, arena=build_door(diameters * ACROSS_M))
    worst_m, shakes_m = 0.0, []
    for _ in range(1500):
        before_m = world.poses[:, :2].copy()
        world.step()
        robots_m, walls_m = world.measure_overlaps()
        worst_m = max(worst_m, float(robots_m.max()))
        assert walls_m.max() <= 1e-6
        shakes_m.append(np.hypot(*(world.poses[:, :2] - before_m).T).max())
    assert worst_m < 2e-4
    assert max(shakes_m) < 0.0025, "no robot is flung: one rolls 1 mm in a step"
