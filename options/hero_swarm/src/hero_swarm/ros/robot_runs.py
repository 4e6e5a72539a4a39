"""Runs an experiment on robots: each trial from its start places, watched, recorded, and written into runs.csv."""

import argparse
import glob
import math
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from typing import Iterator, Sequence, Tuple

import numpy as np
import rospy

from hero_client import Program, StoppedError, Swarm
from hero_node import end_process
from hero_node.ros import read_duration_clock_s

from ..experiments.computing import set_up
from ..experiments.errors import ExperimentError
from ..experiments.experiment_file import Experiment
from ..experiments.results_folder import REAL, ResultsFolder, Run
from ..experiments.robot_trial import PERIOD_S, RobotTrial, StartDrive
from ..safety import ROBOTS, SafetyFilter
from .own_readings import OwnReadings
from .pose_source import ObjectSource, OtherRobots, PoseSource
from .wheel_commands import WheelCommands

OBJECT_RADIUS_M = 0.05
RECORD_START_S = 20.0
"""The recorder has opened its first file by then."""
RECORD_END_S = 15.0
RAW_TOPICS = "/hero_[0-9]+/(odom_raw|laser|laser_enable)"
"""Recorded beside what every recording holds."""

START_LIMIT_S = 120.0
"""For driving to the start; then robots are placed by hand."""

START, DRIVE, END = "", "d", "q"
"""Answers of the operator."""


def run_on_robots(
    experiment: Experiment, folder: ResultsFolder, runs: Sequence[Run], options: argparse.Namespace
) -> str:
    """Run the trials that are missing on robots, one after the other; return a line for users.

    runs: those that folder holds already. options: robots; frame of the start places and of the poses, that of
    localize, or world for the simulator's ground truth; calibration, the folder of `calibrate`.
    Raises: ExperimentError for a cell with another number of robots, and if nothing can be recorded.
    """
    ids, frame = options.robots, options.frame
    for cell in experiment.cells:
        if cell.settings["robots"] != len(ids):
            text = "--robots names %d robots, but %s has %d: give each number an experiment of its own"
            raise ExperimentError(text % (len(ids), cell.label, cell.settings["robots"]))
    missing = folder.list_missing(runs, REAL)
    done = 0
    with Program("experiment") as program, Swarm(ids) as swarm:
        source = PoseSource(ids, frame)
        objects = ObjectSource(frame, OBJECT_RADIUS_M, are_needed=False)
        others = OtherRobots(ids, frame)
        for cell_index, seed in missing:
            cell = experiment.cells[cell_index]
            setup = set_up(experiment, cell)
            (starts,) = setup.place_robots([seed])
            label = "%s, seed %d" % (cell.label, seed)
            answer = DRIVE
            while answer == DRIVE:
                _drive_to_starts(program, swarm, starts, source, label)
                answer = _ask(program, swarm, starts, source, label)
            if answer == END:
                break
            safety = SafetyFilter(ROBOTS)
            safety.set_models([robot.model for robot in swarm])
            readings = OwnReadings(swarm, setup.behavior.sensors())
            trial = RobotTrial(setup, seed, [robot.name for robot in swarm], safety, readings)
            commands = WheelCommands(swarm, setup.behavior.drive, options.calibration)
            name = "cell_%d_seed_%d" % (cell_index + 1, seed)
            with _record(program, folder.path, name, ids, experiment.time_s):
                finished = _drive(program, swarm, trial, commands, (source, objects, others))
            if not finished:
                break
            folder.write_batch([Run(cell_index, seed, trial.list_values(), REAL, trial.remark)])
            folder.write_table(folder.read_runs())
            print(f"{label}: {'does not count: ' + trial.remark if trial.remark else 'done'}")
            if safety.limited_calls:
                text = "%s: in %.0f %% of the steps the behavior asked for more than robots can drive: limited"
                print(text % (label, 100.0 * safety.limited_calls / safety.calls))
            done += not trial.remark
    again = "; start it again for the others" if done < len(missing) else ""
    return "%s: %d of %d missing trials done%s" % (os.path.join(folder.path, "runs.csv"), done, len(missing), again)


def _drive_to_starts(program: Program, swarm: Swarm, starts: np.ndarray, source: PoseSource, label: str) -> None:
    """Drive all robots to their places, and turn them; the time limit and a stop end it, too."""
    print(f"{label}: driving to the start")
    drive, end_s = StartDrive(starts, swarm.max_body_radius_m), time.monotonic() + START_LIMIT_S
    try:
        for _ in program.rate(1.0 / PERIOD_S):
            if drive.done or time.monotonic() > end_s:
                return
            missing = {robot.name: robot.missing() for robot in swarm}
            swarm.report_missing(missing)
            poses, ages_s = source.read()
            poses[[missing[robot.name] is not None for robot in swarm]] = np.nan
            late = drive.lateness.take_warning() or source.describe_missing()
            if late:
                source.warn(late)
            speeds = drive.step(poses, [robot.fresh_proximity() for robot in swarm], swarm.now_s, ages_s.tolist())
            for robot, speed in zip(swarm, speeds.T.tolist()):
                robot.check_not_stopped()
                if missing[robot.name] is None:
                    robot.drive(*speed)
                    robot.warn_if_blind()
    except StoppedError:
        pass  # _ask() tells
    finally:
        swarm.stop()


def _ask(program: Program, swarm: Swarm, starts: np.ndarray, source: PoseSource, label: str) -> str:
    """Say how far robots are from their places; return START once the operator says so and all are ready, or
    DRIVE to drive there again, or END."""
    while program.running:
        offsets = _describe_offsets(swarm, starts, source)
        answer = program.ask(f"{label}: {offsets}. Enter starts, d drives there again, q ends: ")
        if answer in (DRIVE, END, None):
            return answer or END
        if answer != START:
            continue  # a stray key moves no robot
        obstacle = _find_obstacle(swarm, source)
        if not obstacle:
            return START
        print(f"{label}: cannot start: {obstacle}", file=sys.stderr)
        program.sleep(1.0)  # where answers come from a file
    return END


def _describe_offsets(swarm: Swarm, starts: np.ndarray, source: PoseSource) -> str:
    offsets = source.read()[0] - starts
    offsets_m = np.nan_to_num(np.hypot(offsets[:, 0], offsets[:, 1]), nan=np.inf)
    row = int(offsets_m.argmax())
    if math.isinf(offsets_m[row]):
        return f"{swarm.robots[row].name} has no pose"
    turns_rad = np.abs(np.remainder(offsets[:, 2] + math.pi, 2.0 * math.pi) - math.pi)
    text = "robots are up to %.0f mm (%s) and %.0f degrees (%s) from their places"
    names = swarm.robots[row].name, swarm.robots[int(turns_rad.argmax())].name
    return text % (1e3 * offsets_m[row], names[0], math.degrees(turns_rad.max()), names[1])


def _find_obstacle(swarm: Swarm, source: PoseSource) -> str:
    """Return why no trial can start; empty if it can."""
    for robot in swarm:
        try:
            robot.check_not_stopped()
        except StoppedError as error:
            return str(error)
        reason = robot.missing()
        if reason:
            return f"{robot.name}: {reason}"
    source.read()
    return source.describe_missing()


@contextmanager
def _record(program: Program, path: str, name: str, ids: Sequence[int], time_s: float) -> Iterator[None]:
    """Record a bag in the folder bags of the results meanwhile. Raises: ExperimentError if the recorder does not."""
    bags = os.path.join(path, "bags")
    pattern = os.path.join(glob.escape(bags), name + "_*")
    before = set(glob.glob(pattern))
    command = ["rosrun", "hero_recording", "record", "--folder", bags, "--name", name]
    command += ["--robots", " ".join(map(str, ids)), "--topics", RAW_TOPICS]
    # Should this program be killed, the recorder ends by itself.
    command += ["--seconds", f"{time_s + RECORD_START_S:g}"]
    recorder = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    try:
        end_s = time.monotonic() + RECORD_START_S
        while program.sleep(0.1) and set(glob.glob(pattern)) == before:
            if recorder.poll() is not None or time.monotonic() > end_s:
                raise ExperimentError(f"{name}: the trial is not recorded; is hero_recording installed?")
        yield
    finally:
        end_process(recorder, RECORD_END_S)


_Sources = Tuple[PoseSource, ObjectSource, OtherRobots]


def _drive(program: Program, swarm: Swarm, trial: RobotTrial, commands: WheelCommands, sources: _Sources) -> bool:
    """Run one trial; return whether it has ended by itself, by a stop or a loss."""
    source, objects, others = sources
    start_s = read_duration_clock_s()
    all_may_move = np.ones(len(swarm), dtype=bool)
    try:
        for _ in program.rate(trial.rate_hz):
            for robot in swarm:
                robot.check_not_stopped()
                reason = robot.missing()
                if reason:
                    trial.remark = f"lost {robot.name} at {read_duration_clock_s() - start_s:.1f} s: {reason}"
                    return True
            poses, ages_s = source.read()
            trial.safety.others_m = others.read()
            if others.describe_missing():
                source.warn(others.describe_missing())
            speeds = trial.step(read_duration_clock_s() - start_s, poses, ages_s, objects.read())
            late = trial.lateness.take_warning()
            if late:
                rospy.logwarn(late)
            if speeds is None:
                return True
            commands.send(speeds[0], speeds[1], all_may_move)
    except StoppedError:
        trial.remark = f"stopped at {read_duration_clock_s() - start_s:.1f} s"
        return True
    finally:
        swarm.stop()
    return False
