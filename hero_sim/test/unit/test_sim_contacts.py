"""Bodies that meet: what must hold in every step, whatever they do."""

import collections
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.world import body_loops, compiled, contacts
from hero_sim.world.arena import build_default, build_rectangle, place_robots
from hero_sim.world.arena_file import SHIPPED, load_arena
from hero_sim.world.kinematics import split_to_wheels
from hero_sim.world.robot_errors import draw_errors, set_known
from hero_sim.world.world import World

MAX_OVERLAP_M = 5e-4
MAX_CREPT_M = 0.002
"""Maximum distance that robots which push each other without effect move in a second, m."""
WIDE = build_rectangle(20.0, 20.0, 1)


def build_world(poses, arena=WIDE, errors=0.0, seed=0, known=()):
    drawn = draw_errors([np.random.RandomState([seed, index]) for index in range(len(poses))], errors)
    for text in known:
        set_known(drawn, 0, text)
    return World(arena, np.array(poses, dtype=float), [np.random.RandomState(seed)], drawn)


def set_speeds(world, speeds_m_s):
    """Let robots drive straight on, from now on and without lag."""
    world.speeds_m_s[:] = world.commands_m_s[:] = np.array(speeds_m_s, dtype=float)[:, None]


def step(world):
    """Take one step, and check what must hold after each."""
    world.step()
    robots_m, walls_m = world.measure_overlaps()
    assert robots_m.max() <= MAX_OVERLAP_M
    assert walls_m.max() <= 1e-6


def test_a_robot_stops_at_a_wall_and_its_wheels_keep_turning():
    world = build_world([(0.0, 0.0, 0.0)], build_rectangle(1.0, 1.0, 1))
    set_speeds(world, [0.2])
    for _ in range(400):
        step(world)
    assert world.poses[0, 0] == pytest.approx(0.5 - BODY_RADIUS_M, abs=1e-6)
    assert world.travels_m[0, 0] > 0.75


def test_a_robot_that_no_longer_pushes_lets_go_at_once():
    world = build_world([(-BODY_RADIUS_M, 0.0, 0.0), (BODY_RADIUS_M, 0.0, 0.0)])
    set_speeds(world, [0.2, 0.0])
    for _ in range(50):
        step(world)
    before = world.poses.copy()
    set_speeds(world, [-0.2, 0.0])
    for number in range(1, 50):
        step(world)
        assert world.poses[:, 0] == pytest.approx(before[:, 0] + [-0.002 * number, 0.0], abs=1e-4)


@pytest.mark.slow
def test_a_robot_pressed_from_behind_still_slides_off_sideways():
    poses = [(-0.2, 0.0, 0.0), (-0.1, 0.0, 0.0), (0.0, 0.005, 0.0), (0.5, 0.0, 0.0)]
    world = build_world(poses, build_rectangle(1.2, 1.2, 1), known=["friction=0"])
    set_speeds(world, [0.2, 0.2, 0.2, 0.0])
    for _ in range(500):
        step(world)
    assert world.poses[2, 1] > 0.05


@pytest.mark.parametrize("to_wall_m", [0.0, 0.01, 0.02, 0.03, 0.1])
def test_robots_pushed_far_at_once_are_still_kept_out_of_walls(to_wall_m):
    edge_m = 0.6 - BODY_RADIUS_M - to_wall_m
    poses = [(edge_m, 0.0, 0.0), (edge_m, 0.0, 0.0), (edge_m - 0.08, 0.0, 0.0)]
    world = build_world(poses, build_rectangle(1.2, 1.2, 1))
    set_speeds(world, [0.01, 0.01, 0.0])
    for _ in range(12):
        world.step()
        assert world.measure_overlaps()[1].max() <= 1e-6
    for _ in range(20):
        step(world)


@pytest.mark.slow
def test_robots_that_come_from_afar_do_not_drive_through_each_other():
    world = build_world([(-0.9, 0.0, 0.0), (0.9, 0.0, math.pi), (0.0, 0.9, -math.pi / 2), (0.0, -0.9, math.pi / 2)])
    set_speeds(world, [0.28] * 4)
    for _ in range(450):
        step(world)
    assert world.poses[0, 0] < world.poses[1, 0]


wheel_speeds = st.floats(-0.28, 0.28, allow_nan=False)


@settings(max_examples=12)
@given(
    arena=st.sampled_from(("default",) + SHIPPED),
    robots=st.integers(1, 9),
    seed=st.integers(0, 2**31),
    commands=st.lists(st.lists(wheel_speeds, min_size=18, max_size=18), min_size=1, max_size=6),
)
def test_no_robot_is_ever_inside_a_wall_or_another_robot(arena, robots, seed, commands):
    arena = build_default(robots) if arena == "default" else load_arena(arena)
    world = build_world(place_robots(arena, robots, np.random.RandomState(seed)), arena, 1.0, seed)
    x_min, y_min, x_max, y_max = arena.bounds_m
    for speeds in commands:
        world.commands_m_s[:] = np.array(speeds).reshape(9, 2)[:robots]
        for _ in range(100):
            step(world)
    assert (world.poses[:, :2] > (x_min, y_min)).all()
    assert (world.poses[:, :2] < (x_max, y_max)).all()


def press(robots, towards_rad, steps, seed=0):
    """Drive robots into a corner or against a wall at full speed."""
    arena = build_rectangle(*[max(1.2, 0.14 * math.sqrt(robots))] * 2, robots)
    poses = np.array(arena.starts)
    poses[:, 2] = towards_rad + np.random.RandomState(seed).uniform(-0.2, 0.2, robots)
    world = build_world(poses, arena, 1.0, seed)
    world.commands_m_s[:] = 0.28
    for _ in range(steps):
        step(world)
    return world


@pytest.mark.slow
@pytest.mark.parametrize("robots, towards_rad", [(16, math.pi / 4), (40, 0.0)])
def test_robots_that_press_into_a_corner_or_wall_stay_apart(robots, towards_rad):
    poses = press(robots, towards_rad, 300).poses
    assert np.sort(poses[:, 0])[-4:].min() > poses[:, 0].max() - 2.0 * BODY_RADIUS_M


@pytest.mark.slow
def test_forty_robots_that_press_into_a_corner_come_to_rest():
    world = press(40, math.pi / 4, 1400, seed=1)  # with some seeds, one is still on its way
    before, overlaps_m = world.poses.copy(), []
    for _ in range(100):
        step(world)
        overlaps_m.append(world.measure_overlaps()[0].max())
    assert max(overlaps_m) < 1e-4
    assert np.hypot(*(world.poses - before)[:, :2].T).max() < MAX_CREPT_M


def compare_loops(monkeypatch, arena, poses, worlds, steps_each):
    """Compare several worlds at once by the loops for many rows with those that are computed one by one."""
    rows, results = len(poses), []
    errors = draw_errors([np.random.RandomState(row) for row in range(rows)])
    monkeypatch.setattr(contacts, "_MANY", 0)
    for rows_compiled in (10**9, 0):
        monkeypatch.setattr(compiled, "COMPILED_ROWS", rows_compiled)
        world = World(arena, poses, [np.random.RandomState(seed) for seed in range(worlds)], errors)
        rng, log = np.random.RandomState(0), []
        for _ in range(30):
            world.commands_m_s[:] = rng.uniform(-0.1, 0.28, (rows, 2))
            for _ in range(steps_each):
                world.step(10)
                log += [world.poses.tobytes(), world.travels_m.tobytes()]
        assert world._contacts._is_compiled == (rows_compiled == 0)
        results.append(log)
    assert results[0] == results[1]


@pytest.mark.option("numba")
@pytest.mark.parametrize("arena", ["discs", "maze"])
def test_worlds_give_the_same_bytes_compiled_and_not(monkeypatch, arena):
    """In several worlds at once, with robots that meet, walls, obstacles, and room for contacts that runs out."""
    arena = load_arena(arena)._replace(objects=())
    poses = np.vstack([place_robots(arena, 9, np.random.RandomState(seed)) for seed in range(3)])
    compare_loops(monkeypatch, arena, poses, 3, 1)


@pytest.mark.slow
@pytest.mark.parametrize("is_compiled", [False, True])
def test_loops_over_worlds_give_the_same_bytes_also_without_numba(monkeypatch, is_compiled):
    """With robots that touch each other, walls and a post all the time."""
    arena = build_rectangle(0.3, 0.24, 0)._replace(circles_m=np.array([(0.0, 0.0, 0.02)]))
    places = [(x_m, y_m, 3.0 * x_m) for x_m in (-0.1, 0.0, 0.1) for y_m in (-0.07, 0.07)]
    monkeypatch.setattr(compiled, "_compile_loops", lambda module: module)
    monkeypatch.setattr(body_loops, "IS_COMPILED", is_compiled)
    with np.errstate(over="ignore"):  # of random bits, which wrap
        compare_loops(monkeypatch, arena, np.array(places * 2), 2, 2)


def count_looks(monkeypatch, arena, looped):
    """Return how many contacts were active, and listed; how often they were looked at, left, listed and solved."""
    looks = collections.Counter()
    for name in ("list_near", "find_contacts", "solve_contacts", "leave_walls"):
        call = getattr(body_loops, name)

        def count(*given, name=name, call=call):
            result = call(*given)
            looks[name] += 1
            looks["active"] += result[2] if name == "find_contacts" else 0
            looks["contacts"] += given[3][1] if name == "list_near" and result else 0
            return result

        monkeypatch.setattr(body_loops, name, count)
    list_near = contacts.Contacts._list_near

    def list_and_count(own, before):
        near = list_near(own, before)
        looks.update(list_near=1, contacts=len(near.keys))
        return near

    monkeypatch.setattr(contacts.Contacts, "_list_near", list_and_count)
    monkeypatch.setattr(compiled, "_compile_loops", lambda module: module)
    monkeypatch.setattr(compiled, "COMPILED_ROWS", 0 if looped else 10**9)
    rng = np.random.RandomState(2)
    arena = (
        load_arena(arena) if arena else build_rectangle(0.9, 0.7, 0)._replace(circles_m=np.array([(0.1, 0.1, 0.05)]))
    )
    poses = np.vstack([place_robots(arena, 6, np.random.RandomState(seed)) for seed in range(2)])
    errors = draw_errors([np.random.RandomState(row) for row in range(12)])
    world = World(arena, poses, [np.random.RandomState(seed) for seed in range(2)], errors)
    looks.clear()
    with np.errstate(over="ignore"):  # of random bits, which wrap
        for _ in range(25):
            world.commands_m_s[:] = rng.uniform(-0.05, 0.25, (12, 2))
            world.step(20)
            world.poses.sum()
    return [looks[name] for name in sorted(looks)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arena", "looped", "kept"),
    [
        ("", False, [1564, 520, 216, 205, 52, 404]),
        ("", True, [1562, 486, 422, 404, 94, 404]),
        ("discs", False, [696, 110, 415, 407, 48, 508]),
    ],
)
def test_bodies_are_looked_at_as_seldom_as_they_were(monkeypatch, arena, looped, kept):
    """That what happens does not depend on it, other tests show; looking more often takes more time."""
    assert count_looks(monkeypatch, arena, looped) == kept


@pytest.mark.slow
def test_loops_over_worlds_miss_no_robot_that_comes_from_afar(monkeypatch):
    """Robots are listed anew when they could touch what is not in their lists."""
    monkeypatch.setattr(compiled, "_compile_loops", lambda module: module)
    # Lanes in which two robots, or one and a post, come from distances that differ by less than they go meanwhile.
    lanes, results = [(index, 0.1 * index - 0.55) for index in range(12)], []
    posts_m = [(0.01 * index, y_m, 0.04) for index, y_m in lanes[8:]]
    arena = build_rectangle(2.0, 1.4, 0)._replace(circles_m=np.array(posts_m))
    poses = [(-0.2, y_m, 0.0) for _, y_m in lanes] + [(0.25 + 0.01 * k, y_m, math.pi) for k, y_m in lanes[:8]]
    for rows in (10**9, 0):
        monkeypatch.setattr(compiled, "COMPILED_ROWS", rows)
        world = build_world(poses, arena)
        set_speeds(world, np.full(20, 0.28))
        with np.errstate(over="ignore"):  # of random bits, which wrap
            for _ in range(10):
                world.step(10)
                results.append(world.poses.tobytes())
        assert max(map(np.max, world.measure_overlaps())) < MAX_OVERLAP_M
    assert results[:10] == results[10:]


@pytest.mark.option("numba")
def test_nothing_is_compiled_at_the_first_contact(monkeypatch):
    """Robots in real time would pause meanwhile."""
    monkeypatch.setattr(compiled, "COMPILED_ROWS", 0)
    build_world([(0.0, 0.0, 0.0)]).step()
    loops = vars(compiled.compile_loops(body_loops, 1))
    known = {name: list(loop.signatures) for name, loop in loops.items()}
    press(20, math.pi / 4, 30)
    assert known["move_worlds"] and known == {name: list(loop.signatures) for name, loop in loops.items()}


def test_the_order_of_rows_matters_less_than_a_tenth_of_a_millimeter():
    rng = np.random.RandomState(3)
    poses = np.column_stack((rng.uniform(-0.012, 0.012, (8, 2)), rng.uniform(-math.pi, math.pi, 8)))
    poses[:, :2] += 0.1 * np.array([(x, y) for x in range(4) for y in range(2)])
    found = []
    for order in (np.arange(8), np.arange(8)[::-1]):
        world = build_world(poses[order])
        set_speeds(world, np.full(8, 0.1))
        for _ in range(25):
            step(world)
        found.append(world.poses[np.argsort(order), :2])
    assert found[0] == pytest.approx(found[1], abs=1e-4)


def test_a_turn_on_the_spot_moves_no_neighbor():
    world = build_world([(0.0, 0.0, 0.0), (2.0 * BODY_RADIUS_M, 0.0, 0.0)])
    world.speeds_m_s[0] = world.commands_m_s[0] = split_to_wheels(0.0, 3.0)
    for _ in range(200):
        step(world)
    assert world.poses[:, :2] == pytest.approx(np.array([(0.0, 0.0), (2.0 * BODY_RADIUS_M, 0.0)]), abs=1e-9)


@pytest.mark.slow
def test_it_is_known_from_how_far_away_robots_have_to_be_looked_at(monkeypatch):
    """Bodies are compared only when they could touch: rarely while they are far apart."""
    world, calls = build_world([(-0.9, 0.0, 0.0), (0.9, 0.0, math.pi)]), []
    separate = contacts.Contacts._separate
    monkeypatch.setattr(contacts.Contacts, "_separate", lambda own: (calls.append(0), separate(own)))
    set_speeds(world, [0.1, 0.1])
    for _ in range(800):
        step(world)
    assert 5 < len(calls) < 100
