"""Runs a script for robots on simulated ones in its own process: `python3 -m hero_sim.in_process my_script.py`.

Needs neither ROS nor a driver. Time is the robots': it passes only while the script waits, so a script takes as long as
its computation, and gives the same each time.
"""

import argparse
import builtins
import os
import runpy
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any, Dict, Iterable, Mapping, Optional, Sequence

import yaml

import hero_client
from hero_client.values import RobotNotReadyError, Steps
from hero_node import HeroError, ProgramError, call, command_line, find_line, say
from hero_node.parameters import check_parameters

from .population import add_options
from .stepped.robot import StepRobot
from .stepped.step_clock import StepMotion
from .stepped.swarm import StepSwarm, StepWorld


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run a script with its arguments; return its exit status."""
    parser = argparse.ArgumentParser(prog="python3 -m hero_sim.in_process", description=__doc__.partition("\n")[0])
    add_options(parser)
    parser.set_defaults(count=4)
    parser.add_argument("script", help="a script that uses hero_client")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="arguments of the script")
    options = parser.parse_args(argv)
    return call(lambda: run_script(options))


def run_script(options: argparse.Namespace) -> None:
    """Run the script on its robots, and print where these are at its end."""
    if not Path(options.script).is_file():
        raise ProgramError(f"{options.script}: no such script")
    swarm = StepSwarm(options.count, options.seed, options.arena, options.wifi, options.perfect, model=options.model)
    replace_ros(swarm)
    folder = str(Path(options.script).resolve().parent)
    give_scripts_clock(swarm, folder)
    if options.seconds is not None:
        StepMotion(swarm._clock, end_at(options.seconds))
    sys.argv = [options.script, *options.arguments]
    sys.path.insert(0, folder)
    try:
        runpy.run_path(options.script, run_name="__main__")
    except HeroError as error:
        raise ProgramError(str(error) + find_line(error, options.script)) from None
    finally:
        places = ["%s at (%.3f, %.3f) m" % (robot.name, *robot.true_pose[:2]) for robot in swarm if robot.driven]
        say("; ".join([f"{swarm.now_s:.1f} s simulated", *places]), sys.stderr)


def end_at(duration_s: float) -> Steps:
    """End the script, as a signal would: `with` blocks stop their robots."""
    yield duration_s
    raise SystemExit(0)


def replace_ros(swarm: StepSwarm) -> None:
    """Give scripts these robots by what they import from hero_client."""

    def find_robot(robot_id: int, odom: bool = True, proximity: bool = True) -> StepRobot:
        if robot_id not in swarm._by_id:
            raise RobotNotReadyError(f"hero_{robot_id} is not there: --count {len(swarm)} simulates fewer")
        return swarm[robot_id]

    class SimulatedSwarm(StepWorld):
        """Some of the robots."""

        def __init__(self, robot_ids: Iterable[int], odom: bool = True, proximity: bool = True) -> None:
            super().__init__([find_robot(robot_id) for robot_id in robot_ids], swarm._clock)

        @staticmethod
        def discover(*arguments: Any, **options: Any) -> StepSwarm:
            """Return all robots."""
            return swarm

    class SimulatedProgram(StepWorld):
        """The frame of a program, in the robots' time."""

        running = True

        def __init__(self, name: str, anonymous: bool = False) -> None:
            super().__init__([], swarm._clock)

    def open_swarm(program: Any, robot_ids: Optional[Sequence[int]], *arguments: Any, **options: Any) -> StepWorld:
        return swarm if robot_ids is None else SimulatedSwarm(robot_ids)

    def read_parameters(declared: Mapping[str, Any]) -> Dict[str, Any]:
        words = [word[1:].partition(":=") for word in sys.argv[1:] if word.startswith("_")]
        return check_parameters(declared, {name: yaml.safe_load(value) for name, _, value in words})

    replacements = {
        "Robot": find_robot,
        "Swarm": SimulatedSwarm,
        "rate": swarm.rate,
        "start_node": lambda name="": None,
        "Program": SimulatedProgram,
        "open_swarm": open_swarm,
        "read_parameters": read_parameters,
        "run": command_line.run,
    }
    hero_client.choose_backend(replacements)


def give_scripts_clock(swarm: StepSwarm, folder: str) -> None:
    """Give the script and modules in its folder, and no others, these robots' time where they import `time`."""
    clock = ModuleType("time")
    vars(clock).update(vars(time), time=lambda: swarm.now_s, monotonic=lambda: swarm.now_s, sleep=swarm.sleep)
    import_module = builtins.__import__

    def import_for(name: str, variables: Optional[Mapping[str, Any]] = None, *arguments: Any) -> Any:
        if name == "time" and variables is not None:
            if variables.get("__name__") == "__main__" or os.path.dirname(variables.get("__file__") or "") == folder:
                return clock
        return import_module(name, variables, *arguments)

    builtins.__import__ = import_for  # type: ignore[assignment]


if __name__ == "__main__":
    sys.exit(main())
