"""Program calibrate: calibrates servos, velocity gains and infrared sensors of all robots at once, or restores them.

rosrun hero_calibration calibrate                        all three, with questions
rosrun hero_calibration calibrate motors velocity --yes  without
rosrun hero_calibration calibrate restore                write the files into the robots again
"""

import argparse
import importlib.util
import os
import sys
import time
from typing import Any, Dict, List, Sequence

import rospy

from hero_client import command_line
from hero_client.command_line import say
from hero_client.errors import ProgramError
from hero_client.parameters import robot_ids_option
from hero_client.program import Program

from . import store
from .discovery import find_robots
from .errors import CalibrationError, EndedError
from .infrared import calibrate_infrared
from .motors import MotorResult, calibrate_motors
from .placement import place_robots
from .probe import Probe
from .restore import restore
from .session import Session
from .velocity import calibrate_velocity

MOTORS, VELOCITY, INFRARED, RESTORE = "motors", "velocity", "infrared", "restore"
PARTS = (MOTORS, VELOCITY, INFRARED)


class Calibration:
    """One run of the program over all robots."""

    def __init__(self, options: argparse.Namespace, program: Program) -> None:
        """Find the robots. Raises: CalibrationError."""
        self._options = options
        try:
            os.makedirs(options.folder, exist_ok=True)
        except OSError as error:
            raise CalibrationError("%s cannot be created: %s" % (options.folder, error.strerror)) from error
        self._results: Dict[int, Dict[str, Any]] = {}
        self._files: Dict[int, List[str]] = {}
        self._session = Session(program, find_robots(program, options.robots))

    def run(self) -> int:
        """Calibrate, save, and print a table; return the exit code. Raises: CalibrationError."""
        probes = self._session.probes
        ended = False
        try:
            self._calibrate()
        except EndedError:
            ended = True
        finally:
            self._session.stop()
            # Robots hold what was measured before the end, whatever caused it: the files must, too.
            for probe in probes:
                if probe.robot_id in self._results:
                    self._save(probe)
        say("\n" + "\n".join(line for probe in probes for line in self._describe(probe)))
        if ended:
            say("ended early: robots hold what the table shows, and keep the rest")
            return 130
        return 1 if any(probe.failure for probe in probes) else 0

    def _calibrate(self) -> None:
        session, parts = self._session, self._options.parts
        motors: Dict[int, MotorResult] = {}
        if MOTORS in parts or VELOCITY in parts:
            place_robots(session, at_wall=False, ask_nothing=self._options.yes)
        if MOTORS in parts and session.active:
            motors = calibrate_motors(session)
            self._store(MOTORS, motors)
        if VELOCITY in parts and session.active:
            self._store(VELOCITY, calibrate_velocity(session, motors))
        if INFRARED in parts and session.active:
            place_robots(session, at_wall=True, ask_nothing=self._options.yes)
            self._store(INFRARED, calibrate_infrared(session))

    def _store(self, part: str, results: Dict[int, Any]) -> None:
        for robot_id, result in results.items():
            self._results.setdefault(robot_id, {})[part] = result

    def _save(self, probe: Probe) -> None:
        results = self._results[probe.robot_id].values()
        path = store.name_file(self._options.folder, probe.robot_id)
        picture = os.path.splitext(path)[0] + ".png"
        values = {key: numbers for result in results for key, numbers in result.to_file().items()}
        date = time.strftime("%Y-%m-%d %H:%M:%S")
        try:
            store.save(path, store.Calibration(probe.robot_id, date, values))
            self._files[probe.robot_id] = [path]
            if importlib.util.find_spec("matplotlib") is not None:
                from .figures import draw_robot

                draw_robot(probe.name, list(results)).savefig(picture, dpi=120)
                self._files[probe.robot_id].append(picture)
        except CalibrationError as error:
            probe.failure = probe.failure or str(error)
        except OSError as error:
            probe.failure = probe.failure or "%s cannot be written: %s" % (picture, error.strerror)

    def _describe(self, probe: Probe) -> List[str]:
        """Return the lines of a robot in the final table."""
        return [
            "%s: %s" % (probe.name, "FAILED: " + probe.failure if probe.failure else "ok"),
            *("  %-9s %s" % (part, r.describe()) for part, r in self._results.get(probe.robot_id, {}).items()),
            *("  " + path for path in self._files.get(probe.robot_id, [])),
        ]


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="calibrate", description="Calibrate robots, all at once, or restore earlier calibrations."
    )
    parts_help = "motors, velocity, infrared (all three); or: restore [FILE ...]"
    parser.add_argument("parts", nargs="*", metavar="PART", help=parts_help)
    robots_help = "ids, e.g. '0 1 2' or 0-3 (all that are connected)"
    parser.add_argument("--robots", type=robot_ids_option, default="all", help=robots_help)
    parser.add_argument("--yes", action="store_true", help="ask nothing: the robots are placed already")
    parser.add_argument("--folder", default="~/hero_calibration", help="of files and pictures (%(default)s)")
    options = parser.parse_args(arguments)
    options.restore = options.parts[:1] == [RESTORE]
    options.files = options.parts[1:] if options.restore else []
    options.parts = [] if options.restore else options.parts or list(PARTS)
    for part in options.parts:
        if part not in PARTS:
            parser.error("%s: parts are %s; or: restore [FILE ...]" % (part, ", ".join(PARTS)))
    if options.yes and INFRARED in options.parts and len(options.parts) > 1:
        parser.error("--yes: motors and velocity need room around the robots, infrared a wall: name one or the other")
    options.folder = os.path.abspath(os.path.expanduser(options.folder))
    return options


def run(arguments: Sequence[str]) -> int:
    """Run with the arguments of the command line; return the exit code. Raises: CalibrationError, ProgramError."""
    options = parse_options(arguments)
    with Program("hero_calibrate", anonymous=True) as program:
        if options.restore:
            return restore(program, options.folder, options.files, options.robots)
        return Calibration(options, program).run()


def main() -> None:
    """Run the program calibrate."""
    command_line.run(lambda: run(rospy.myargv(sys.argv)[1:]), CalibrationError, ProgramError)
