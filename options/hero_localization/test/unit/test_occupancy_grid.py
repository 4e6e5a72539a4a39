"""The map that robots make of a room with a post in it, by what their sensors would measure there."""

import math

import numpy as np
import pytest

from hero_localization.mapping.occupancy_grid import BEAMS, OccupancyGrid
from hero_node import Pose
from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.robot.ranges import calibrate, convert_to_ranges
from hero_sim.world import Segments, range_sensors
from hero_sim.world.arena import build_rectangle

ROOM_M = 0.5
"""Half side."""
POST_M = (0.1, 0.05, 0.06)
"""x, y, radius."""
ROOM = build_rectangle(2.0 * ROOM_M, 2.0 * ROOM_M, 1)
NONE = np.empty((0, 2))


def measure(pose, bodies_m=(POST_M,)):
    """Return the eight ranges that a calibrated robot without noise measures at pose."""
    alpha, beta = np.full((1, BEAMS), range_sensors.ALPHA_COUNTS_M2), np.array([[range_sensors.BETA_COUNTS]])
    place_m, heading = np.array([pose[:2]]), np.array([(math.cos(pose.yaw_rad), math.sin(pose.yaw_rad))])
    walls, circles_m = Segments.from_ends(ROOM.segments_m), np.array(bodies_m).reshape(-1, 3)
    bodies = place_m[:, None], np.array([BODY_RADIUS_M])
    counts = range_sensors.measure_signals(
        range_sensors.Sight(place_m, heading, *bodies, walls, circles_m), alpha, beta
    )
    ranges_m = np.roll(convert_to_ranges(np.rint(counts[0]).clip(0.0), calibrate(alpha[0], beta[0])), -BEAMS // 2)
    return [math.inf if range_m > 0.2368 else range_m for range_m in ranges_m]


def explore(grid):
    random = np.random.RandomState(0)
    for _ in range(1000):
        place = random.uniform(0.04 - ROOM_M, ROOM_M - 0.04, 2)
        if math.hypot(place[0] - POST_M[0], place[1] - POST_M[1]) > POST_M[2] + 0.04:
            pose = Pose(place[0], place[1], random.uniform(-math.pi, math.pi))
            grid.add_scan(pose, measure(pose), NONE)
    return grid


def distance_to_surface(points_m):
    wall_m = ROOM_M - np.abs(points_m).max(axis=1)
    post_m = np.hypot(points_m[:, 0] - POST_M[0], points_m[:, 1] - POST_M[1]) - POST_M[2]
    return np.minimum(np.abs(wall_m), np.abs(post_m))


@pytest.fixture(scope="module")
def grid():
    return explore(OccupancyGrid((-0.6, -0.6, 0.6, 0.6)))


@pytest.mark.slow
def test_occupied_cells_lie_on_the_walls_and_the_post(grid):
    distance_m = distance_to_surface(grid.centers_of(grid.occupied))
    assert len(distance_m) > 300
    assert (distance_m < 0.015).mean() > 0.95


@pytest.mark.slow
def test_all_of_the_walls_is_mapped(grid):
    occupied_m = grid.centers_of(grid.occupied)
    for side_m in np.linspace(0.03 - ROOM_M, ROOM_M - 0.03, 40):
        for wall_m in ((side_m, ROOM_M), (side_m, -ROOM_M), (ROOM_M, side_m), (-ROOM_M, side_m)):
            assert np.hypot(*(occupied_m - wall_m).T).min() < 0.02, wall_m


@pytest.mark.slow
def test_free_cells_are_free(grid):
    free_m = grid.centers_of(grid.free)
    inside = (np.abs(free_m).max(axis=1) < ROOM_M + 0.01) & (np.hypot(*(free_m - POST_M[:2]).T) > POST_M[2] - 0.01)
    assert inside.mean() > 0.99
    assert len(free_m) > 0.85 * (2.0 * ROOM_M / grid.cell_m) ** 2


def test_there_are_frontiers_until_the_room_is_known(grid):
    begun = OccupancyGrid((-0.6, -0.6, 0.6, 0.6))
    pose = Pose(-0.2, -0.2, 0.3)
    begun.add_scan(pose, measure(pose), NONE)
    begun.add_scan(pose, measure(pose), NONE)
    around_m = begun.centers_of(begun.frontiers)
    assert len(around_m) > 20
    assert np.hypot(*(around_m - pose[:2]).T).max() < 0.2
    assert grid.frontiers.sum() < 0.02 * grid.free.sum()


def test_other_robots_are_not_mapped():
    grid = OccupancyGrid((-0.6, -0.6, 0.6, 0.6))
    pose, other_m = Pose(-0.2, -0.2, 0.0), (-0.08, -0.2)
    for _ in range(20):
        grid.add_scan(pose, measure(pose, [(*other_m, 0.037)]), np.array([other_m]))
    assert not grid.occupied.any()
    for _ in range(20):
        grid.add_scan(pose, measure(pose, [(*other_m, 0.037)]), NONE)
    assert grid.occupied.any()


def test_ranges_that_are_not_known_change_nothing_but_the_own_place():
    grid = OccupancyGrid((-0.6, -0.6, 0.6, 0.6))
    grid.add_scan(Pose(0.0, 0.0, 0.0), [math.nan] * BEAMS, NONE)
    assert not grid.occupied.any()
    assert np.hypot(*grid.centers_of(grid.free).T).max() < 0.037


def test_something_too_close_to_measure_is_mapped_at_the_robot():
    grid = OccupancyGrid((-0.6, -0.6, 0.6, 0.6))
    for _ in range(5):
        grid.add_scan(Pose(0.0, 0.0, 0.0), [0.0] + [math.inf] * 7, NONE)
    occupied_m = grid.centers_of(grid.occupied)
    assert len(occupied_m)
    assert np.hypot(*(occupied_m - (0.047, 0.0)).T).max() < 0.02


@pytest.mark.parametrize("pose", [Pose(5.0, 0.0, 0.0), Pose(0.0, -0.7, 0.0), Pose(0.59, 0.59, 1.0)])
def test_a_robot_beyond_the_map_or_at_its_rim_does_no_harm(pose):
    grid = OccupancyGrid((-0.6, -0.6, 0.6, 0.6))
    grid.add_scan(pose, [0.1] * BEAMS, NONE)
    assert np.isfinite(grid.log_odds).all()


@pytest.mark.parametrize("bounds_m", [(0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0), (math.nan, 0.0, 1.0, 1.0)])
def test_bounds_without_an_area_are_refused(bounds_m):
    with pytest.raises(ValueError, match="bounds"):
        OccupancyGrid(bounds_m)
    with pytest.raises(ValueError, match="bounds"):
        OccupancyGrid((0.0, 0.0, 1.0, 1.0), 0.0)


CENTER = Pose(0.005, 0.005, 0.0)
"""The center of a cell."""


def make_grid(half_m=0.3):
    return OccupancyGrid((-half_m, -half_m, half_m, half_m))


def scan(ranges_m, pose=CENTER, others_m=NONE, grid=None):
    """Return the grid after a scan of these ranges, by sensor; the others tell nothing."""
    grid = grid or make_grid()
    grid.add_scan(pose, [ranges_m.get(beam, math.nan) for beam in range(BEAMS)], np.array(others_m).reshape(-1, 2))
    return grid


def at(grid, x_m, y_m):
    """Return the log odds of the cell at a place from the center."""
    column, row = (int(round((place - low) / grid.cell_m - 0.5)) for place, low in zip((x_m, y_m), grid.origin_m))
    return float(grid.log_odds[row, column])


def test_a_range_makes_its_cone_free_and_its_end_occupied():
    grid = scan({0: 0.105})
    sd_m, weight = 0.004 + 0.04 * (0.105 - BODY_RADIUS_M), (0.20 - 0.105) / (0.20 - 0.08)
    for distance_m in np.arange(0.0, 0.2, 0.01):
        beyond = (distance_m - 0.105) / sd_m
        free = -0.35 if distance_m < 0.105 - 2.0 * sd_m else 0.0
        expected = -2.0 if distance_m < BODY_RADIUS_M - 0.01 else free + 1.6 * weight * math.exp(-0.5 * beyond**2)
        assert at(grid, 0.005 + distance_m, 0.005) == pytest.approx(expected, abs=1e-4), distance_m
    # 0.19 and 0.24 rad beside the middle; the hit itself is likeliest there.
    assert at(grid, 0.055, 0.015) == pytest.approx(-0.35) and at(grid, 0.045, 0.015) == pytest.approx(0.0, abs=1e-3)
    aside = math.exp(-0.5 * (((math.hypot(0.1, 0.01) - 0.105) / sd_m) ** 2 + (math.atan2(0.01, 0.1) / 0.08) ** 2))
    assert at(grid, 0.105, 0.015) == pytest.approx(1.6 * weight * aside, abs=1e-3)


def test_each_sensor_looks_into_its_direction_counter_clockwise():
    for yaw_rad in (0.0, 0.5, 3.0, -2.0):
        for beam in range(BEAMS):
            grid = scan({beam: 0.12}, CENTER._replace(yaw_rad=yaw_rad))
            bearing_rad = yaw_rad + beam * math.pi / 4.0
            expected_m = 0.005 + 0.12 * np.array((math.cos(bearing_rad), math.sin(bearing_rad)))
            row, column = np.unravel_index(grid.log_odds.argmax(), grid.log_odds.shape)
            found_m = np.array(grid.origin_m) + (np.array((column, row)) + 0.5) * grid.cell_m
            assert found_m == pytest.approx(expected_m, abs=0.008), (yaw_rad, beam)


def test_near_ranges_count_fully_and_those_beyond_the_reach_not():
    for range_m, weight in ((0.06, 1.0), (0.08, 1.0), (0.14, 0.5), (0.19, 0.15)):
        x_m = 0.005 + round(range_m, 2)
        assert at(scan({0: range_m}), x_m, 0.005) == pytest.approx(1.6 * weight, abs=1e-4), range_m
    for range_m, free_m in ((0.21, 0.2), (math.inf, 0.15)):
        grid, edge_m = scan({0: range_m}), free_m - 2.0 * (0.004 + 0.04 * (free_m - BODY_RADIUS_M))
        assert grid.log_odds.max() <= 0.0
        for distance_m in np.arange(0.04, 0.2, 0.01):
            assert at(grid, 0.005 + distance_m, 0.005) == pytest.approx(-0.35 if distance_m < edge_m else 0.0)


def test_a_cell_is_never_surer_than_the_limit():
    grid = make_grid()
    for _ in range(30):
        scan({0: 0.06}, grid=grid)
    assert grid.log_odds.max() == 8.0 and grid.log_odds.min() == -8.0


def test_a_range_that_ends_at_another_robot_is_that_robot():
    for off_rad in (-0.21, 0.0, 0.21):
        for gap_m, is_mapped in ((0.029, False), (0.031, True)):
            # Beyond the end of the range, seen from the robot; only along this ray is it so near.
            away_m = 0.12 + BODY_RADIUS_M + gap_m
            bearing_rad = 0.7 + 3.0 * math.pi / 4.0 + off_rad
            other_m = (0.005 + away_m * math.cos(bearing_rad), 0.005 + away_m * math.sin(bearing_rad))
            grid = scan({3: 0.12, 5: 0.12}, CENTER._replace(yaw_rad=0.7), [(0.2, -0.2), other_m])
            hits_m = grid.centers_of(grid.log_odds > 0.5)
            assert (hits_m[:, 1] > 0.0).any() == is_mapped, (off_rad, gap_m)
            assert (hits_m[:, 1] < 0.0).any(), "the obstacle that another sensor sees is none of them"
            assert grid.log_odds.min() == -2.0 and (grid.log_odds == np.float32(-0.35)).sum() > 15, "free before it"


def test_the_rim_of_the_map_cuts_off_only_what_is_beyond():
    ranges_m = {0: 0.1, 1: 0.15, 2: math.inf, 3: 0.12, 4: 0.2, 5: 0.0, 6: 0.07, 7: 0.18}
    for left_m, low_m in ((-0.2, -0.2), (3.0, 2.0)):
        for x_m, y_m in ((0.2, 0.2), (0.39, 0.07), (0.0, 0.4), (0.45, 0.2), (0.1, -0.08), (0.65, 0.65)):
            large, small = (
                scan(
                    ranges_m,
                    Pose(left_m + x_m, low_m + y_m, 0.7),
                    grid=OccupancyGrid((left_m - more_m, low_m - more_m, left_m + 0.4 + more_m, low_m + 0.3 + more_m)),
                )
                for more_m in (0.5, 0.0)
            )
            np.testing.assert_allclose(small.log_odds, large.log_odds[50:80, 50:90], atol=1e-5)
    assert OccupancyGrid((0.0, 0.0, 0.101, 0.025)).log_odds.shape == (3, 11), "rows by y, the last ones beyond"


def paint(*rows):
    """Return a grid with these log odds."""
    grid = OccupancyGrid((0.0, 0.0, 0.01 * len(rows[0]), 0.01 * len(rows)))
    grid.log_odds[:] = rows
    return grid


def test_a_wall_is_occupied_where_it_is_in_reach_of_what_is_free():
    assert paint((-1.0, 0.0, 1.0, 1.0)).occupied.tolist() == [[False, False, True, False]]
    assert not paint((-1.0, 0.0, 0.0, 1.0)).occupied.any() and not paint((-1.0, 0.5, 0.5)).occupied.any()
    assert paint((0.0, 0.0, 0.6), (0.0, 0.0, 0.0), (-0.1, 0.0, 0.0)).occupied[0, 2], "across the corner, too"
    assert paint((-1.0, 2.0, 2.0)).occupied.tolist() == [[False, True, False]], "nothing is seen through it"


def test_cells_are_known_by_their_odds():
    grid = paint((-math.log(9.0), -0.5, 0.5, 0.0, math.log(3.0), 0.0, 0.0, -0.51))
    assert grid.free.tolist() == [[True, *[False] * 6, True]]
    assert grid.known_share == pytest.approx(3.0 / 8.0)
    assert grid.to_percent().tolist() == [[10, -1, -1, -1, -1, -1, -1, 38]], "a wall far from what is free is not known"
    assert paint((-1.0, math.log(3.0))).to_percent()[0, 1] == 75


def test_frontiers_are_free_cells_beside_unknown_ones_away_from_walls():
    row = (-1.0, -1.0, -1.0, 0.0, 0.0, 0.0)
    assert paint(row).frontiers.tolist() == [[False, False, True, False, False, False]]
    assert not paint((*row[:5], 1.0)).frontiers.any(), "two cells before a wall"
    assert paint((*row, 0.0, 1.0)).frontiers.any()


def test_the_longest_stretch_of_frontier_comes_first_by_its_middle():
    grid = OccupancyGrid((1.0, 2.0, 1.3, 2.2))
    grid.log_odds[2, 1:6], grid.log_odds[10, 20:24], grid.log_odds[17, 3:14] = -1.0, -1.0, -1.0
    np.testing.assert_allclose(grid.find_frontiers(), [(1.085, 2.175), (1.035, 2.025)])
    assert make_grid().find_frontiers().shape == (0, 2)
