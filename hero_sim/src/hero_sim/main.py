"""The command line of the simulator. Needs Python, numpy and PyYAML; neither ROS nor a ROS master."""

import argparse
import contextlib
import signal
from typing import Callable, Iterator, Optional, Sequence, Tuple

from hero_node import WRONG_ARGUMENTS, call
from hero_node.parameters import within

from .build import build_simulator
from .errors import OptionError
from .faults import FaultInjector, parse_fault
from .population import SERVO_TIMINGS, add_options, build_errors, check_population
from .robot.servo_pins import CORE_2
from .simulator import Simulator
from .world.robot_errors import describe_errors

DEFAULT_PORT = 11411
"""The port that stock robots connect to."""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="hero_sim", description="HeRo robots without hardware, behind the same TCP socket as real ones."
    )
    add_options(parser)
    add = parser.add_argument
    add("--first-id", type=int, default=0, metavar="K", help="id of the first robot (0)")
    add("--speed", type=within(0.01, 100.0), default=1.0, metavar="X", help="simulated seconds per second (1)")
    add("--quiet", action="store_true", help="print nothing but errors")
    add = parser.add_argument_group("network").add_argument
    add("--host", default="127.0.0.1", help="host of the driver (%(default)s)")
    add("--port", type=within(1, 65535, int), default=DEFAULT_PORT, help="port of the driver (%(default)s)")
    text = "inject a fault S simulated seconds after the start, e.g. vanish@5:robot=1,for=3; may be repeated"
    add("--fault", type=parse_fault, action="append", default=[], metavar="KIND[@S][:key=value]", help=text)
    add = parser.add_argument_group("robots").add_argument
    add("--imu-hat", action="store_true", help="robots have the IMU hat")
    text = "a known error of a robot, or of all, e.g. robot=1,left_center_us=1530; may be repeated"
    add("--error", action="append", default=[], metavar="KEY=VALUE,..[,robot=ID]", help=text)
    add("--errors", metavar="FILE", help="lines as --error takes them, such as `fit` of hero_swarm writes")
    add("--print-errors", action="store_true", help="print the robots' differences as --error takes them, and exit")
    text = "infrared calibration in the flash: measured at 10 cm, 0.5 for all, or none: NaN (calibrated)"
    add("--ir", choices=("calibrated", "factory", "erased"), default="calibrated", help=text)
    text = "servo centers in the flash: the true ones, or 1500 (calibrated)"
    add("--motors", choices=("calibrated", "factory"), default="calibrated", help=text)
    text = "timing of ESP8266 core 2.x or 3.x, or drawn for each robot (core2)"
    add("--servo-timing", choices=SERVO_TIMINGS, default=CORE_2, help=text)
    add("--flash-dir", metavar="DIR", help="keep the robots' parameters in this folder, a file per robot (in memory)")
    return parser


def parse_options(parser: argparse.ArgumentParser, arguments: Optional[Sequence[str]]) -> argparse.Namespace:
    """Return the options of a run; wrong ones, and those that ask for a text instead, end the program.

    Raises: OptionError for an error of a robot that cannot be set.
    """
    try:
        options = parser.parse_args(arguments)
        check_population(options)
    except OptionError as error:
        parser.exit(WRONG_ARGUMENTS, f"hero_sim: {error}\n")
    if options.print_errors:
        print("\n".join(describe_errors(build_errors(options), options.first_id)))
        parser.exit()
    return options


@contextlib.contextmanager
def simulate(options: argparse.Namespace, report: Callable[[str], None]) -> Iterator[Tuple[Simulator, FaultInjector]]:
    """Hand out a simulator, which a signal ends, and its faults; close its connections afterwards.

    Raises: OptionError for an option that cannot be used.
    """
    simulator, injector = build_simulator(options, (lambda text: None) if options.quiet else report)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: setattr(simulator, "stopping", True))
    try:
        yield simulator, injector
    finally:
        simulator.link.close_all()


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Run the simulator; return the exit status."""
    return call(lambda: _run(parse_options(build_parser(), arguments)))


def _run(options: argparse.Namespace) -> None:
    with simulate(options, lambda text: print("hero_sim: " + text, flush=True)) as (simulator, _):
        simulator.run(options.seconds)
