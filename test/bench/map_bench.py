"""Measures how well robots reach places of the map and map an arena; CPU of the node map_arena.

The robots are stepped in process, with their default errors, and localized by the filter of localize on a model of the
camera: poses a tenth of a second late, each robot's off by a constant 1 mm and 0.3 degrees, and by noise. What counts
is their ground truth. Started by script/bench.
"""

import argparse
import math
import random
import subprocess
import time
from functools import partial
from typing import List, Tuple

import numpy as np
from measuring import print_machine, read_cpu_s
from running_suite import RunningSuite
from stepped_localization import StepLocalization

from hero_client import CommonFrame, ProgramError
from hero_client.apps.formations import assign_goals, place_formation
from hero_client.controllers import AvoidanceLaw, WanderLaw
from hero_examples.driving.random_walk import Walker
from hero_examples.swarm.explore import Explorer, explore_together
from hero_examples.swarm.swarm_go_to import STEP_HZ, Formation
from hero_localization.mapping.occupancy_grid import OccupancyGrid, SwarmMap
from hero_sim.stepped import StepSwarm
from hero_sim.world import load_arena

PARTS = ("formations", "goals", "maps", "cpu")
ROBOTS = 10
SETTLE_S = 1.0
SPACING_M = {"circle": 0.25, "grid": 0.25, "line": 0.2}
GOALS = 5
NEAR_M = 0.015
TIMES_S = (60.0, 120.0, 180.0, 300.0)
BOUNDS_M = (-1.1, -1.1, 1.1, 1.1)


def measure_formation(shape, frame, seed):
    """Return how far the robots truly are from their places in the end, mm (N,), and after what time; inf: never."""
    law = AvoidanceLaw()
    with StepSwarm(ROBOTS, seed=seed, arena="empty") as swarm:
        StepLocalization(swarm, seed=seed)
        swarm.sleep(SETTLE_S)
        goals = place_formation({"shape": shape, "spacing_m": SPACING_M[shape]}, ROBOTS, law.min_spacing_m)
        goals = [goals[index] for index in assign_goals([robot.true_pose[:2] for robot in swarm], goals)]
        formation = Formation(swarm, CommonFrame(frame), goals, law)
        took_s = math.inf
        try:
            for time_s in swarm.rate(STEP_HZ):
                formation.step(time_s)
                if formation.done:
                    took_s = time_s
                    break
        except ProgramError as error:
            print("seed %d: %s" % (seed, error))
        swarm.stop()
        swarm.sleep(SETTLE_S)
        return 1e3 * np.hypot(*(swarm.rows.world.poses[:, :2] - goals).T), took_s


def measure_goals(frame, seed):
    """Return how far ten robots, each alone in its arena, truly are from each of their goals, mm (GOALS, N)."""
    rng = random.Random(seed)
    with StepSwarm(1, seed=seed, arena="empty", worlds=ROBOTS) as swarm:
        StepLocalization(swarm, seed=seed)
        swarm.sleep(SETTLE_S)
        found = []
        for _ in range(GOALS):
            goals = [(rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6)) for _ in swarm.robots]
            motions = [robot.start_go_to(*goal, frame=frame) for robot, goal in zip(swarm.robots, goals)]
            for motion in motions:
                motion.result()
            found.append(1e3 * np.hypot(*(swarm.rows.world.poses[:, :2] - goals).T))
    return np.array(found)


def list_surface(arena):
    """Return points (K, 2), a centimeter apart, on all walls and obstacles."""
    points_m = []
    for x1_m, y1_m, x2_m, y2_m in arena.segments_m:
        share = np.linspace(0.0, 1.0, max(2, int(math.hypot(x2_m - x1_m, y2_m - y1_m) / 0.01)))[:, None]
        points_m.append((x1_m, y1_m) + share * (x2_m - x1_m, y2_m - y1_m))
    for x_m, y_m, radius_m in arena.circles_m:
        angles_rad = np.linspace(0.0, math.tau, int(math.tau * radius_m / 0.01))
        points_m.append(np.column_stack((x_m + radius_m * np.cos(angles_rad), y_m + radius_m * np.sin(angles_rad))))
    return np.vstack(points_m)


def share_near(points_m, others_m):
    """Return the share of points (K, 2) that are within NEAR_M of one of the others."""
    return float(np.mean([np.hypot(*(others_m - point_m).T).min() < NEAR_M for point_m in points_m]))


def feed_map(swarm, localization, swarm_map):
    """Put the robots' scans into a map from now on, as map_arena does; its robots go by their rows."""

    def add_poses(rows):
        for row in rows.tolist():
            estimate = localization.published[row]
            if estimate is not None:
                swarm_map.add_pose(row, estimate.stamp_s, estimate.pose)

    def add_scans(rows):
        for row in rows.tolist():
            swarm_map.add_ranges(row, swarm.rows.scan_ms.item(row) / 1e3, swarm.rows.proximity_m[row].tolist())
        swarm_map.update()

    swarm.rows.on_cycle.append(add_poses)
    swarm.rows.on_scan.append(add_scans)


def measure_map(program, seed, times_s):
    """Return shares of the wall that is mapped, and of mapped cells that are wall, after each of times_s."""
    grid, surface_m = OccupancyGrid(BOUNDS_M), list_surface(load_arena("obstacles"))
    found: List[Tuple[float, float]] = []
    with StepSwarm(ROBOTS, seed=seed, arena="obstacles") as swarm:
        feed_map(swarm, StepLocalization(swarm, seed=seed), SwarmMap(grid))
        swarm.sleep(SETTLE_S)
        explorers = [Explorer(robot, CommonFrame("map"), seed + robot.robot_id) for robot in swarm]
        walkers = [Walker(robot, WanderLaw(), seed + robot.robot_id) for robot in swarm]
        frontiers: List[Tuple[float, ...]] = []
        for step, time_s in enumerate(swarm.rate(10)):
            if time_s >= times_s[len(found)]:
                occupied_m = grid.centers_of(grid.occupied)
                found.append((share_near(surface_m, occupied_m), share_near(occupied_m, surface_m)))
                if len(found) == len(times_s):
                    break
            if program == "explore":
                frontiers = [tuple(place) for place in grid.find_frontiers()] if step % 10 == 0 else frontiers
                explore_together(explorers, frontiers, time_s)
            else:
                for walker in walkers:
                    walker.step()
    return found


def measure_cpu(robots, seconds):
    """Return the CPU of localize and map_arena, as shares of a core, for robots that walk at random."""
    with RunningSuite(robots, "arena:=obstacles", "sim_tf:=false") as suite:
        start_node = partial(suite.start_program, "hero_localization", stdout=subprocess.DEVNULL)
        localize = start_node(
            "localize", "__name:=localization", "_pose_topic:=/hero_{id}/ground_truth", "_pose_frame:=world"
        )
        map_arena = start_node("map_arena")
        suite.start_example("random_walk", "_robots:=0-%d" % (robots - 1))
        time.sleep(10.0)
        before_s = [read_cpu_s(process.pid) for process in (localize, map_arena)]
        time.sleep(seconds)
        return [(read_cpu_s(p.pid) - cpu_s) / seconds for p, cpu_s in zip((localize, map_arena), before_s)]


def report_formations(seeds):
    """Print how well robots form up by odometry and in the map."""
    for shape in SPACING_M:
        for frame in ("world", "map"):
            runs = [measure_formation(shape, frame, seed) for seed in seeds]
            worst_mm = np.array([off_mm.max() for off_mm, _ in runs])
            times_s = [took_s for _, took_s in runs]
            print("%s in %s: all within 10 mm in %d of %d seeds" % (shape, frame, (worst_mm < 10.0).sum(), len(seeds)))
            print(f"  median {np.median([off_mm for off_mm, _ in runs]):.1f} mm, worst {worst_mm.max():.1f} mm")
            print(f"  in place after {min(times_s):.0f} to {max(times_s):.0f} s")


def report_goals(seeds):
    """Print how well robots reach one goal after the other by odometry and in the map."""
    for frame in ("world", "map"):
        runs = np.array([measure_goals(frame, seed) for seed in seeds])
        for number in (1, GOALS):
            off_mm = runs[:, number - 1]
            print("goal %d in %s: median %.1f mm, worst %.1f mm" % (number, frame, np.median(off_mm), off_mm.max()))


def report_maps(seeds):
    """Print how much of the obstacles arena is mapped by when."""
    for program in ("explore", "random_walk"):
        runs = np.array([measure_map(program, seed, TIMES_S) for seed in seeds])
        for time_s, (walls, cells) in zip(TIMES_S, np.moveaxis(100.0 * runs, 0, -1)):
            print(f"map by {program} after {time_s:.0f} s, mean and worst of the seeds:")
            print(f"  {walls.mean():.1f} and {walls.min():.1f} % of the wall, ", end="")
            print(f"{cells.mean():.1f} and {cells.min():.1f} % of the cells are wall")


def main():
    """Measure what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10, help="runs of each row (%(default)s)")
    parser.add_argument("--count", type=int, default=20, help="robots whose map_arena is measured (%(default)s)")
    parser.add_argument("--seconds", type=float, default=20.0, help="for so long (%(default)s)")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS)
    options = parser.parse_args()
    seeds = range(options.seeds)
    print_machine()
    if "formations" in options.only:
        report_formations(seeds)
    if "goals" in options.only:
        report_goals(seeds)
    if "maps" in options.only:
        report_maps(seeds)
    if "cpu" in options.only:
        shares = measure_cpu(options.count, options.seconds)
        print("CPU with %d robots: localize %.1f %%, map_arena %.1f %%" % (options.count, *(100.0 * s for s in shares)))


if __name__ == "__main__":
    main()
