"""Node led_show: the time -> colours of a swarm, as a pattern that runs over the robots."""

import colorsys
import time
from typing import List, NamedTuple, Optional, Tuple

import rospy

from hero_client.program import Program, ProgramError, check_number, parse_robot_ids, read_parameters, run
from hero_client.swarm import Swarm
from hero_client.swarm_start import WaitReport, open_swarm

RATE_HZ = 5.0
"""Colours per second and robot: smooth to the eye, little on the air."""

PATTERNS = ("rainbow", "chase", "blink")


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    pattern: str
    period_s: float
    brightness: float


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters({"robots": "all", "pattern": "rainbow", "period_s": 4.0, "brightness": 1.0})
    if given["pattern"] not in PATTERNS:
        raise ProgramError("~pattern is %r, but must be one of: %s" % (given["pattern"], ", ".join(PATTERNS)))
    return Parameters(
        parse_robot_ids("robots", given["robots"]),
        given["pattern"],
        check_number("period_s", given["period_s"], 0.5, 60.0, "s"),
        check_number("brightness", given["brightness"], 0.0, 1.0),
    )


def paint(pattern: str, phase: float, place: int, count: int, brightness: float) -> Tuple[float, float, float]:
    """Return the colour, each part 0..1, of the robot at place of count, at phase 0..1 of the pattern.

    rainbow: colours run over the swarm. chase: one robot after the other is white. blink: all, red and blue.
    """
    if pattern == "rainbow":
        return colorsys.hsv_to_rgb((phase + place / count) % 1.0, 1.0, brightness)
    if pattern == "chase":
        lit = int(phase % 1.0 * count) == place
        return (brightness, brightness, brightness) if lit else (0.0, 0.0, 0.0)
    return (brightness, 0.0, 0.0) if phase % 1.0 < 0.5 else (0.0, 0.0, brightness)


def show(program: Program, parameters: Parameters, swarm: Swarm) -> None:
    """Paint the swarm until the program is to end, then put the lights out."""
    rospy.loginfo("%s on %s", parameters.pattern, ", ".join(robot.name for robot in swarm))
    report = WaitReport()
    start_s = time.monotonic()
    while program.pace(1.0 / RATE_HZ):
        phase = (time.monotonic() - start_s) / parameters.period_s
        for place, robot in enumerate(swarm):
            robot.led(paint(parameters.pattern, phase, place, len(swarm), parameters.brightness))
        report.update({robot.name: robot.missing() for robot in swarm})
    swarm.led("off")


def _main() -> None:
    with Program("led_show") as program:
        parameters = load_parameters()
        with open_swarm(program, parameters.robot_ids, odom=False, proximity=False) as swarm:
            show(program, parameters, swarm)


def main() -> None:
    """Run the node."""
    run(_main)
