"""Quality and cost of swarm behaviors on stepped robots with default errors. Run it with script/bench swarm.

aggregation: 100 robots scattered over 4.64 m (2 % cover) without walls, poses 50 ms old, 300 s. genomes: published ones
in 1.71 m x 1.42 m, with friction and without. behaviors: all built-in ones as their unit tests, some for longer.
chance: random genomes. filter: of 12 robots at random in a fence of 2 m x 2 m for 30 s, and of ten that cross a circle
of 1.2 m; which touch, and the time. speed: CPU seconds of 20 milling robots in 100 worlds for 120 s, and of one step of
the filter for 100 dense robots.
"""

import argparse
import importlib
import sys
import time
from pathlib import Path
from typing import Any, Dict, Optional, Sequence, Tuple

import numpy as np
from measuring import print_machine

from hero_client.controllers import steer
from hero_client.values import BODY_RADIUS_M
from hero_sim.world.arena import build_rectangle
from hero_swarm import Behavior
from hero_swarm.behavior import PULSES, VELOCITY, Command, Random, Sensed
from hero_swarm.behaviors import find_behavior
from hero_swarm.behaviors.binary_family import WheelGenome
from hero_swarm.metrics import CHANCE, METRICS, cluster_fraction, dispersion_ratio
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.safety import OFF, ROBOTS, SafetyFilter
from hero_swarm.trial import OPEN, Trial

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "options/hero_swarm/test/unit"))
cases: Any = importlib.import_module("test_behaviors")

PARTS = ("aggregation", "genomes", "behaviors", "chance", "filter", "speed")

_ARENA = build_rectangle(1.71, 1.42, 1)
_GENOMES: Dict[str, Tuple[Tuple[float, ...], int, str, str]] = {
    "aggregation": ((-0.7, -1.0, 1.0, -1.0), 20, "cluster_fraction", PULSES),
    "cyclic pursuit": ((-0.7, 0.3, 1.0, 1.0), 20, "rotation", PULSES),
    "dispersal": ((0.2, 0.7, -0.5, -0.1), 20, "nearest_neighbor", PULSES),
    "milling": ((0.8, 1.0, 0.5, 0.6), 20, "rotation", PULSES),
    "wall following": ((1.0, 0.95, 1.0, 1.0), 9, "wall_following", VELOCITY),
}
_LONGER_S = {"cyclic_pursuit": 120, "majority": 300, "milling": 120, "object_clustering": 120, "wall_following": 120}
"""Times of behaviors that their unit tests watch for less long."""

_TOUCH_M = 2.0 * BODY_RADIUS_M + 1e-4
_RING_M = 0.6


class _RandomWalk(Behavior):
    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        turn_rad_s = random.normal() if memory is None else 0.95 * memory + 0.4 * random.normal()
        return np.full(len(turn_rad_s), 0.12), turn_rad_s, turn_rad_s


class _CrossRing(Behavior):
    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        x_m, y_m, yaw_rad = sensed.poses.T
        angle_rad = 2.0 * np.pi * sensed.numbers / sensed.count + np.pi
        to_x_m, to_y_m = _RING_M * np.cos(angle_rad) - x_m, _RING_M * np.sin(angle_rad) - y_m
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        forward_m_s, left_m_s = 0.5 * (cosine * to_x_m + sine * to_y_m), 0.5 * (cosine * to_y_m - sine * to_x_m)
        return (*steer(forward_m_s, left_m_s, 0.1), memory)


def describe(values: np.ndarray) -> str:
    """Return least, median and greatest of values."""
    return f"{np.min(values):.2f} to {np.max(values):.2f}, median {np.median(values):.2f}"


def measure_aggregation(seeds: Sequence[int], drive: Optional[str], robots: int) -> None:
    """Print how Gauci's aggregation goes, seed by seed, and its deepest overlap."""
    options: Dict[str, Any] = {} if drive is None else {"drive": drive}
    side_m = np.sqrt(robots * np.pi * BODY_RADIUS_M**2 / 0.02)
    trial = Trial(find_behavior("aggregation")(**options), OPEN, robots, seeds, (side_m, side_m), delay_s=0.05)
    times_s, ratios, clusters, overlap_m = [], [], np.zeros(len(seeds)), 0.0
    for time_s, poses in trial.run(300.5):
        times_s.append(time_s)
        ratios.append(dispersion_ratio(poses[..., :2]))
        if round(time_s) == 120:
            clusters = cluster_fraction(poses[..., :2])
        overlap_m = max(overlap_m, 2.0 * BODY_RADIUS_M - float(measure_distances(poses[..., :2]).min()))
    print("aggregation, %d robots, %s: cluster after 120 s %s" % (robots, trial.behavior.drive, describe(clusters)))
    print(f"  dispersion after 300 s, of the ideal: {describe(ratios[-1])}: {np.round(ratios[-1], 3)}")
    reached = np.array(ratios) <= 1.15
    until_s = np.where(reached.any(axis=0), np.array(times_s)[reached.argmax(axis=0)], np.inf)
    print(f"  time until it is below 1.15: {describe(until_s)} s")
    print(f"  deepest overlap: {1000.0 * overlap_m:.2f} mm")


def measure_genome(name: str, seeds: Sequence[int], drive: Optional[str], known: Sequence[str]) -> None:
    """Print the metric of one published genome over the last 60 of 200 s."""
    numbers, robots, metric, own_drive = _GENOMES[name]
    options = dict(zip(("left0", "right0", "left1", "right1"), numbers))
    trial = Trial(WheelGenome(drive=drive or own_drive, **options), _ARENA, robots, seeds, known_errors=known)
    found = np.median([measure(metric, trial) for time_s, _ in trial.run(200.0) if time_s >= 140.0], axis=0)
    print(f"{name}, {trial.behavior.drive}, {' '.join(known) or 'friction as drawn'}: {metric} {describe(found)}")


def measure(metric: str, trial: Trial) -> np.ndarray:
    """Return a metric of the present (W,)."""
    return METRICS[metric](trial.poses, trial.velocities, trial.things.poses, BODY_RADIUS_M, trial.rows.world.arena)


def measure_behavior(name: str, seeds: Sequence[int]) -> None:
    """Print in how many seeds a built-in behavior reaches the limit of its unit test, in its place and time."""
    metric, limit, is_above, robots, time_s, arena, size_m = cases.CASES[name]
    time_s = _LONGER_S.get(name, time_s)
    starts, objects = cases.place(arena, robots, seeds)
    known = ["friction=0"] if name in cases.FRICTIONLESS else ()
    behavior = cases.make(name)
    trial = Trial(behavior, arena, robots, seeds, size_m, starts=starts, objects=objects, known_errors=known)
    begin_s = max(time_s / 2, time_s - 30)
    sampled = [metric(poses, trial.velocities, trial) for now_s, poses in trial.run(time_s) if now_s >= begin_s]
    values = np.median(sampled, axis=0)
    holds = (values >= limit if is_above else values <= limit).sum()
    text = "%s, %d robots, %g s, %s: %d of %d, %s"
    print(text % (name, robots, time_s, arena.name, holds, len(seeds), describe(values)))


def measure_chance(genomes: int, robots: int) -> None:
    """Print what random genomes reach in the arena of the published ones: medians of the last 30 of 120 s."""
    names = ("left0", "right0", "left1", "right1")
    drawn = np.round(np.random.RandomState(0).uniform(-1.0, 1.0, (genomes, 4)), 2)
    behavior = WheelGenome(**{name: np.repeat(column, robots) for name, column in zip(names, drawn.T)})
    trial = Trial(behavior, _ARENA, robots, range(1000, 1000 + genomes))
    sampled = [[measure(name, trial) for name in CHANCE] for time_s, _ in trial.run(120.0) if time_s >= 90.0]
    for name, values in zip(CHANCE, np.median(sampled, axis=0)):
        text = "%d random genomes, %d robots: %s median %.2f, one in twenty %.2f or more"
        print(text % (genomes, robots, name, np.median(values), np.sort(values)[-(genomes // 20)]))


def start_ring(seeds: Sequence[int]) -> np.ndarray:
    """Return ten poses on a circle for each seed, roughly turned to its middle (W, 10, 3)."""
    starts = []
    for seed in seeds:
        random = np.random.RandomState(seed)
        angles_rad = 2.0 * np.pi * np.arange(10) / 10 + random.normal(0.0, 0.05, 10)
        turned_rad = angles_rad + np.pi + random.normal(0.0, 0.3, 10)
        starts.append(np.column_stack((_RING_M * np.cos(angles_rad), _RING_M * np.sin(angles_rad), turned_rad)))
    return np.array(starts)


def cross(seeds: Sequence[int], mode: str) -> Tuple[np.ndarray, np.ndarray]:
    """Return when all robots of each world are across, and the least distance of two."""
    trial = Trial(_CrossRing(), OPEN, 10, seeds, starts=start_ring(seeds), filter_commands=SafetyFilter(mode))
    angles_rad = 2.0 * np.pi * np.arange(10) / 10 + np.pi
    goals_m = _RING_M * np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
    across_s, nearest_m = np.full(len(seeds), np.inf), np.full(len(seeds), np.inf)
    for time_s, poses in trial.run(60.0, every_s=0.0):
        are_across = (np.hypot(*np.moveaxis(poses[..., :2] - goals_m, -1, 0)) < 0.05).all(axis=1)
        across_s = np.where(are_across, np.minimum(across_s, time_s), across_s)
        nearest_m = np.minimum(nearest_m, measure_distances(poses[..., :2]).min(axis=(1, 2)))
    return across_s, nearest_m


def walk(seeds: Sequence[int], mode: str, robots: int, side_m: float) -> Tuple[np.ndarray, float]:
    """Return the least distance of two robots after the first second in each world, and how far one left the fence."""
    fence_m = np.array((-1.0, -1.0, 1.0, 1.0)) * side_m / 2.0
    filter_commands = SafetyFilter(mode, fence_m)
    trial = Trial(_RandomWalk(), OPEN, robots, seeds, (side_m, side_m), filter_commands=filter_commands)
    nearest_m, farthest_m = np.full(len(seeds), np.inf), 0.0
    for time_s, poses in trial.run(30.0, every_s=0.0):
        if time_s >= 1.0:
            nearest_m = np.minimum(nearest_m, measure_distances(poses[..., :2]).min(axis=(1, 2)))
            farthest_m = max(farthest_m, float(np.abs(poses[..., :2]).max()))
    return nearest_m, farthest_m + BODY_RADIUS_M - side_m / 2.0


def measure_filter(seeds: Sequence[int]) -> None:
    """Print touches, fence and time with the safety filter and without."""
    for mode in (OFF, ROBOTS):
        across_s, nearest_m = cross(seeds, mode)
        text = "safety %s: across a circle %s s, %d late; %d of %d worlds touch, least gap %.1f mm"
        gap_mm = 1e3 * (nearest_m.min() - 2.0 * BODY_RADIUS_M)
        count = (nearest_m < _TOUCH_M).sum()
        print(text % (mode, describe(across_s), np.isinf(across_s).sum(), count, len(seeds), gap_mm))
        for robots, side_m in ((12, 2.0), (30, 1.5)):
            nearest_m, outside_m = walk(seeds, mode, robots, side_m)
            text = "  %d at random in %.1f m: %d of %d worlds touch, least gap %.1f mm, outside of the fence %.1f mm"
            gap_mm = 1e3 * (nearest_m.min() - 2.0 * BODY_RADIUS_M)
            print(text % (robots, side_m, (nearest_m < _TOUCH_M).sum(), len(seeds), gap_mm, max(1e3 * outside_m, 0.0)))


def measure_speed(worlds: int) -> None:
    """Print CPU seconds of many worlds, and milliseconds of a step of the filter."""
    began_s = time.process_time()
    trial = Trial(cases.make("wheel_genome"), _ARENA, 20, range(worlds))
    for _ in trial.run(120.0, every_s=10.0):
        pass
    print("%d worlds of 20 milling robots, 120 s: %.1f s of CPU" % (worlds, time.process_time() - began_s))
    random = np.random.RandomState(0)
    grid_m = 0.1 * np.array(np.meshgrid(np.arange(10), np.arange(10))).reshape(2, -1).T
    poses = np.column_stack((grid_m, random.uniform(-np.pi, np.pi, 100)))[None]
    speeds = np.full((1, 100), 0.1)
    filter_commands = SafetyFilter(ROBOTS, np.array((-1.0, -1.0, 2.0, 2.0)))
    began_s = time.process_time()
    for _ in range(200):
        filter_commands(poses, speeds, 0.0 * speeds)
    step_ms = 1e3 * (time.process_time() - began_s) / 200
    print(f"filter, 100 robots: {step_ms:.2f} ms of CPU a step, {2.0 * step_ms:.1f} % of a core at 20 Hz")


def main() -> None:
    """Measure the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--seeds", type=int, default=10, help="of behaviors; filter and speed: ten times as many")
    parser.add_argument("--robots", type=int, default=100, help="of aggregation")
    parser.add_argument("--drive", choices=("velocity", "pulses"), help="instead of each behavior's own")
    options = parser.parse_args()
    seeds = range(options.seeds)
    print_machine()
    if "aggregation" in options.only:
        measure_aggregation(seeds, options.drive, options.robots)
    for name in _GENOMES if "genomes" in options.only else ():
        for known in ((), ("friction=0",)):
            measure_genome(name, seeds, options.drive, known)
    for name in cases.CASES if "behaviors" in options.only else ():
        measure_behavior(name, seeds)
    for robots in (9, 20) if "chance" in options.only else ():
        measure_chance(100, robots)
    if "filter" in options.only:
        measure_filter(range(10 * options.seeds))
    if "speed" in options.only:
        measure_speed(10 * options.seeds)


if __name__ == "__main__":
    main()
