"""Ten robots swap places across a circle while their odometry drifts."""

import math
from pathlib import Path

import numpy as np
import pytest

from hero_client import CommonFrame
from hero_client.controllers.orca import AvoidanceLaw
from hero_client.controllers.swarm_go_to import SwarmGoToController
from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.stepped.swarm import StepSwarm

ARENA = Path(__file__).resolve().parents[3] / "hero_test" / "arenas" / "circle_arena.yaml"
ROBOTS = 10
STEP_S = 0.1
TIMEOUT_S = 90.0


def measure_gap(places_m):
    """Return the least distance (m) between two bodies."""
    apart_m = np.hypot(*(places_m[:, None] - places_m[None]).transpose(2, 0, 1)) + np.eye(len(places_m))
    return float(apart_m.min()) - 2.0 * BODY_RADIUS_M


@pytest.mark.parametrize("seed", range(100, 104))
def test_robots_whose_odometry_drifts_swap_places_without_touching(seed):
    swarm = StepSwarm(ROBOTS, seed=seed, arena=str(ARENA))
    common = CommonFrame("world")
    goals = [(-robot.true_pose.x_m, -robot.true_pose.y_m) for robot in swarm]
    controller = SwarmGoToController(goals, AvoidanceLaw(), STEP_S, seed)
    least_gap_m = math.inf
    for time_s in swarm.rate(1.0 / STEP_S):
        poses = [common.pose_of(robot) for robot in swarm]
        commands = controller.step(poses, [robot.fresh_proximity() for robot in swarm])
        for robot, command in zip(swarm, commands):
            robot.drive(*command)
        least_gap_m = min(least_gap_m, measure_gap(swarm.rows.world.poses[:, :2]))
        if all(controller.arrived) or time_s > TIMEOUT_S:
            break
    assert all(controller.arrived)
    assert least_gap_m > 0.002
    drift_m = max(math.dist(common.pose_of(robot)[:2], robot.true_pose[:2]) for robot in swarm)
    assert drift_m > 0.02  # or this would try nothing
