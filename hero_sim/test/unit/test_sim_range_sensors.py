import math

import numpy as np
import pytest
from driver_side import SENT, DriverSide

from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.robot import ranges
from hero_sim.world import compiled, range_sensors, ray_loops
from hero_sim.world.arena import Segments, build_default, build_rectangle
from hero_sim.world.body import Body, SharedReadings
from hero_sim.world.kinematics import find_heading
from hero_sim.world.robot_errors import draw_errors
from hero_sim.world.world import STEP_MS, World

NO_WALLS = np.empty((0, 4))
NO_CIRCLES = np.empty((0, 3))
ALPHA = np.full((1, 8), range_sensors.ALPHA_COUNTS_M2)
BETA = np.full((1, 1), range_sensors.BETA_COUNTS)


def wall_at(distance_m):
    """A long wall in front of the front sensor of a robot at the origin."""
    x_m = BODY_RADIUS_M + distance_m
    return np.array([[x_m, -5.0, x_m, 5.0]])


def measure(segments, circles=NO_CIRCLES, poses=((0.0, 0.0, 0.0),)):
    arena = build_default(1)._replace(segments_m=segments, circles_m=circles)
    poses = np.array(poses, dtype=float)
    return measure_all(arena, poses, ALPHA, BETA, which=[0])[0]


def measure_all(arena, poses, alpha, beta, which):
    headings = np.column_stack(find_heading(poses[which, 2]))
    everybody = np.repeat(poses[None, :, :2], len(which), axis=0)
    walls = Segments.from_ends(arena.segments_m)
    bodies = everybody, np.full(len(poses), BODY_RADIUS_M)
    sight = range_sensors.Sight(poses[which, :2], headings, *bodies, walls, arena.circles_m)
    return range_sensors.measure_signals(sight, alpha, beta)


@pytest.mark.parametrize("distance_m", [0.03, 0.05, 0.08, 0.10, 0.15, 0.18])
def test_the_signal_follows_the_published_law(distance_m):
    expected = 0.423 / distance_m**2 - 0.93
    assert measure(wall_at(distance_m))[4] == pytest.approx(expected, rel=1e-6)


def test_a_near_wall_saturates_the_sensor():
    assert measure(wall_at(0.02))[4] == range_sensors.SATURATION_COUNTS
    assert measure(wall_at(0.005))[4] == range_sensors.SATURATION_COUNTS


@pytest.mark.parametrize("distance_m", np.arange(0.03, 0.191, 0.005))
def test_ranges_err_less_than_half_a_centimeter_to_19_cm(distance_m):
    calibration = ranges.calibrate(ALPHA[0], BETA[0])
    range_m = ranges.convert_to_ranges(measure(wall_at(distance_m)), calibration)[4]
    assert range_m - BODY_RADIUS_M == pytest.approx(distance_m, abs=0.005)


def test_nothing_in_reach_is_a_finite_range_above_range_max():
    ranges_m = ranges.convert_to_ranges(np.array([0.0, 1.0]), np.array([0.42, 0.42]))
    assert ranges_m == pytest.approx([0.256835, 0.256835])


def test_an_erased_calibration_makes_every_range_nan():
    assert np.isnan(ranges.convert_to_ranges(np.full(8, 60.0), np.full(8, np.nan))).all()


def test_the_stock_capture_gives_the_stock_ranges():
    # Readings and ranges of one /laser of a stock robot with the factory's 0.5.
    counts = np.array([10.0, 20.0, 40.0, 160.0, 400.0, 900.0, 320.0, 80.0])
    expected = [0.2568350, 0.1949489, 0.1486384, 0.0927367, 0.0721903, 0.0604052, 0.0763635, 0.1158919]
    assert ranges.convert_to_ranges(counts, np.full(8, 0.5)) == pytest.approx(expected, abs=2e-7)


def test_beams_go_counter_clockwise_from_the_rear_the_fifth_is_front():
    circle = np.array([[0.0, 0.15, 0.03]])  # to the left
    signals = measure(NO_WALLS, circle)
    assert int(np.argmax(signals)) == 6
    assert range_sensors.BEAM_ANGLES_RAD[4] == pytest.approx(0.0)
    assert range_sensors.BEAM_ANGLES_RAD[6] == pytest.approx(math.pi / 2)


def test_a_robot_sees_another_robot_and_not_itself():
    signals = measure(NO_WALLS, poses=((0.0, 0.0, math.pi / 2), (0.0, 0.2, 0.0)))
    assert int(np.argmax(signals)) == 4
    assert signals[4] == pytest.approx(0.423 / (0.2 - 2 * BODY_RADIUS_M) ** 2 - 0.93)
    assert np.allclose(np.delete(signals, 4), 0.0)


def test_all_robots_at_once_read_what_each_reads_alone():
    arena = build_default(9)
    rng = np.random.RandomState(3)
    poses = np.column_stack((rng.uniform(-0.6, 0.6, (9, 2)), rng.uniform(-3, 3, 9)))
    alpha = rng.normal(0.423, 0.01, (9, 8))
    beta = rng.normal(-0.93, 0.1, (9, 1))
    together = measure_all(arena, poses, alpha, beta, which=range(9))
    for index in range(9):
        alone = measure_all(arena, poses, alpha[[index]], beta[[index]], which=[index])
        assert alone[0].tolist() == together[index].tolist()


@pytest.mark.slow
def test_readings_are_whole_counts_with_the_published_noise():
    arena = build_default(1)
    arena = arena._replace(segments_m=wall_at(0.10))
    rng = np.random.RandomState(0)
    world = World(arena, np.zeros((1, 3)), [rng], draw_errors([rng], 0.0))
    readings = np.array([world.read_infrared(np.array([0]))[0, 4] for _ in range(2000)])
    assert (readings == np.rint(readings)).all()
    assert readings.mean() == pytest.approx(0.423 / 0.01 - 0.93, abs=0.15)
    assert readings.std() == pytest.approx(1.3, abs=0.15)
    assert readings.min() >= 0


def log_readings(world):
    """Note the rows of each look of the world's sensors."""
    read_infrared, looks = world.read_infrared, []

    def read(rows):
        looks.append(rows.tolist())
        return read_infrared(rows)

    world.read_infrared = read
    return looks


def test_readings_that_are_due_in_one_step_are_computed_together():
    poses = np.array([(0.0, 0.0, 0.0), (-0.02, 1.0, 0.0), (-0.04, 2.0, 0.0), (-0.06, 3.0, 0.0)])
    arena = build_default(4)._replace(segments_m=wall_at(0.05))
    rng = np.random.RandomState(0)
    world = World(arena, poses, [rng], draw_errors([rng] * 4, 0.0))
    looks, infrared = log_readings(world), SharedReadings(world)
    bodies = [Body(world, index, infrared) for index in range(4)]
    for _ in range(3):
        world.step()
    # Of a step the start is past, and the end still shows its state.
    for body, due_ms in zip(bodies, (30 + STEP_MS, 31, 30 + STEP_MS + 1, 30)):
        body.expect_infrared(due_ms)
    first, second = bodies[1].read_infrared(), bodies[0].read_infrared()
    assert looks == [[0, 1]]
    assert [second[4], first[4]] == pytest.approx([0.423 / 0.05**2 - 0.93, 0.423 / 0.07**2 - 0.93], abs=6.0)
    bodies[0].read_infrared()
    assert looks == [[0, 1], [0]], "a second reading is a new one"
    bodies[1].expect_infrared(45)
    world.step()
    bodies[2].read_infrared()
    assert looks[2:] == [[1, 2]]
    world.step()
    bodies[1].read_infrared()
    assert looks[3:] == [[1]], "a reading of the step before is not given"


@pytest.mark.slow
def test_robots_that_stream_expect_all_of_their_readings():
    driver = DriverSide("--count", "12")
    driver.start_streaming()
    looks = log_readings(driver.swarm.world)
    start_ms = driver.swarm.now_ms
    driver.run(4100)
    sent = sum(len(driver.list_packets(index, SENT["laser"], start_ms)) for index in range(12))
    assert sent == 12 * 20
    # Few are lost to other work of a robot, which delays its reading into the next step.
    assert sent <= sum(map(len, looks)) < 1.05 * sent
    assert len(looks) < 0.8 * sent


def test_distances_are_whole_millimeters_up_to_the_reach():
    errors = draw_errors([np.random.RandomState(row) for row in range(40)], 0.0)
    poses = np.column_stack((np.zeros(40), np.arange(40.0), np.zeros(40)))
    for wall_m in (3.0, 9.0):
        arena = build_default(1)._replace(segments_m=np.array([(wall_m, -9.0, wall_m, 99.0)]))
        read_m = World(arena, poses, [np.random.RandomState(0)], errors).read_distances(np.arange(40))
        assert np.round(read_m, 3).tolist() == read_m.tolist() and len(np.unique(read_m)) > 6
        assert read_m.mean() == pytest.approx(min(wall_m, 4.0), abs=0.004) and read_m.max() <= 4.0


NOTHING = (1e6, 0.0)


def meet(walls=NO_WALLS, circles=NO_CIRCLES, place_m=(0.0, 0.0), x=1.0, y=0.0, reach_m=0.65):
    """Return how far away a ray from a place meets the first of some things, and the cosine of its incidence."""
    walls = Segments.from_ends(np.array(walls, dtype=float).reshape(-1, 4))
    place_m, circles = np.array([place_m]), np.array(circles, dtype=float).reshape(-1, 3)
    sight = range_sensors.Sight(place_m, np.eye(2)[:1], place_m[None], np.full(1, BODY_RADIUS_M), walls, circles)
    distance_m, cosine = range_sensors.meet_first(np.array([[x]]), np.array([[y]]), sight, reach_m)
    return float(distance_m[0, 0]), float(cosine[0, 0])


def test_a_ray_meets_a_wall_between_its_ends_and_ahead_of_it():
    for ends in ((0.3, -0.1, 0.3, 0.2), (0.3, 0.2, 0.3, -0.1)):
        assert meet([ends]) == pytest.approx((0.3, 1.0))
        assert meet([ends], place_m=(0.1, 0.19)) == pytest.approx((0.2, 1.0))
        assert meet([ends], place_m=(0.0, 0.21)) == meet([ends], place_m=(0.0, -0.11)) == NOTHING, "beside its ends"
        assert meet([ends], x=-1.0) == NOTHING, "behind"
        assert meet([ends], reach_m=0.29) == NOTHING and meet([ends], reach_m=0.31) != NOTHING
    assert meet([(-0.5, 0.1, 0.5, 0.1)]) == NOTHING, "parallel"
    slanted = [(0.2, -0.2, 0.6, 0.2)]
    assert meet(slanted) == pytest.approx((0.4, math.sqrt(0.5)))
    assert meet(slanted, x=0.6, y=-0.8, place_m=(0.1, 0.3)) == pytest.approx((0.6 / 1.4, 1.4 * math.sqrt(0.5)))


def test_of_several_walls_the_nearest_counts_with_its_own_incidence():
    walls = [(0.5, -1.0, 0.5, 1.0), (0.2, -0.2, 0.6, 0.2), (0.45, -1.0, 0.45, 1.0)]
    for order in ((0, 1, 2), (2, 1, 0), (1, 0, 2)):
        assert meet([walls[index] for index in order]) == pytest.approx((0.4, math.sqrt(0.5)))
    assert meet(walls, [(0.35, 0.0, 0.05)]) == pytest.approx((0.3, 1.0)), "and a circle before them"
    assert meet(walls, [(0.5, 0.0, 0.05)]) == pytest.approx((0.4, math.sqrt(0.5))), "and none behind them"


def test_a_ray_meets_a_circle_where_its_rim_is_and_by_the_rims_slant():
    for aside_m in (0.0, 0.03, -0.03, 0.049):
        depth_m = math.sqrt(0.05**2 - aside_m**2)
        assert meet(circles=[(0.3, aside_m, 0.05)]) == pytest.approx((0.3 - depth_m, depth_m / 0.05))
    assert meet(circles=[(0.3, 0.051, 0.05)]) == meet(circles=[(-0.3, 0.0, 0.05)]) == NOTHING
    assert meet(circles=[(0.71, 0.0, 0.05)]) == NOTHING and meet(circles=[(0.69, 0.0, 0.05)])[0] == pytest.approx(0.64)
    assert meet(circles=[(0.0, 0.0, 0.05)]) == NOTHING, "its own body"
    assert meet(circles=[(0.02, 0.0, 0.05)])[0] == 0.0, "in another body, nothing is behind the sensor"


def test_things_at_the_rim_of_the_cone_count_for_seven_tenths():
    for off_rad in (-0.21, 0.21):
        # So narrow that the middle ray and that of the other side miss it.
        circle = np.array([[0.16 * math.cos(off_rad), 0.16 * math.sin(off_rad), 0.02]])
        distance_m = 0.14 - BODY_RADIUS_M
        assert measure(NO_WALLS, circle)[4] == pytest.approx(0.7 * 0.423 / distance_m**2 - 0.93, rel=1e-6)


def test_between_fit_and_table_the_offset_goes_from_one_to_the_other():
    middle = 0.5 * (-0.93 + 12.0 - 0.423 / 0.04)
    assert measure(wall_at(0.19))[4] == pytest.approx(0.423 / 0.19**2 + middle * 1.0, rel=1e-3)
    for distance_m in (0.25, 0.4):
        share = 0.2**2 / distance_m**2
        assert measure(wall_at(distance_m))[4] == pytest.approx(12.0 * share, rel=1e-6)


def test_the_distance_sensor_looks_ahead_as_far_as_four_meters():
    def measure_ahead(walls, circles=NO_CIRCLES, yaw_rad=0.0):
        heading = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)]])
        walls, place_m = Segments.from_ends(np.array(walls, dtype=float).reshape(-1, 4)), np.zeros((1, 2))
        sight = range_sensors.Sight(place_m, heading, place_m[None], np.full(1, BODY_RADIUS_M), walls, circles)
        return range_sensors.measure_distances(sight)[0]

    assert measure_ahead([(1.2, -1.0, 1.2, 1.0)]) == pytest.approx(1.2)
    assert measure_ahead([(-1.0, 2.0, 1.0, 2.0)], yaw_rad=math.pi / 2.0) == pytest.approx(2.0)
    assert measure_ahead(NO_WALLS, np.array([(3.0, 0.0, 0.1)])) == pytest.approx(2.9)
    assert measure_ahead(NO_WALLS) == measure_ahead([(4.1, -1.0, 4.1, 1.0)]) == 4.0


@pytest.mark.option("numba")
def test_compiled_sensors_see_the_same_bytes(monkeypatch):
    """Also of robots that touch, beside walls that meet, and beside obstacles."""
    rng, read = np.random.RandomState(0), []
    poses = np.column_stack((rng.uniform(-0.45, 0.45, (60, 2)), rng.uniform(-7.0, 7.0, 60)))
    for rows in (10**9, 0):
        monkeypatch.setattr(compiled, "COMPILED_ROWS", rows)
        arena = build_rectangle(1.0, 1.2, 0)._replace(circles_m=np.array([[0.1, 0.2, 0.1], [0.3, -0.3, 0.05]]))
        errors = draw_errors([np.random.RandomState(row) for row in range(60)])
        world = World(arena, poses, [np.random.RandomState(seed) for seed in range(3)], errors)
        sights = [sight for _, sight in world._look(np.arange(60), world.observe())]
        signals = np.concatenate([range_sensors.measure_signals(sight, ALPHA, BETA) for sight in sights])
        read.append([world.read_infrared(np.arange(60)).tobytes(), signals.tobytes()])
        assert len(np.unique(signals)) > 200
    assert read[0] == read[1]


def test_loops_over_rays_see_the_same_bytes_as_arrays(monkeypatch):
    arena = build_rectangle(0.6, 0.5, 0)._replace(circles_m=np.array([[0.1, 0.15, 0.04]]))
    touching_m = 0.3 - BODY_RADIUS_M - 5e-4
    poses = np.array([(-0.2, -0.1, 0.4), (-0.1, -0.1, 2.5), (0.0, 0.1, -1.0), (touching_m, -0.15, 5.0)])
    errors = draw_errors([np.random.RandomState(row) for row in range(4)])
    world = World(arena, poses, [np.random.RandomState(0)], errors)
    ((_, sight),) = world._look(np.arange(4), world.observe())
    seen = []
    for loops in (None, ray_loops):
        monkeypatch.setattr(range_sensors, "compile_loops", lambda module, rows, loops=loops: loops)
        seen.append(range_sensors._measure_brightness(sight))
    assert seen[0].tobytes() == seen[1].tobytes() and len(np.unique(seen[0])) > 20
    assert seen[0].max() > 1.0 / 0.002**2, "nearer than that, a sensor gets no more light than from 1 mm"
