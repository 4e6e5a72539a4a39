"""Runs an experiment on robots: each trial from its start places, watched, recorded, and written into runs.csv."""

import argparse
import glob
import math
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import Iterator, Sequence

import numpy as np
import rospy

from hero_client import GoalError, Program, StoppedError, Swarm
from hero_node.processes import end_process

from ..experiments.batch import place_cell
from ..experiments.errors import ExperimentError
from ..experiments.experiment_file import Experiment
from ..experiments.results_folder import REAL, ResultsFolder, Run
from ..experiments.robot_trial import RobotTrial
from ..safety import ROBOTS, SafetyFilter
from .pose_source import ObjectSource, PoseSource
from .wheel_commands import WheelCommands

__all__ = ["run_on_robots"]

POSES_TOPIC = "/localization/poses"
OBJECT_RADIUS_M = 0.05
RECORD_START_S = 20.0
"""The recorder has opened its first file by then."""
RECORD_END_S = 15.0
START_TURN_RAD_S = 1.5


def run_on_robots(experiment: Experiment, folder: ResultsFolder, options: argparse.Namespace) -> str:
    """Run the trials that are missing on robots, one after the other; return a line for people.

    options: robots; frame of the start places and of the poses, that of localize, or world for the simulator's ground
    truth; calibration, the folder of `calibrate`.
    Raises: ExperimentError for a cell with another number of robots, and if nothing can be recorded.
    """
    ids, frame = options.robots, options.frame
    for cell in experiment.cells:
        if cell.settings["robots"] != len(ids):
            text = "--robots names %d robots, but %s has %d: give each number an experiment of its own"
            raise ExperimentError(text % (len(ids), cell.label, cell.settings["robots"]))
    missing = folder.list_missing(folder.read_runs(), REAL)
    done = 0
    with Program("experiment") as program, Swarm(ids) as swarm:
        source = PoseSource(ids, frame, POSES_TOPIC)
        objects = ObjectSource(frame, "", OBJECT_RADIUS_M, are_needed=False)
        for cell_index, seed in missing:
            cell = experiment.cells[cell_index]
            starts = place_cell(experiment, cell, seed)
            label = "%s, seed %d" % (cell.label, seed)
            if not _drive_to_starts(program, swarm, starts, frame, label):
                break
            if not _confirm(program, swarm, starts, source, label):
                break
            trial = RobotTrial(experiment, cell, seed, [robot.name for robot in swarm], SafetyFilter(ROBOTS))
            commands = WheelCommands(swarm, trial.drive, options.calibration)
            name = "cell_%d_seed_%d" % (cell_index + 1, seed)
            with _record(program, folder.path, name, ids, experiment.time_s):
                finished = _drive(program, swarm, trial, commands, source, objects)
            if not finished:
                break
            folder.write_batch([Run(cell_index, seed, trial.list_values(), REAL, trial.remark)])
            folder.write_table(folder.read_runs())
            print("%s: %s" % (label, "does not count: " + trial.remark if trial.remark else "done"))
            done += not trial.remark
    again = "; start it again for the others" if done < len(missing) else ""
    return "%s: %d of %d missing trials done%s" % (os.path.join(folder.path, "runs.csv"), done, len(missing), again)


def _drive_to_starts(program: Program, swarm: Swarm, starts: np.ndarray, frame: str, label: str) -> bool:
    """Drive all robots to their places, and turn them; return whether the program is to continue."""
    print("%s: driving to the start" % label)
    places = {robot.robot_id: (x_m, y_m) for robot, (x_m, y_m, _) in zip(swarm, starts.tolist())}
    try:
        swarm.go_to_each(places, frame=frame)
        turns = []
        for robot, yaw_rad in zip(swarm, starts[:, 2].tolist()):
            angle_rad = math.remainder(yaw_rad - robot.pose_in(frame).yaw_rad, 2.0 * math.pi)
            turns.append(robot.start_motion(robot.turn_steps(angle_rad, START_TURN_RAD_S)))
        for turn in turns:
            turn.result()
    except GoalError as error:
        print("%s: %s; place them by hand" % (label, error), file=sys.stderr)
    return program.running


def _confirm(program: Program, swarm: Swarm, starts: np.ndarray, source: PoseSource, label: str) -> bool:
    """Say how far robots are from their places, and ask the operator; return whether to start."""
    offsets_m = np.nan_to_num(np.hypot(*(source.read()[0] - starts)[:, :2].T), nan=np.inf)
    farthest = swarm.robots[int(offsets_m.argmax())].name
    offset_mm = 1e3 * float(offsets_m.max())
    where = "is farthest from its place, %.0f mm" % offset_mm if math.isfinite(offset_mm) else "has no pose"
    print("%s: %s %s; Enter starts, q ends" % (label, farthest, where))
    while program.running:
        if program.wait_readable([sys.stdin.fileno()], 1.0):
            answer = sys.stdin.readline()
            return bool(answer) and answer.strip().lower() != "q"
    return False


@contextmanager
def _record(program: Program, path: str, name: str, ids: Sequence[int], time_s: float) -> Iterator[None]:
    """Record a bag in the folder bags of the results meanwhile. Raises: ExperimentError if the recorder does not."""
    bags = os.path.join(path, "bags")
    pattern = os.path.join(glob.escape(bags), name + "_*")
    before = set(glob.glob(pattern))
    command = ["rosrun", "hero_recording", "record", "--folder", bags, "--name", name]
    command += ["--robots", " ".join(map(str, ids))]
    # Should this program be killed, the recorder ends by itself.
    command += ["--seconds", "%g" % (time_s + RECORD_START_S)]
    recorder = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    try:
        end_s = time.monotonic() + RECORD_START_S
        while program.sleep(0.1) and set(glob.glob(pattern)) == before:
            if recorder.poll() is not None or time.monotonic() > end_s:
                raise ExperimentError("%s: the trial is not recorded; is hero_recording installed?" % name)
        yield
    finally:
        end_process(recorder, RECORD_END_S)


def _drive(
    program: Program,
    swarm: Swarm,
    trial: RobotTrial,
    commands: WheelCommands,
    source: PoseSource,
    objects: ObjectSource,
) -> bool:
    """Run one trial; return whether it has ended by itself, by a stop or a loss."""
    start_s = rospy.get_time()
    all_may_move = np.ones(len(swarm), dtype=bool)
    try:
        for _ in program.rate(1.0 / trial.period_s):
            for robot in swarm:
                robot.check_not_stopped()
                reason = robot.missing()
                if reason:
                    trial.remark = "lost %s at %.1f s: %s" % (robot.name, rospy.get_time() - start_s, reason)
                    return True
            poses, ages_s = source.read()
            speeds = trial.step(rospy.get_time() - start_s, poses, ages_s, objects.read())
            if speeds is None:
                return True
            commands.send(*speeds, all_may_move)
    except StoppedError:
        trial.remark = "stopped at %.1f s" % (rospy.get_time() - start_s)
        return True
    finally:
        swarm.stop()
    return False
