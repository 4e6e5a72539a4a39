"""Start poses of a run, which depend on seed and number alone. Pure but for a file."""

import math
from typing import Callable, Sequence

import numpy as np

from hero_client.values import BODY_RADIUS_M, MAX_POSITION_M, is_plausible
from hero_node import Pose, shorten
from hero_node.files import decode_text, read_file
from hero_sim.errors import OptionError
from hero_sim.world import Arena, place_robots

from ...behavior import derive_seed
from ...metrics.graphs import measure_distances
from ...trial import is_clear, scatter
from ..errors import ExperimentError
from ..experiment_file import Start

_DIAMETER_M = 2.0 * BODY_RADIUS_M

_MAX_OVERLAP_M = 0.002
"""Overlap of the bodies in a start file, which may hold where robots of a run ended: contacts leave 1.2 mm."""


def place_all(
    start: Start, arena: Arena, robots: int, seeds: Sequence[int], read: Callable[[str], bytes] = read_file
) -> np.ndarray:
    """Return poses (W, N, 3), x m, y m, yaw rad, of the robots of one world for each seed; read: how files are read.

    Raises: ExperimentError if they find no place, or for a file that cannot be used.
    """
    if start.kind == "file":
        assert start.file is not None
        return np.array([_read_poses(start.file, robots, arena, read)] * len(seeds))
    try:
        placed = {seed: _place(start, arena, robots, seed) for seed in sorted(set(seeds))}  # designs repeat seeds
        return np.array([placed[seed] for seed in seeds])
    except (OptionError, ValueError) as error:
        raise ExperimentError(f"start: {error}") from error


def _place(start: Start, arena: Arena, robots: int, seed: int) -> np.ndarray:
    if start.kind == "arena":
        return place_robots(arena, robots, np.random.RandomState(derive_seed(seed, "places")))
    if start.kind == "uniform":
        side_m = math.sqrt(robots * math.pi * BODY_RADIUS_M * BODY_RADIUS_M / start.cover)
        return scatter(robots, side_m, side_m, seed, start.gap_m, arena)
    spacing_m = _DIAMETER_M + start.gap_m
    poses = _place_in_grid(robots, spacing_m, seed) if start.kind == "grid" else _place_in_circle(robots, spacing_m)
    _check_clear(poses, arena, [f"robot {number} of the {start.kind}" for number in range(robots)])
    return poses


def _check_clear(poses: np.ndarray, arena: Arena, names: Sequence[str]) -> None:
    """Raises: ValueError for a robot in a wall, in an object, or outside of the arena."""
    for (x_m, y_m), name in zip(poses[:, :2], names):
        if not is_clear(np.array([(x_m, y_m)]), arena, _MAX_OVERLAP_M)[0]:
            text = "%s at (%.3g, %.3g) is in a wall or an object of arena %s, or outside of it"
            raise ValueError(text % (name, x_m, y_m, arena.name))


def _place_in_grid(robots: int, spacing_m: float, seed: int) -> np.ndarray:
    """Return a square of rows around the origin, headings drawn from the seed."""
    columns = math.ceil(math.sqrt(robots))
    index = np.arange(robots)
    x_m, y_m = (index % columns) * spacing_m, (index // columns) * spacing_m
    yaw_rad = math.pi * (2.0 * np.random.RandomState(derive_seed(seed, "places")).random_sample(robots) - 1.0)
    return np.column_stack((x_m - x_m.max() / 2.0, y_m - y_m.max() / 2.0, yaw_rad))


def _place_in_circle(robots: int, spacing_m: float) -> np.ndarray:
    """Return a circle around the origin, all headed counter-clockwise along it."""
    radius_m = spacing_m / 2.0 / math.sin(math.pi / max(robots, 2))
    angle_rad = 2.0 * math.pi * np.arange(robots) / robots
    yaw_rad = np.remainder(angle_rad + 1.5 * math.pi, 2.0 * math.pi) - math.pi
    return np.column_stack((radius_m * np.cos(angle_rad), radius_m * np.sin(angle_rad), yaw_rad))


def _read_poses(path: str, robots: int, arena: Arena, read: Callable[[str], bytes]) -> np.ndarray:
    """Return the first poses of a file with a line x m, y m, yaw rad for each robot. Raises: ExperimentError."""
    poses, numbers = [], []
    number = 0
    try:
        for number, line in enumerate(decode_text(read(path)).splitlines(), 1):
            if line.strip() and not line.startswith("#"):
                poses.append(_parse_pose(line))
                numbers.append(number)
    except OSError as error:
        raise ExperimentError(f"start.file {path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ExperimentError("start.file %s, line %d: %s" % (path, number, error)) from error
    if len(poses) < robots:
        raise ExperimentError("start.file %s: has %d poses for %d robots" % (path, len(poses), robots))
    starts = np.array(poses[:robots])
    apart_m = measure_distances(starts[None, :, :2])[0]
    overlapping = np.argwhere(apart_m < _DIAMETER_M - _MAX_OVERLAP_M)
    if len(overlapping):
        first, second = overlapping[0]
        text = "start.file %s: the robots of lines %d and %d overlap: %.0f mm between centers; bodies are %.0f mm wide"
        values = numbers[first], numbers[second], 1e3 * apart_m[first, second], 1e3 * _DIAMETER_M
        raise ExperimentError(text % (path, *values))
    try:
        _check_clear(starts, arena, ["the robot of line %d" % number for number in numbers])
    except ValueError as error:
        raise ExperimentError(f"start.file {path}: {error}") from error
    return starts


def _parse_pose(line: str) -> Pose:
    """Return the pose of a line. Raises: ValueError."""
    try:
        pose = Pose(*map(float, line.split(",")))
    except (TypeError, ValueError):
        pose = Pose(math.nan, math.nan, math.nan)
    if not is_plausible(pose):
        raise ValueError(f"{shorten(line.strip())} must be x m, y m, yaw rad, within {MAX_POSITION_M:g} m")
    return pose
