"""Results that are kept of the parts of simulated robots, drawn or computed from many inputs (see kept_results)."""

import math

import numpy as np
import pytest
from driver_side import parse_options

from hero_node import Pose
from hero_sim import scene
from hero_sim.link.channel import Channel
from hero_sim.link.wifi import PROFILES, Radio, build_network, parse_wifi
from hero_sim.population import build_errors, build_radios, build_world, draw_seeds, draw_servo_timing, place_worlds
from hero_sim.world import arena as arenas
from hero_sim.world import range_sensors
from hero_sim.world.arena_file import SHIPPED, load_arena
from hero_sim.world.kinematics import find_heading
from hero_sim.world.pushing.shapes import Disc, Polygon, PushedBody
from hero_sim.world.robot_errors import describe_errors, draw_errors
from hero_sim.world.wheel_loops import draw_normal_at, find_place
from hero_sim.world.world import World
from hero_test.checks.kept_results import Digest


def test_headings_and_random_numbers_are_those_that_they_were():
    digest = Digest()
    digest.add(*find_heading(np.linspace(-40.0, 40.0, 4001)), *find_heading(np.arange(-9, 10) * (math.pi / 4.0)))
    places = find_place(np.arange(50)[:, None, None], np.arange(4)[:, None], np.arange(9))
    numbers = draw_normal_at(np.uint64(12345), places)
    digest.add(numbers)
    assert (numbers.mean(), numbers.std()) == pytest.approx((0.0, 1.0), abs=0.05)
    assert str(digest) == "f51aae4e966c8a5c"


def test_robots_drawn_for_a_seed_are_those_that_they_were():
    digest = Digest()
    for seed in range(3):
        models = ["--model", "hero_plus,robot=%d" % (seed + 6)]
        options = parse_options("--count", "5", "--first-id", "5", "--seed", str(seed), "--wifi", "router", *models)
        digest.add({name: np.ravel(drawn).tolist() for name, drawn in draw_seeds(options).items()})
        errors, options.servo_timing = build_errors(options), "drawn"
        digest.add(*errors, describe_errors(errors, 5), [draw_servo_timing(options, number) for number in range(40)])
        world = build_world(options, 2)
        digest.add(world.poses, *world.errors)
        digest.add([round(radio.find_arrival(0.0), 6) for radio in build_radios(options, 2)])
    poses = np.arange(18.0).reshape(2, 3, 3)
    world = place_worlds(arenas.build_rectangle(40.0, 40.0, 0), poses, (7, 9), 0.5, known=["robot=1,slip=0.1"])
    digest.add(world.poses, *world.errors)
    (line,) = describe_errors(draw_errors([np.random.RandomState(3)]), 3)
    assert line.startswith("robot=3,left_center_us=1511,right_center_us=1503,dead_zone_us=30,left_gain=1.00289,")
    assert str(digest) == "dbdd2bbb6aa883ba"


def build_all():
    """Return an arena with everything that a file can hold."""
    corners = np.array([(0.2, 0.2), (0.5, 0.25), (0.4, 0.6), (0.15, 0.5)])
    walls = [arenas.outline(each) for each in (corners, np.array([(-0.9, -0.8), (0.9, -0.7), (0.8, 0.9), (-0.7, 0.8)]))]
    things = (
        PushedBody(Disc(0.05), Pose(-0.3, 0.1, 0.0), 0.1, 0.3),
        PushedBody(Polygon([(0.0, 0.0), (0.2, 0.0), (0.1, 0.1)]), Pose(0.0, -0.3, 0.5), 0.1, 0.3),
    )
    gray = np.arange(35.0 * 50.0).reshape(35, 50) % 97.0 / 96.0
    areas = (
        arenas.Area("nest", (-0.8, -0.7, 0.1, 0.2), (0.1, 0.5, 1.0)),
        arenas.Area("ramp", (-0.2, 0.1, 0.7, 0.6), (0.5,) * 3, gray),
        arenas.Area("disc", (0.5, -0.4, 0.2), (1.0, 0.0, 0.0)),
    )
    return arenas.Arena(
        "all", np.vstack(walls), np.array([(-0.4, -0.4, 0.1), (0.0, 0.7, 0.05)]), (Pose(0.6, 0.6, 1.0),),
        np.array([-1.0, -1.0, 1.0, 1.0]), (corners,), things, areas, np.array([(0.1, 0.0), (-0.5, 0.5)]),
        (walls[1][:, :2],),
    )  # fmt: skip


def test_places_in_arenas_are_those_that_they_were():
    digest, free = Digest(), []
    points_m = np.stack(np.meshgrid(*2 * [np.linspace(-1.05, 1.05, 43)]), axis=-1).reshape(-1, 2)
    for arena in [build_all(), *map(load_arena, SHIPPED)]:
        digest.add(arenas.measure_clearance(points_m, arena), arenas.place_robots(arena, 6, np.random.RandomState(4)))
        free.append(sum(arenas.is_free(Pose(*point_m, 0.0), arena.starts, arena, 0.06) for point_m in points_m[::7]))
    for count in range(1, 30):
        digest.add(np.round(arenas.build_default(count).starts, 6), arenas.build_default(count).segments_m)
        digest.add(np.round(arenas.build_rectangle(3.0, 1.0, count).starts, 6))
    for area in build_all().areas:
        digest.add(area.covers(*points_m.T), area.find_colors(*np.clip(points_m, (-0.2, 0.1), (0.7, 0.6)).T))
    assert f"{free} {digest}" == "[109, 187, 158, 133, 259, 225] 7e20c9c7bc922784"


def test_sensors_see_what_they_saw():
    arena, digest, rng = build_all(), Digest(), np.random.RandomState(6)
    poses = np.column_stack((rng.uniform(-0.7, 0.7, (60, 2)), rng.uniform(-4.0, 4.0, 60)))
    errors = draw_errors([np.random.RandomState(row) for row in range(60)])
    for objects in (None, [[]] * 3):
        world = World(arena, np.round(poses, 3), [np.random.RandomState(seed) for seed in range(3)], errors, objects)
        rows, view = np.arange(60), world.observe()
        for each, sight in world._look(rows, view):
            alpha_counts_m2, beta_counts = errors.alpha_counts_m2[each], errors.beta_counts[each]
            digest.add(range_sensors.measure_signals(sight, alpha_counts_m2, beta_counts))
            digest.add(range_sensors.measure_distances(sight))
        digest.add(
            world.read_infrared(rows[1::2]), world.read_distances(rows[::3], view), world.read_infrared(rows, view)
        )
    assert str(digest) == "e24f6ab2723569ec"


def test_networks_delay_bytes_as_they_did():
    digest = Digest()
    for name, profile in sorted(PROFILES.items()):
        radio, taken = Radio(profile, np.random.RandomState(2)), 0
        for now_ms in range(0, 30000, 35):
            digest.add(round(radio.up.send(now_ms, 1400), 3), radio.is_transparent(now_ms), radio.is_carrying)
            radio.down.put(now_ms, bytes(56))
            taken += len(radio.down.take(now_ms))
            if now_ms % 7000 == 0:
                radio.stall(now_ms, 400)
        digest.add(name, taken)
    network = build_network(*parse_wifi("hotspot,channels=2"), range(30))
    for now_ms in range(0, 1000, 35):
        for radio in network:
            digest.add(round(radio.up.send(now_ms, 1400), 3), radio.is_congested(now_ms))
    channel = Channel(np.random.RandomState(1))
    for number in range(400):
        digest.add([round(ms, 3) for ms in channel.carry(number * 0.7, number % 23, 100 + 100 * (number % 17))])
    assert str(digest) == "bbe8822f3e0cf783"


def test_viewers_are_shown_what_they_were():
    arena = build_all()
    poses = np.array([(0.6, 0.6, 1.0), (-0.1, 0.1, -2.0), (0.0, 0.0, 0.5)])
    errors = draw_errors([np.random.RandomState(row) for row in range(3)])
    errors.radius_m[1] = 0.06
    world = World(arena, poses, [np.random.RandomState(0)], errors)
    lights = [(0.0, 0.0, 0.0, 1.0), (0.2, 0.5, 0.0, 0.5), (1.0, 1.0, 1.0, 0.0)]
    shapes = scene.draw_arena(arena) + scene.draw_objects(world.list_objects())
    shapes += scene.draw_robots(world, ["hero_1", "hero_22", "hero_3"], lights)
    rounded = [
        shape._replace(
            pose=Pose(*np.round(shape.pose, 5).tolist()), z_m=round(shape.z_m, 5),
            size_m=tuple(np.round(shape.size_m, 5).tolist()), color=tuple(np.round(shape.color, 5).tolist()),
        )
        for shape in shapes
    ]  # fmt: skip
    digest = Digest()
    flat = [shape._replace(pose=Pose(*shape.pose[:2], 0.0)) for shape in rounded]
    digest.add(rounded, scene.encode_markers(1234567890123, flat))
    assert f"{len(shapes)} {digest}" == "405 5c3ec657271c619a"
