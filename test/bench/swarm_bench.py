"""Quality and cost of swarm behaviors on stepped robots with default errors. Run it with script/bench swarm.

aggregation: 100 robots scattered over 4.64 m (2 % cover) without walls, poses 50 ms old, 300 s. evolved: the behaviors
of binary_family, 20 robots (wall following: 9) in 1.71 m x 1.42 m, 200 s, medians of the last 60 s. filter: of 12
robots at random in a fence of 2 m x 2 m for 30 s, and of ten that cross a circle of 1.2 m; which touch, and the time.
speed: CPU seconds of 20 milling robots in 100 worlds for 120 s, and of one step of the filter for 100 dense robots.
"""

import argparse
import time
from typing import Any, Dict, Optional, Sequence, Tuple

import numpy as np
from measuring import measure_machine_us, print_machine

from hero_client.controllers import steer
from hero_client.values import BODY_RADIUS_M
from hero_sim.world.arena import build_rectangle
from hero_swarm import Behavior
from hero_swarm.behavior import Command, Random, Sensed
from hero_swarm.behaviors import find_behavior
from hero_swarm.metrics import METRICS, cluster_fraction, dispersion_ratio, time_until
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.safety import OFF, ROBOTS, SafetyFilter
from hero_swarm.trial import OPEN, Trial

PARTS = ("aggregation", "evolved", "filter", "speed")

_ARENA = build_rectangle(1.71, 1.42, 1)
_EVOLVED = ("evolved_aggregation", "cyclic_pursuit", "dispersal", "milling", "wall_following")
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
    print(f"  time until it is below 1.15: {describe(time_until(np.array(times_s), np.array(ratios), 1.15))} s")
    print(f"  deepest overlap: {1000.0 * overlap_m:.2f} mm")


def measure_evolved(name: str, seeds: Sequence[int], drive: Optional[str]) -> None:
    """Print the metric of one behavior over the last 60 of 200 s."""
    options: Dict[str, Any] = {} if drive is None else {"drive": drive}
    trial = Trial(find_behavior(name)(**options), _ARENA, 9 if name == "wall_following" else 20, seeds)
    values = []
    for time_s, poses in trial.run(200.0):
        if time_s < 140.0:
            continue
        if name == "wall_following":
            gaps_m = np.minimum(1.71 / 2.0 - np.abs(poses[..., 0]), 1.42 / 2.0 - np.abs(poses[..., 1]))
            values.append((gaps_m < 0.1).mean(axis=1))
        else:
            values.append(METRICS[trial.behavior.metric](poses, trial.velocities))
    # Near a wall counts over time; others by their median, which a moment does not decide.
    found = np.mean(values, axis=0) if name == "wall_following" else np.median(values, axis=0)
    print(f"{name}, {trial.behavior.drive}: {describe(found)}")


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
    trial = Trial(find_behavior("milling")(), _ARENA, 20, range(worlds))
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
    print_machine(measure_machine_us())
    if "aggregation" in options.only:
        measure_aggregation(seeds, options.drive, options.robots)
    for name in _EVOLVED if "evolved" in options.only else ():
        measure_evolved(name, seeds, options.drive)
    if "filter" in options.only:
        measure_filter(range(10 * options.seeds))
    if "speed" in options.only:
        measure_speed(10 * options.seeds)


if __name__ == "__main__":
    main()
