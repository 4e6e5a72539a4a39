"""Program calibrate: servo centres, velocity gains and infrared constants of all robots at once; and their restoring.

rosrun hero_calibration calibrate                       all three, with questions
rosrun hero_calibration calibrate motors velocity --yes  without
rosrun hero_calibration calibrate restore               write the files into the robots again
"""

import argparse
import importlib.util
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Dict, List, Optional, Sequence

import rospy

from hero_client import command_line
from hero_client.command_line import say
from hero_client.drivers import Drivers
from hero_client.parameters import parse_robot_ids
from hero_client.program import Program, ProgramError
from hero_msgs.msg import Robot
from hero_msgs.srv import SetIRCalibration, SetMotor, SetPID

from . import store
from .errors import CalibrationError
from .infrared import BEAMS, count_check_samples
from .probe import Probe
from .procedures import (
    EndedError,
    InfraredResult,
    MotorResult,
    Session,
    VelocityResult,
    find_obstacle,
)

MOTORS, VELOCITY, INFRARED, RESTORE = "motors", "velocity", "infrared", "restore"
PARTS = (MOTORS, VELOCITY, INFRARED)
READY_TIMEOUT_S = 10.0
SCANS_TO_LOOK = 5

ROOM = "Place the robots on the floor with 20 cm of room around each: they will turn on the spot."
WALL = (
    "Place each robot with its front straight before a flat white wall, 10 cm between wall and body, 40 cm between "
    "robots: they will turn on the spot, twice."
)
NOBODY = "nobody is there to answer: start it in a terminal, or with --yes"


class Calibration:
    """One run of the program over all robots."""

    def __init__(self, options: argparse.Namespace, program: Program) -> None:
        """Begin with no results."""
        self._options = options
        self._program = program
        self._motors: Dict[int, MotorResult] = {}
        self._velocity: Dict[int, VelocityResult] = {}
        self._infrared: Dict[int, InfraredResult] = {}
        self._files: Dict[int, List[str]] = {}
        self._session = Session(program, [], say)

    def run(self) -> int:
        """Measure, write, draw, tell; return the exit code. Raises: CalibrationError."""
        try:
            os.makedirs(self._options.folder, exist_ok=True)
        except OSError as error:
            raise CalibrationError(
                "%s cannot be made: %s" % (self._options.folder, error.strerror)
            ) from error
        robots = find_robots(self._program, self._options.robots)
        self._session = Session(self._program, [Probe(robot_id) for robot_id in robots], say)
        for probe in self._session.probes:
            if robots[probe.robot_id] is not None:
                probe.failure = robots[probe.robot_id]
        ended = False
        try:
            self._wait_until_heard()
            self._measure()
        except EndedError:
            ended = True
        finally:
            self._session.stop()
            # Robots hold what was measured before the end, whatever that was: the files do, too.
            for probe in self._session.probes:
                self._save(probe)
        say("")
        say("\n".join(self._format_table()))
        if ended:
            say("ended before all was done: robots hold what the table shows, and the rest as it was before")
            return 130
        return 1 if any(probe.failure for probe in self._session.probes) else 0

    def _wait_until_heard(self) -> None:
        deadline_s = time.monotonic() + READY_TIMEOUT_S
        while any(probe.find_silence() for probe in self._session.active) and time.monotonic() < deadline_s:
            if not self._program.sleep(0.05):
                raise EndedError
        for probe in self._session.active:
            probe.failure = probe.find_silence()

    def _measure(self) -> None:
        parts = self._options.parts
        if MOTORS in parts or VELOCITY in parts:
            self._place(ROOM, beside_wall=False)
        if MOTORS in parts and self._session.active:
            say("motors: pulses up a staircase and down again, about 40 s")
            self._motors = self._session.calibrate_motors()
        if VELOCITY in parts and self._session.active:
            say("velocity: gains are tried, about a minute")
            self._velocity = self._session.calibrate_velocity(self._motors)
        if INFRARED in parts and self._session.active:
            self._place(WALL, beside_wall=True)
            scans = self._options.samples + count_check_samples(self._options.samples)
            say("infrared: about %.0f s" % (BEAMS * (2 * 2.5 + scans / 5.0)))
            self._infrared = self._session.calibrate_infrared(self._options.samples)

    def _place(self, request: str, beside_wall: bool) -> None:
        """Let people place the robots, and look whether they stand well; who does not takes no further part."""
        question = "Enter when they stand, q to end: "
        if not self._options.yes:
            say("")
            say(request)
        while True:
            answer = "" if self._options.yes else ask(self._program, question)
            if answer == "q":
                raise EndedError
            wrong = self._find_wrong(beside_wall)
            for probe, reason in wrong.items():
                say("%s: %s" % (probe.name, reason))
            if self._options.yes or answer == "s" or not wrong:
                break
            question = "Enter to look again when that is mended, s to go on without these, q to end: "
        for probe, reason in wrong.items():
            probe.failure = "place: " + reason

    def _find_wrong(self, beside_wall: bool) -> Dict[Probe, str]:
        probes = self._session.active
        for probe in probes:
            probe.forget_scans()
        deadline_s = time.monotonic() + READY_TIMEOUT_S
        while any(probe.count_scans() < SCANS_TO_LOOK for probe in probes) and time.monotonic() < deadline_s:
            if not self._program.sleep(0.05):
                raise EndedError
        found = {probe: probe.find_silence() or find_obstacle(probe, beside_wall) for probe in probes}
        return {probe: reason for probe, reason in found.items() if reason is not None}

    def _save(self, probe: Probe) -> None:
        motors = self._motors.get(probe.robot_id)
        velocity = self._velocity.get(probe.robot_id)
        ranges = self._infrared.get(probe.robot_id)
        if motors is None and velocity is None and ranges is None:
            return
        results: Dict[str, object] = {}
        if motors is not None:
            results["dead_zones_us"] = [[round(zone.low_us), round(zone.high_us)] for zone in motors.zones]
        if velocity is not None:
            results["velocity_error_before"] = round(VelocityResult.mean_error(velocity.before), 3)
            results["velocity_error_after"] = round(VelocityResult.mean_error(velocity.after), 3)
        if ranges is not None:
            results["range_error_before_m"] = [round(float(error), 4) for error in ranges.before_m]
            results["range_error_after_m"] = [round(float(error), 4) for error in ranges.after_m]
        path = store.name_file(self._options.folder, probe.robot_id)
        try:
            damaged = store.save(
                path,
                store.Calibration(
                    probe.robot_id,
                    time.strftime("%Y-%m-%d %H:%M:%S"),
                    None if motors is None else motors.centres_us,
                    None if velocity is None else velocity.gains,
                    None if ranges is None else [round(value, 5) for value in ranges.counts_m2],
                    results,
                ),
            )
            self._files[probe.robot_id] = [path]
            if damaged is not None:
                say("%s: the file that was there is damaged, and kept as %s" % (probe.name, damaged))
            self._draw(probe, motors, velocity, ranges)
        except CalibrationError as error:
            probe.failure = probe.failure or str(error)

    def _draw(
        self,
        probe: Probe,
        motors: Optional[MotorResult],
        velocity: Optional[VelocityResult],
        ranges: Optional[InfraredResult],
    ) -> None:
        if importlib.util.find_spec("matplotlib") is None:
            return
        import matplotlib

        matplotlib.use("Agg")  # no display is needed, and none is opened
        from .figures import draw_robot

        path = os.path.splitext(store.name_file(self._options.folder, probe.robot_id))[0] + ".png"
        try:
            draw_robot(probe.name, motors, velocity, ranges).savefig(path, dpi=120)
        except OSError as error:
            raise CalibrationError("%s cannot be written: %s" % (path, error.strerror)) from error
        self._files[probe.robot_id].append(path)

    def _format_table(self) -> List[str]:
        lines = []
        for probe in self._session.probes:
            lines.append("%s: %s" % (probe.name, "FAILED: " + probe.failure if probe.failure else "ok"))
            motors = self._motors.get(probe.robot_id)
            if motors is not None:
                lines.append("  motors    centres %d and %d us" % tuple(motors.centres_us))
            velocity = self._velocity.get(probe.robot_id)
            if velocity is not None:
                reached = [
                    sum(response.reached_s for response in responses) / 2.0
                    for responses in (velocity.before, velocity.after)
                ]
                lines.append(
                    "  velocity  off by %.0f %% before, %.0f %% after; 90 %% reached in %.2f s before, %.2f s after"
                    % (
                        100.0 * VelocityResult.mean_error(velocity.before),
                        100.0 * VelocityResult.mean_error(velocity.after),
                        *reached,
                    )
                )
            ranges = self._infrared.get(probe.robot_id)
            if ranges is not None:
                lines.append(
                    "  infrared  ranges at 10 cm off by up to %s before, %s after"
                    % (format_worst(ranges.before_m), format_worst(ranges.after_m))
                )
            lines += ["  " + path for path in self._files.get(probe.robot_id, [])]
        return lines


def format_worst(errors_m: Sequence[float]) -> str:
    """Return the largest error in words."""
    known = [abs(error) for error in errors_m if error == error]
    return "%.0f mm" % (1e3 * max(known)) if len(known) == len(errors_m) else "not known (no calibration)"


def ask(program: Program, question: str) -> str:
    """Ask people; return the answer in small letters.

    Raises: EndedError if the program is to end meanwhile, CalibrationError where nobody can answer.
    """
    if sys.stdin is None:
        raise CalibrationError(NOBODY)
    say(question, end="")
    # input() would wait on, deaf to Ctrl-C: signals only set a flag here.
    while not program.wait_readable([sys.stdin.fileno()], 1.0):
        if not program.running:
            say("")
            raise EndedError
    try:
        answer = sys.stdin.readline()
    except UnicodeDecodeError:
        return ""  # a key that is no letter, as Enter
    if not answer:
        raise CalibrationError(NOBODY)
    return answer.strip().lower()


def find_robots(program: Program, robot_ids: Optional[Sequence[int]]) -> Dict[int, Optional[str]]:
    """Return for each robot why it cannot be calibrated, None if it can; robot_ids None: all that are ready.

    Raises: CalibrationError without a driver, without a robot, or while all robots are stopped.
    """
    report = None
    deadline_s = time.monotonic() + READY_TIMEOUT_S
    found: Dict[int, Robot] = {}
    drivers = Drivers()
    try:
        while time.monotonic() < deadline_s:
            if not program.sleep(0.05):
                raise CalibrationError("ended before a robot was found")
            report = drivers.read()
            found = {robot.id: robot for robot in report.robots if robot.id >= 0} if report else {}
            ready = {robot_id for robot_id, robot in found.items() if robot.state == Robot.READY}
            if ready and (drivers.is_settled if robot_ids is None else set(robot_ids) <= ready):
                break
    finally:
        drivers.close()
    if report is None:
        raise CalibrationError(
            "no driver: nothing on /hero_driver/robots; start roslaunch hero_bringup hero_bringup.launch"
        )
    wanted = sorted(found if robot_ids is None else robot_ids)
    for driver in sorted({drivers.find("/hero_%d" % robot_id) for robot_id in wanted}):
        if drivers.is_stopped(driver):
            raise CalibrationError(
                "all robots are stopped; release them: rosservice call %s/stop false" % driver
            )
    robots: Dict[int, Optional[str]] = {}
    for robot_id in wanted:
        state = found[robot_id].state if robot_id in found else None
        if robot_ids is None and state != Robot.READY:
            continue
        robots[robot_id] = None if state == Robot.READY else "is not connected to the driver: is it on?"
    if not any(reason is None for reason in robots.values()):
        raise CalibrationError("no robot is ready: are they on, and connected to the driver?")
    return robots


def restore(options: argparse.Namespace, program: Program) -> int:
    """Write files into their robots; return the exit code. Raises: CalibrationError for a file that is wrong."""
    paths = options.files or sorted(
        os.path.join(options.folder, name)
        for name in (os.listdir(options.folder) if os.path.isdir(options.folder) else [])
        if name.endswith(".yaml") and store.PREVIOUS not in name and store.DAMAGED not in name
    )
    wanted = None if options.robots is None else set(options.robots)
    kept = [store.load(path) for path in paths]
    kept = [calibration for calibration in kept if wanted is None or calibration.robot_id in wanted]
    if not kept:
        raise CalibrationError("no calibration of these robots in %s" % (", ".join(paths) or options.folder))
    twice = {
        calibration.robot_id
        for calibration in kept
        if sum(c.robot_id == calibration.robot_id for c in kept) > 1
    }
    if twice:
        raise CalibrationError("more than one file is for hero_%d; name only one of them" % min(twice))
    robots = find_robots(program, [calibration.robot_id for calibration in kept])

    def write(calibration: store.Calibration) -> str:
        probe = Probe(calibration.robot_id)
        if robots[calibration.robot_id] is not None:
            return "FAILED: %s" % robots[calibration.robot_id]
        written = []
        try:
            if calibration.motor_centres_us is not None:
                probe.call("motors_parameters", SetMotor, *calibration.motor_centres_us)
                written.append("motors")
            if calibration.velocity_gains is not None:
                probe.call("velocity_controller/pid_parameters", SetPID, *calibration.velocity_gains)
                written.append("velocity")
            if calibration.infrared_counts_m2 is not None:
                probe.call("ir_calibration", SetIRCalibration, *calibration.infrared_counts_m2)
                written.append("infrared")
        except CalibrationError as error:
            return "FAILED: %s (written: %s)" % (error, ", ".join(written) or "nothing")
        return "restored %s of %s" % (", ".join(written) or "nothing", calibration.date or "an unknown day")

    with ThreadPoolExecutor(min(32, len(kept))) as pool:
        answers = list(pool.map(write, kept))
    for calibration, answer in zip(kept, answers):
        say("hero_%d: %s" % (calibration.robot_id, answer))
    return 1 if any(answer.startswith("FAILED") for answer in answers) else 0


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="calibrate", description="Calibrate robots, all at once, or restore what was measured earlier."
    )
    parser.add_argument(
        "parts",
        nargs="*",
        metavar="PART",
        help="motors, velocity, infrared (all three); or: restore [FILE ...]",
    )
    parser.add_argument("--robots", default="all", help="ids, e.g. '0 1 2' or 0-3 (all that are connected)")
    parser.add_argument("--yes", action="store_true", help="ask nothing: the robots stand as they should")
    parser.add_argument(
        "--folder", default="~/hero_calibration", help="where files and pictures are kept (%(default)s)"
    )
    parser.add_argument(
        "--samples", type=int, default=25, metavar="N", help="infrared scans for each sensor, 5 a second (25)"
    )
    options = parser.parse_args(arguments)
    options.restore = options.parts[:1] == [RESTORE]
    options.files = options.parts[1:] if options.restore else []
    options.parts = [] if options.restore else options.parts or list(PARTS)
    for part in options.parts:
        if part not in PARTS:
            parser.error("%s: parts are %s; or: restore [FILE ...]" % (part, ", ".join(PARTS)))
    if options.yes and INFRARED in options.parts and len(options.parts) > 1:
        parser.error(
            "--yes: motors and velocity need room around the robots, infrared a wall: name the one or the other"
        )
    if not 3 <= options.samples <= 150:
        parser.error("--samples %d: must be 3..150" % options.samples)
    try:
        options.robots = parse_robot_ids("robots", options.robots)
    except ProgramError as error:
        parser.error(str(error).replace("~", "--"))
    options.folder = os.path.abspath(os.path.expanduser(options.folder))
    return options


def run(arguments: Sequence[str]) -> int:
    """Do what the command line says; return the exit code. Raises: CalibrationError, ProgramError."""
    options = parse_options(arguments)
    with Program("hero_calibrate", anonymous=True) as program:
        return restore(options, program) if options.restore else Calibration(options, program).run()


def main() -> None:
    """Run the program calibrate."""
    command_line.run(lambda: run(rospy.myargv(sys.argv)[1:]), CalibrationError, ProgramError)
