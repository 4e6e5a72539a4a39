"""Program calibrate: calibrates servos, velocity gains and infrared sensors of all robots at once, or restores them."""

import argparse
import os
import sys
from typing import Sequence

import rospy

from hero_node import say
from hero_node.files import read_calibrations
from hero_node.parameters import robot_ids_option, within
from hero_node.ros import Program

from .calibration import DEFAULT_PARTS, ENDED, INFRARED, PARTS, WHEELS, calibrate_parts
from .errors import CalibrationError, EndedError
from .robots.ros_probe import RosSession, find_robots
from .store import describe_status, find_missing, load_calibrations, restore

RESTORE, STATUS = "restore", "status"


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="calibrate", description="Calibrate robots, all at once, or restore earlier calibrations."
    )
    parts_help = "motors, velocity, infrared (all three); wheels; or: restore [FILE ...]; or: status"
    parser.add_argument("parts", nargs="*", metavar="PART", help=parts_help)
    robots_help = "ids, e.g. '0 1 2' or 0-3 (all that are connected)"
    parser.add_argument("--robots", type=robot_ids_option, default="all", help=robots_help)
    parser.add_argument("--yes", action="store_true", help="ask nothing: the robots are placed already")
    parser.add_argument("--tape", action="store_true", help="wheels: by a tape measure, without a camera")
    parser.add_argument("--missing", action="store_true", help="only robots whose files lack one of the parts")
    text = "this many robots at a time, such as fit the wall; each batch is saved before the next"
    parser.add_argument("--batch", type=within(1, 500, int), metavar="N", help=text)
    parser.add_argument("--folder", default="~/hero_calibration", help="folder of files (%(default)s)")
    options = parser.parse_args(arguments)
    options.restore = options.parts[:1] == [RESTORE]
    options.files = options.parts[1:] if options.restore else []
    options.status = options.parts == [STATUS]
    options.parts = [] if options.restore or options.status else options.parts or list(DEFAULT_PARTS)
    for part in options.parts:
        if part not in PARTS:
            parser.error(f"{part}: parts are {', '.join(PARTS)}; or: restore [FILE ...]")
    if options.yes and INFRARED in options.parts and len(options.parts) > 1:
        parser.error("--yes: motors and velocity need room around the robots, infrared a wall: name one or the other")
    if options.yes and options.batch:
        parser.error("--yes: each batch has to be placed; leave --batch or --yes out")
    if options.tape and WHEELS not in options.parts:
        parser.error("--tape is for wheels")
    options.folder = os.path.abspath(os.path.expanduser(options.folder))
    return options


def main() -> int:
    """Calibrate; return the exit code. Raises: CalibrationError, CalibrationFileError, ProgramError, OSError."""
    options = parse_options(rospy.myargv(sys.argv)[1:])
    if options.status:
        say("\n".join(describe_status(read_calibrations(options.folder))))
        return 0
    # Errors in files and folders are reported before waiting for robots.
    if options.restore:
        calibrations = load_calibrations(options.folder, options.files, options.robots)
        robot_ids = list(calibrations)
    else:
        os.makedirs(options.folder, exist_ok=True)
        robot_ids = options.robots
    with Program("hero_calibrate", anonymous=True) as program:
        probes = find_robots(program, robot_ids)
        if options.missing:
            numbers = [probe.robot_id for probe in probes]
            missing = find_missing(read_calibrations(options.folder).found, numbers, options.parts)
            probes = [probe for probe in probes if probe.robot_id in missing]
            if not probes:
                say("every robot has these parts already")
                return 0
        if options.restore:
            return restore(RosSession(program, probes), calibrations)

        def ask(question: str) -> str:
            answer = program.ask(question)
            if answer is None and program.running:
                raise CalibrationError("no terminal to answer questions: start it in a terminal, or with --yes")
            if answer is None:
                raise EndedError
            return answer

        tape = ask if options.tape else None
        placed, size, status = None if options.yes else ask, options.batch or len(probes), 0
        for first in range(0, len(probes), size):
            batch = probes[first : first + size]
            if len(batch) < len(probes):
                say("\nrobots %s of %d" % (", ".join(probe.name for probe in batch), len(probes)))
            session = RosSession(program, batch)
            status = max(status, calibrate_parts(session, options.parts, options.folder, placed, tape))
            if status == ENDED:
                break
        return status
