"""The command line of the simulator. Needs Python, numpy and PyYAML; neither ROS nor a ROS master."""

import argparse
import signal
from typing import TYPE_CHECKING, List, Optional

from . import output
from .errors import OptionError, SimulatorError
from .faults import describe_kinds, parse_fault

if TYPE_CHECKING:
    from .simulator import Simulator

__all__ = ["build_parser", "check_options", "main"]

DEFAULT_PORT = 11411
"""The port that stock robots connect to."""

MOST_ROBOTS = 1000
LARGEST_ID = 2**31 - 1
"""Of hero_msgs/Robot."""

LONGEST_RUN_S = 1e9
"""Some thirty years."""

_REMEDIES = {
    "numpy": "numpy is missing; install it: apt install python3-numpy, or pip install numpy",
    "yaml": "PyYAML is missing; install it: apt install python3-yaml, or pip install PyYAML",
    "hero_driver": "the package hero_driver is missing; it lies beside hero_sim: add hero_driver/src to PYTHONPATH",
}


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="hero_sim", description="HeRo robots without hardware, behind the same TCP socket as real ones."
    )
    add = parser.add_argument
    add("--count", type=int, default=1, metavar="N", help="number of robots (1)")
    add("--first-id", type=int, default=0, metavar="K", help="id of the first robot (0)")
    add("--arena", metavar="FILE", help="YAML file, or empty, obstacles, maze (a plain field that fits)")
    add("--seed", type=int, default=0, help="seed of all random numbers (0)")
    add("--seconds", type=float, metavar="S", help="end after S simulated seconds")
    add("--speed", type=float, default=1.0, metavar="X", help="simulated seconds per second (%(default)s)")
    add("--quiet", action="store_true", help="print nothing but errors")
    _add_link_options(parser.add_argument_group("network"))
    _add_robot_options(parser.add_argument_group("robots"))
    return parser


def _add_link_options(group: "argparse._ArgumentGroup") -> None:
    add = group.add_argument
    add("--host", help="where the driver runs (127.0.0.1); with --serve: own address (0.0.0.0)")
    add("--port", type=int, default=DEFAULT_PORT, help="port of the driver (%(default)s)")
    add("--serve", type=int, metavar="PORT", help="do not connect: robot i is a TCP server on PORT + i")
    profiles = ("ideal", "router", "hotspot", "bad")
    add("--wifi", choices=profiles, default="ideal", help="quality of the network (ideal)")
    add(
        "--fault",
        action="append",
        default=[],
        metavar="KIND[@S][:key=value,..]",
        help="inject a fault S simulated seconds after the start, e.g. vanish@5:robot=1,for=3; may be repeated; "
        "--fault help lists all",
    )


def _add_robot_options(group: "argparse._ArgumentGroup") -> None:
    add = group.add_argument
    add("--imu-hat", action="store_true", help="robots have the IMU hat")
    add("--perfect", action="store_true", help="all robots alike: no wheel errors, no slip (sensors stay noisy)")
    add(
        "--error",
        action="append",
        default=[],
        metavar="KEY=VALUE,..[,robot=ID]",
        help="a known error of a robot, or of all, e.g. robot=1,left_center_us=1530; may be repeated; "
        "--error help lists the keys",
    )
    add("--errors", metavar="FILE", help="the same from a YAML file, as --print-errors writes it")
    add("--print-errors", action="store_true", help="print how the robots differ, and end")
    add(
        "--firmware-odometry",
        choices=("stock", "exact"),
        default="stock",
        help="stock loses distance under velocity control as the firmware does (stock)",
    )
    add(
        "--ir",
        choices=("calibrated", "factory", "erased"),
        default="calibrated",
        help="infrared calibration in the flash: measured at 10 cm, 0.5 for all, or none: NaN (calibrated)",
    )
    add(
        "--motors",
        choices=("calibrated", "factory"),
        default="calibrated",
        help="servo centers in the flash: the true ones, or 1500 (calibrated)",
    )
    add(
        "--flash-dir",
        metavar="DIR",
        help="folder of the robots' parameters, a file per robot; none keeps nothing (ROS_HOME/hero_sim)",
    )


def check_options(options: argparse.Namespace) -> None:
    """Raise OptionError for a value that cannot be used."""
    count, serve = options.count, options.serve
    if not 1 <= count <= MOST_ROBOTS:
        raise OptionError("--count %d: must be 1..%d" % (count, MOST_ROBOTS))
    if not 0 <= options.first_id <= LARGEST_ID - count + 1:
        raise OptionError("--first-id %d: ids must be 0..%d (%d robots)" % (options.first_id, LARGEST_ID, count))
    name, port, last = ("--port", options.port, options.port)
    if serve is not None:
        name, port, last = ("--serve", serve, serve + count - 1)
    if not (port >= 1 and last <= 65535):
        raise OptionError("%s %d: ports must be 1..65535 (%d robots)" % (name, port, count))
    if options.seconds is not None and not 0 < options.seconds <= LONGEST_RUN_S:
        raise OptionError("--seconds %g: must be more than 0, and at most %g" % (options.seconds, LONGEST_RUN_S))
    if not 0.01 <= options.speed <= 100:
        raise OptionError("--speed %g: must be 0.01..100" % options.speed)
    if not 0 <= options.seed < 2**32:
        raise OptionError("--seed %d: must be 0..4294967295" % options.seed)
    for text in options.fault:
        if text != "help":
            parse_fault(text)


def answer_question(options: argparse.Namespace) -> Optional[List[str]]:
    """Return the lines that options ask for instead of a simulation, None if they ask for none.

    Raises: OptionError for an error that cannot be set.
    """
    from .build import build_errors
    from .world.robot_errors import describe_errors, describe_keys

    if "help" in options.fault:
        return describe_kinds()
    if "help" in options.error:
        return describe_keys()
    if options.print_errors:
        return describe_errors(build_errors(options), options.first_id)
    return None


def report(text: str) -> None:
    """Print a line for people."""
    print("hero_sim: " + text, flush=True)


def stop_on_signals(simulator: "Simulator") -> None:
    """End simulator.run() at Ctrl-C and SIGTERM."""

    def stop(signal_number: int, frame: object) -> None:
        del signal_number, frame
        simulator.stopping = True

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)


def main(arguments: Optional[List[str]] = None) -> int:
    """Run the simulator; return the exit status."""
    return output.call(lambda: _run(arguments))


def _run(arguments: Optional[List[str]]) -> int:
    options = build_parser().parse_args(arguments)
    # Loading takes a moment: Ctrl-C in it ends the program like any other, without a stack trace.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        from .build import build_simulator
    except ModuleNotFoundError as error:
        remedy = _REMEDIES.get((error.name or "").partition(".")[0])
        if remedy is None:
            raise
        return output.fail(remedy)
    try:
        check_options(options)
    except OptionError as error:
        return output.fail(str(error), output.WRONG_ARGUMENTS)
    try:
        answer = answer_question(options)
        if answer is not None:
            print("\n".join(answer))
            return 0
        simulator, _ = build_simulator(options, (lambda text: None) if options.quiet else report)
    except SimulatorError as error:
        return output.fail(str(error))
    stop_on_signals(simulator)
    try:
        simulator.run(options.seconds)
    finally:
        simulator.link.close_all()
    return 0
