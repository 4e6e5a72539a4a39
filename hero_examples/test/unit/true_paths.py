"""Where simulated robots truly were: gaps, touches, cells visited.

A path is an array (T, N, 3) of one world: rows 50 ms apart, robots, and x m, y m, yaw rad.
"""

import numpy as np

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import measure_clearance

TOUCH_M = 0.001
"""Nearer than this two bodies touch; the simulator lets nothing overlap."""

SEEN_RAD = np.radians(60.0)
"""Half of the field that a robot sees coming: the front beams and their cones."""

REST = 0.001
"""A robot that moves less, in m and rad, within 0.5 s is at rest; the speed of a servo that stops fades out."""

CREEP_M = 0.0005
"""Of one row, 50 ms: a slower robot (0.01 m/s) does not run into anything; things run into it."""


def run(swarm, step, duration_s, hz=10.0):
    """Call step(time_s) hz times per simulated second, until it returns True; return the paths, one per world."""
    log = swarm.log()
    for time_s in swarm.rate(hz):
        if time_s >= duration_s or step(time_s):
            break
    return split_worlds(log)


def split_worlds(log):
    """Return the paths in a SwarmLog, one per world."""
    return list(np.moveaxis(log.true_pose, 1, 0))


def stop_within(swarm, settle_s=0.5):
    """Return whether all robots are at rest settle_s from now on; their own watchdogs take 2 s."""
    swarm.sleep(settle_s)
    before = swarm.rows.world.poses.copy()
    swarm.sleep(0.5)
    return np.abs(swarm.rows.world.poses - before).max() < REST


def measure_gaps(path):
    """Return the gaps between bodies in m (T, N, N), inf of a robot to itself."""
    places = path[:, :, :2]
    gaps_m = np.hypot(*np.moveaxis(places[:, None] - places[:, :, None], -1, 0)) - 2.0 * BODY_RADIUS_M
    gaps_m[:, np.arange(path.shape[1]), np.arange(path.shape[1])] = np.inf
    return gaps_m


def measure_wall_gaps(path, arena):
    """Return the gaps between bodies and the nearest wall or obstacle in m (T, N)."""
    return measure_clearance(path[:, :, :2].reshape(-1, 2), arena).reshape(path.shape[:2]) - BODY_RADIUS_M


def list_touches(path, arena):
    """Return (robot, other or -1 for a wall, row) of each touch that a robot drove into with open eyes.

    It counts if the robot moved ahead and what it touched was within its front field as the touch began.
    """
    gaps_m = measure_gaps(path)
    offsets = path[:, None, :, :2] - path[:, :, None, :2]  # (T, robot, other, 2)
    walls_m = measure_wall_gaps(path, arena)
    # A wall is where the gap gets less.
    slopes = [walls_m - measure_wall_gaps(path + shift, arena) for shift in ([0.001, 0, 0], [0, 0.001, 0])]
    gaps_m = np.concatenate((gaps_m, walls_m[:, :, None]), axis=2)
    offsets = np.concatenate((offsets, np.stack(slopes, axis=-1)[:, :, None]), axis=2)
    bearings = np.arctan2(offsets[..., 1], offsets[..., 0]) - path[:, :, None, 2]
    ahead = np.abs(np.angle(np.exp(1j * bearings))) < SEEN_RAD
    steps = np.diff(path[:, :, :2], axis=0)
    driven_m = steps[..., 0] * np.cos(path[:-1, :, 2]) + steps[..., 1] * np.sin(path[:-1, :, 2])
    begins = (gaps_m[1:] < TOUCH_M) & (gaps_m[:-1] >= TOUCH_M) & ahead[:-1] & (driven_m > CREEP_M)[:, :, None]
    others = list(range(path.shape[1])) + [-1]
    return [(int(robot), others[other], int(row)) for row, robot, other in np.argwhere(begins)]


def measure_lengths(path):
    """Return how far each robot drove, m (N,)."""
    return np.hypot(*np.moveaxis(np.diff(path[:, :, :2], axis=0), -1, 0)).sum(axis=0)


def share_visited(path, arena, cell_m):
    """Return the share of the cells a robot could stand in that any robot was in."""
    x_min, y_min, x_max, y_max = arena.bounds_m
    shape = (int(round((x_max - x_min) / cell_m)), int(round((y_max - y_min) / cell_m)))
    cells = ((path[:, :, :2].reshape(-1, 2) - (x_min, y_min)) / cell_m).astype(int)
    visited = np.zeros(shape, dtype=bool)
    visited[tuple(np.clip(cells, 0, np.array(shape) - 1).T)] = True
    centers = np.argwhere(np.ones(shape)) * cell_m + (x_min + 0.5 * cell_m, y_min + 0.5 * cell_m)
    can_stand = measure_clearance(centers, arena).reshape(shape) > 0.10
    return visited[can_stand].mean()
