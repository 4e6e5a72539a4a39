"""Command line -> a running swarm. Needs Python and numpy; neither ROS nor a ROS master."""

import argparse
import importlib.util
import signal
from typing import TYPE_CHECKING, List, Optional

from . import output
from .errors import OptionError, SimulatorError
from .faults import KINDS, parse_fault

if TYPE_CHECKING:
    from .simulator import Simulator

DEFAULT_PORT = 11411
"""The port that stock robots dial."""

MOST_ROBOTS = 1000
LARGEST_ID = 2**31 - 1
"""Of hero_msgs/Robot."""

LONGEST_RUN_S = 1e9
"""Some thirty years."""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="hero_sim", description="HeRo robots without hardware, behind the same TCP socket as real ones."
    )
    parser.add_argument("--count", type=int, default=1, metavar="N", help="number of robots (1)")
    parser.add_argument("--first-id", type=int, default=0, metavar="K", help="id of the first robot (0)")
    parser.add_argument(
        "--host", default=None, help="where the driver runs (127.0.0.1); with --serve: own address"
    )
    parser.add_argument("--port", type=int, default=DEFAULT_PORT, help="port of the driver (%(default)s)")
    parser.add_argument(
        "--serve",
        type=int,
        default=None,
        metavar="PORT",
        help="do not dial: robot i is a TCP server on PORT + i",
    )
    parser.add_argument(
        "--arena",
        default=None,
        metavar="FILE",
        help="YAML file, or empty, obstacles, maze (a field of its own)",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of everything that is drawn by chance (0)")
    parser.add_argument(
        "--seconds", type=float, default=None, metavar="S", help="end by itself after S seconds"
    )
    parser.add_argument("--imu-hat", action="store_true", help="robots have the IMU hat")
    parser.add_argument(
        "--firmware-odometry",
        choices=("stock", "exact"),
        default="stock",
        help="stock loses distance under velocity control as the firmware does (stock)",
    )
    parser.add_argument(
        "--ir",
        choices=("calibrated", "factory", "erased"),
        default="calibrated",
        help="infrared calibration in a robot's flash: measured at 10 cm, 0.5 for all, or none: NaN (calibrated)",
    )
    parser.add_argument(
        "--flash-dir",
        default=None,
        metavar="DIR",
        help="keep the robots' parameters here, a file per robot; none forgets them (ROS_HOME/hero_sim)",
    )
    parser.add_argument(
        "--wifi",
        choices=("ideal", "router", "hotspot", "bad"),
        default="ideal",
        help="how the network is (ideal)",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="KIND[@S][:key=value,..]",
        help="let something go wrong S simulated seconds after the start, e.g. vanish@5:robot=1,for=3; "
        "more than one is possible; --fault help lists all",
    )
    parser.add_argument(
        "--speed", type=float, default=1.0, metavar="X", help="simulated seconds per second (%(default)s)"
    )
    parser.add_argument(
        "--perfect",
        action="store_true",
        help="all robots alike: no wheel errors, no slip (sensors stay noisy)",
    )
    parser.add_argument(
        "--error",
        action="append",
        default=[],
        metavar="KEY=VALUE,..[,robot=ID]",
        help="a known error of a robot, or of all, e.g. robot=1,left_centre_us=1530; more than one is possible; "
        "--error help lists the keys",
    )
    parser.add_argument(
        "--errors", default=None, metavar="FILE", help="the same from a YAML file, as --print-errors writes it"
    )
    parser.add_argument(
        "--print-errors", action="store_true", help="write down how the robots differ, and end"
    )
    parser.add_argument(
        "--motors",
        choices=("calibrated", "factory"),
        default="calibrated",
        help="servo centres in a robot's flash: the true ones, or 1500 (calibrated)",
    )
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")
    return parser


def check_options(options: argparse.Namespace) -> None:
    """Raise OptionError for a value that cannot be used."""
    if not 1 <= options.count <= MOST_ROBOTS:
        raise OptionError("--count %d: must be 1..%d" % (options.count, MOST_ROBOTS))
    if not 0 <= options.first_id <= LARGEST_ID - options.count + 1:
        raise OptionError(
            "--first-id %d: ids must be 0..%d (%d robots)" % (options.first_id, LARGEST_ID, options.count)
        )
    port = options.port if options.serve is None else options.serve
    name = "--port" if options.serve is None else "--serve"
    last = port if options.serve is None else port + options.count - 1
    if not (port >= 1 and last <= 65535):
        raise OptionError("%s %d: ports must be 1..65535 (%d robots)" % (name, port, options.count))
    if options.seconds is not None and not 0 < options.seconds <= LONGEST_RUN_S:
        raise OptionError("--seconds %g: must be more than 0, and at most %g" % (options.seconds, LONGEST_RUN_S))
    if not 0.01 <= options.speed <= 100:
        raise OptionError("--speed %g: must be 0.01..100" % options.speed)
    if not 0 <= options.seed < 2**32:
        raise OptionError("--seed %d: must be 0..4294967295" % options.seed)
    for text in options.fault:
        if text != "help":
            parse_fault(text)


def describe_faults() -> List[str]:
    """Return one line for each kind of fault, with its keys and their defaults."""
    lines = ["KIND[@SECONDS][:robot=ID,key=value,...]; without robot it happens to every robot."]
    for kind, (text, values) in sorted(KINDS.items()):
        keys = "".join(" %s=%g" % item for item in sorted(values.items()))
        lines.append("  %-13s %s%s" % (kind, text, " (%s)" % keys.strip() if keys else ""))
    return lines


def describe_error_keys() -> List[str]:
    """Return one line for each key of --error and --errors."""
    from .world.robot_errors import KINDS as ERROR_KINDS

    lines = ["KEY=VALUE,...[,robot=ID]; without robot it holds for all robots."]
    for key, kind in ERROR_KINDS.items():
        lines.append("  %-16s %s (%g..%g)" % (key, kind.meaning, kind.least, kind.most))
    return lines


def answer_question(options: argparse.Namespace) -> Optional[List[str]]:
    """Return the lines that options ask for instead of a simulation, None if they ask for none.

    Raises: OptionError for an error that cannot be set.
    """
    from .build import build_errors
    from .world.robot_errors import describe_errors

    if "help" in options.fault:
        return describe_faults()
    if "help" in options.error:
        return describe_error_keys()
    if options.print_errors:
        return describe_errors(build_errors(options), options.first_id)
    return None


def report(text: str) -> None:
    """Write a line for people."""
    print("hero_sim: " + text, flush=True)


def stop_on_signals(simulator: "Simulator") -> None:
    """End simulator.run() at Ctrl-C and SIGTERM."""

    def stop(signal_number: int, frame: object) -> None:
        del signal_number, frame
        simulator.stopping = True

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)


def find_missing() -> Optional[str]:
    """Return what has to be installed first, in words; None if nothing is missing."""
    if importlib.util.find_spec("numpy") is None:
        return "numpy is missing; install it: apt install python3-numpy, or pip install numpy"
    if importlib.util.find_spec("hero_driver") is None:
        return (
            "the package hero_driver is missing; it lies beside hero_sim: add hero_driver/src to PYTHONPATH"
        )
    return None


def main(arguments: Optional[List[str]] = None) -> int:
    """Run the simulator; return the exit status."""
    return output.call(lambda: _run(arguments))


def _run(arguments: Optional[List[str]]) -> int:
    options = build_parser().parse_args(arguments)
    # Loading takes a moment: Ctrl-C in it ends the program like any other, without a stack trace.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    missing = find_missing()
    if missing is not None:
        output.complain(missing)
        return output.FAILED
    from .build import build_simulator

    try:
        check_options(options)
    except OptionError as error:
        output.complain(str(error))
        return output.WRONG_ARGUMENTS
    try:
        answer = answer_question(options)
        if answer is not None:
            print("\n".join(answer))
            return 0
        simulator, _ = build_simulator(options, (lambda text: None) if options.quiet else report)
    except SimulatorError as error:
        output.complain(str(error))
        return output.FAILED
    stop_on_signals(simulator)
    try:
        simulator.run(options.seconds)
    finally:
        simulator.link.close_all()
    return 0
