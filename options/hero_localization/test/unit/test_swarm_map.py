"""Scans of several robots on one map, each at the pose of its time; and the map's files."""

import math

import numpy as np
import pytest
import yaml
from PIL import Image

from hero_localization.mapping.occupancy_grid import OccupancyGrid, SwarmMap
from hero_localization.nodes.map_arena import save_map
from hero_node import Pose

AHEAD = [0.1, *[math.inf] * 7]
"""Something 0.1 m in front of the robot."""


def make_map():
    return SwarmMap(OccupancyGrid((-0.5, -0.5, 0.5, 0.5)))


def occupied_center(swarm_map):
    return swarm_map.grid.centers_of(swarm_map.grid.occupied).mean(axis=0)


def test_a_scan_counts_where_its_robot_was_then():
    swarm_map = make_map()
    for step in range(12):
        time_s = 0.1 * step
        swarm_map.add_pose(0, time_s, Pose(0.01 * step - 0.2, 0.0, 0.0))
        swarm_map.add_ranges(0, time_s + 0.05, AHEAD if step == 10 else [math.nan] * 8)
    assert swarm_map.update() == 11  # the last one waits for a newer pose
    np.testing.assert_allclose(occupied_center(swarm_map), (0.105 - 0.2 + 0.1, 0.0), atol=0.01)


def test_a_scan_waits_for_the_pose_of_its_time():
    swarm_map = make_map()
    swarm_map.add_pose(0, 1.0, Pose(0.0, 0.0, 0.0))
    swarm_map.add_ranges(0, 1.1, AHEAD)
    assert swarm_map.update() == 0
    swarm_map.add_pose(0, 1.2, Pose(0.0, 0.0, 0.0))
    assert swarm_map.update() == 1


def test_a_robot_without_poses_makes_no_map():
    swarm_map = make_map()
    for step in range(100):
        swarm_map.add_ranges(0, 0.2 * step, AHEAD)
    assert swarm_map.update() == 0
    swarm_map.add_pose(0, 30.0, Pose(0.0, 0.0, 0.0))
    assert swarm_map.update() == 0
    assert swarm_map.grid.known_share == 0.0


def test_robots_do_not_map_each_other():
    swarm_map = make_map()
    for step in range(10):
        swarm_map.add_pose(0, 0.2 * step, Pose(0.0, 0.0, 0.0))
        swarm_map.add_pose(1, 0.2 * step, Pose(0.13, 0.0, 0.0))
        swarm_map.add_ranges(0, 0.2 * step, AHEAD)
    assert swarm_map.update() == 10
    assert not swarm_map.grid.occupied.any()


def test_an_obstacle_that_a_robot_nearly_touches_is_not_the_robot_itself():
    swarm_map = make_map()
    for step in range(10):
        swarm_map.add_pose(0, 0.2 * step, Pose(0.0, 0.0, 0.0))
        swarm_map.add_ranges(0, 0.2 * step, [0.05, *[math.inf] * 7])
    swarm_map.update()
    np.testing.assert_allclose(occupied_center(swarm_map), (0.05, 0.0), atol=0.01)


def test_a_map_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(OSError):
        save_map(str(tmp_path / "none" / "arena.yaml"), OccupancyGrid((0.0, 0.0, 1.0, 1.0)))


def test_twenty_scans_wait_and_poses_are_kept_for_two():
    swarm_map = make_map()
    for step in range(30):
        swarm_map.add_ranges(0, 0.25 * step, AHEAD)
    for step in range(59):
        swarm_map.add_pose(0, 0.125 * step, Pose(0.0, 0.0, 0.0))
    # Poses are known from 5.25 to 7.25 s.
    assert swarm_map.update() == 9
    swarm_map = make_map()
    for step in range(30):
        swarm_map.add_ranges(0, 1.0 + 0.01 * step, AHEAD)
    swarm_map.add_pose(0, 1.0, Pose(0.0, 0.0, 0.0))
    swarm_map.add_pose(0, 1.5, Pose(0.0, 0.0, 0.0))
    assert swarm_map.update() == 20


def test_a_robot_that_others_pass_is_where_it_was_at_the_time_of_the_scan():
    for other_m, is_mapped in ((0.13, False), (0.4, True)):
        swarm_map = make_map()
        for step in range(11):
            swarm_map.add_pose(0, 0.1 * step, Pose(0.0, 0.0, 0.0))
            swarm_map.add_pose(1, 0.1 * step, Pose(other_m + 0.1 * step - 0.5, 0.0, 0.0))
            swarm_map.add_ranges(0, 0.5, AHEAD)
        swarm_map.update()
        assert swarm_map.grid.occupied.any() == is_mapped


def test_a_saved_map_is_as_map_server_reads_it(tmp_path):
    grid = OccupancyGrid((-0.5, 0.0, -0.46, 0.03))
    grid.log_odds[:] = [[-3.0, 3.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [0.0, 0.0, -3.0, 0.0]]
    image = save_map(str(tmp_path / "arena.yaml"), grid)
    assert image == str(tmp_path / "arena.png")
    assert np.asarray(Image.open(image)).tolist() == [[205, 205, 254, 205], [205] * 4, [254, 0, 205, 205]], "top first"
    assert yaml.safe_load((tmp_path / "arena.yaml").read_text()) == {
        "image": "arena.png", "resolution": 0.01, "origin": [-0.5, 0.0, 0.0], "negate": 0,
        "occupied_thresh": 0.65, "free_thresh": 0.196,
    }  # fmt: skip
