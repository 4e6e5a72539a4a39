"""Ten robots swap places across a circle while their odometry drifts: simulated robots, without ROS and sockets."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

from hero_client.controllers.orca import AvoidanceLaw
from hero_client.controllers.swarm_go_to import SwarmGoToController
from hero_client.geometry import Pose
from hero_sim.robot import declarations
from hero_sim.robot_constants import BODY_RADIUS_M, TICK_M
from hero_sim.world.kinematics import find_heading, join_wheels, move_along_arc

ROOT = Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT / "hero_sim" / "test" / "unit"))
from driver_side import DriverSide, read_laser  # noqa: E402 (a test's folder is no package)

ROBOTS = 10
STEP_MS = 100
DELAY_MS = 60
"""From the pose to the command's arrival: as with the robots' network and their own cycle."""


class Swap:
    """The robots, what their odometry says, and what their sensors see."""

    def __init__(self, seed):
        arena = ROOT / "hero_test" / "arenas" / "circle_arena.yaml"
        self.driver = DriverSide("--count", str(ROBOTS), "--arena", str(arena), "--seed", str(seed))
        self.driver.start_streaming()
        self.world = self.driver.swarm.world
        self.poses = self.world.poses.copy()
        self.ranges = [[math.inf] * 8 for _ in range(ROBOTS)]
        self.counted_m = self.world.travels_m.copy()
        goals = [(-x_m, -y_m) for x_m, y_m, _ in self.poses]
        self.steering = SwarmGoToController(goals, AvoidanceLaw(), STEP_MS / 1000.0, seed)
        self.least_gap_m = math.inf

    def step(self):
        """Read odometry and sensors, and let the robots move on for one step."""
        rolled_m = np.round((self.world.travels_m - self.counted_m) / TICK_M) * TICK_M
        self.counted_m += rolled_m
        x_m, y_m, theta_rad = self.poses.T
        travel_m, rotation_rad = join_wheels(*rolled_m.T)
        x_m, y_m, *_ = move_along_arc(x_m, y_m, *find_heading(theta_rad), travel_m, rotation_rad)
        self.poses = np.column_stack((x_m, y_m, theta_rad + rotation_rad))
        for robot_id, arrivals in enumerate(self.driver.arrivals):
            for arrival in arrivals:
                if arrival.topic_id == declarations.ID_LASER:
                    self.ranges[robot_id] = front_first(read_laser(arrival.payload)[1])
            arrivals.clear()
        commands = self.steering.step([Pose(*pose) for pose in self.poses], self.ranges)
        self.driver.run(DELAY_MS)
        for robot_id, command in enumerate(commands):
            self.driver.send_twist(robot_id, *command)
        self.driver.run(STEP_MS - DELAY_MS)
        places = self.world.poses[:, :2]
        apart_m = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + np.eye(ROBOTS)
        self.least_gap_m = min(self.least_gap_m, float(apart_m.min()) - 2.0 * BODY_RADIUS_M)


def front_first(laser):
    """Return what the driver makes of a stock robot's scan: eight ranges, straight ahead first."""
    beams = [laser[(8 + 2 * index) % 16] for index in range(8)]
    return [math.inf if range_m > 0.2368 else 0.0 if range_m <= 0.04681 else range_m for range_m in beams]


@pytest.mark.parametrize("seed", range(100, 103))
def test_robots_whose_odometry_drifts_swap_places_without_touching(seed):
    swap = Swap(seed)
    for _ in range(900):
        swap.step()
        if all(swap.steering.arrived):
            break
    drift_m = float(np.hypot(*(swap.poses - swap.world.poses)[:, :2].T).max())
    assert drift_m > 0.03  # or this would try nothing
    assert all(swap.steering.arrived)
    assert swap.least_gap_m > 0.002
