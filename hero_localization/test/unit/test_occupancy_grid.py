"""The map that robots make of a room with a post in it, by what their sensors would measure there."""

import math

import numpy as np
import pytest

from hero_localization.mapping.occupancy_grid import BEAMS, OccupancyGrid
from hero_node.geometry import Pose
from hero_sim.robot.ranges import calibrate, convert_to_ranges
from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.world import range_sensors
from hero_sim.world.arena import Segments, build_rectangle

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


def test_all_of_the_walls_is_mapped(grid):
    occupied_m = grid.centers_of(grid.occupied)
    for side_m in np.linspace(0.03 - ROOM_M, ROOM_M - 0.03, 40):
        for wall_m in ((side_m, ROOM_M), (side_m, -ROOM_M), (ROOM_M, side_m), (-ROOM_M, side_m)):
            assert np.hypot(*(occupied_m - wall_m).T).min() < 0.02, wall_m


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
