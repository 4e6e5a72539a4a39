"""Runs an experiment on robots: each trial from its start places, watched, recorded, and written into runs.csv."""

import math
import os
import subprocess
import sys
from contextlib import contextmanager
from typing import Iterator, Sequence

import numpy as np
import rospy

from hero_client import GoalError, Program, StoppedError, Swarm

from ..experiments.batch import place_cell
from ..experiments.errors import ExperimentError
from ..experiments.experiment_file import Experiment
from ..experiments.results_folder import REAL, ResultsFolder, Run
from ..experiments.robot_trial import RobotTrial
from ..safety import ROBOTS, SafetyFilter
from .pose_source import ObjectSource, PoseSource

__all__ = ["run_on_robots"]

POSES_TOPIC = "/localization/poses"
OBJECT_RADIUS_M = 0.05
RECORD_START_S = 2.0
"""Until the recorder has subscribed."""


def run_on_robots(experiment: Experiment, folder: ResultsFolder, ids: Sequence[int], frame: str) -> str:
    """Run the trials that are missing on the robots ids, one after the other; return a line for people.

    frame: of the start places and of the poses, those of localize, or world for the simulator's ground truth.

    Raises: ExperimentError for a cell with another number of robots.
    """
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
            if not _drive_to_starts(program, swarm, starts, frame, label) or not _confirm(program, label):
                break
            trial = RobotTrial(experiment, cell, seed, [robot.name for robot in swarm], SafetyFilter(ROBOTS))
            with _record(program, folder.path, "cell_%d_seed_%d" % (cell_index + 1, seed), ids):
                finished = _drive(program, swarm, trial, source, objects)
            if not finished:
                break
            folder.write_batch([Run(cell_index, seed, trial.list_values(), REAL, trial.remark)])
            folder.write_table(folder.read_runs())
            print("%s: %s" % (label, trial.remark or "done"))
            done += 1
    return "%s: %d of %d trials that were missing" % (os.path.join(folder.path, "runs.csv"), done, len(missing))


def _drive_to_starts(program: Program, swarm: Swarm, starts: np.ndarray, frame: str, label: str) -> bool:
    """Drive all robots to their places, and turn them; return whether the program is to continue."""
    print("%s: driving to the start" % label)
    places = {robot.robot_id: (x_m, y_m) for robot, (x_m, y_m, _) in zip(swarm, starts.tolist())}
    try:
        swarm.go_to_each(places, frame=frame)
        turns = []
        for robot, yaw_rad in zip(swarm, starts[:, 2].tolist()):
            angle_rad = math.remainder(yaw_rad - robot.pose_in(frame).yaw_rad, 2.0 * math.pi)
            turns.append(robot.start_motion(robot.turn_steps(angle_rad, 1.5)))
        for turn in turns:
            turn.result()
    except GoalError as error:
        print("%s: %s; place them by hand" % (label, error), file=sys.stderr)
    return program.running


def _confirm(program: Program, label: str) -> bool:
    """Ask the operator; return whether to start."""
    print("%s: Enter starts, q ends" % label)
    while program.running:
        if program.wait_readable([sys.stdin.fileno()], 1.0):
            answer = sys.stdin.readline()
            return bool(answer) and answer.strip().lower() != "q"
    return False


@contextmanager
def _record(program: Program, path: str, name: str, ids: Sequence[int]) -> Iterator[None]:
    """Record a bag in the folder bags of the results meanwhile."""
    command = ["rosrun", "hero_recording", "record", "--folder", os.path.join(path, "bags"), "--name", name]
    recorder = subprocess.Popen([*command, "--robots", " ".join(map(str, ids))], stdin=subprocess.DEVNULL)
    program.sleep(RECORD_START_S)
    try:
        yield
    finally:
        recorder.terminate()
        recorder.wait()


def _drive(
    program: Program, swarm: Swarm, trial: RobotTrial, source: PoseSource, objects: ObjectSource
) -> bool:
    """Run one trial; return whether it has ended by itself, by a stop or a loss."""
    start_s = rospy.get_time()
    try:
        for _ in program.rate(1.0 / trial.period_s):
            poses, ages_s = source.read()
            speeds = trial.step(rospy.get_time() - start_s, poses, ages_s, objects.read())
            if speeds is None:
                return True
            for robot, linear_m_s, angular_rad_s in zip(swarm, *map(np.ndarray.tolist, speeds)):
                robot.check_not_stopped()
                if robot.missing():
                    trial.remark = "%s: %s" % (robot.name, robot.missing())
                    return True
                robot.drive(linear_m_s, angular_rad_s)
    except StoppedError as error:
        trial.remark = "stopped: %s" % error
        return True
    finally:
        swarm.stop()
    return False
