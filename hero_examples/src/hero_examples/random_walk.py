"""Node random_walk: proximity of any set of robots -> a random walk that avoids obstacles, one process for all."""

import math
import random
from functools import partial
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import rospy

from hero_client.control_laws import (
    POTENTIAL,
    STANDSTILL,
    WANDER,
    Command,
    WanderMemory,
    wander,
    wander_in_potential,
)
from hero_client.program import Program, ProgramError, check_number, parse_robot_ids, read_parameters, run
from hero_client.robot import MAX_LINEAR_M_S, Robot, StaleDataError
from hero_client.swarm_start import WaitReport, open_swarm

RATE_HZ = 10.0
"""Commands per second and robot: the robot takes no more than about 19, and stops by itself after 2 s without."""

LED_PERIOD_S = 2.0
"""Between two messages of the same colour: the robot goes dark 15 s after the last one."""

WALKING_COLOR = "green"
BENDING_COLOR = "yellow"
ESCAPING_COLOR = "red"
WAITING_COLOR = "blue"


Rule = Callable[[Sequence[float], WanderMemory, float], Tuple[Command, WanderMemory]]
"""Ranges, memory, chance -> command, memory: see control_laws.wander."""


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    robot_ids: Optional[List[int]]
    """None for all that the driver reports."""
    rule: Rule
    linear_m_s: float
    seed: Optional[int]


def make_rule(name: str, linear_m_s: float, turn_rad_s: float) -> Rule:
    """Return the rule of this name with these speeds. Raises: ProgramError with the names that are known."""
    rules: Dict[str, Rule] = {
        "sectors": partial(wander, law=WANDER._replace(cruise_m_s=linear_m_s, turn_rad_s=turn_rad_s)),
        "potential": partial(
            wander_in_potential, law=POTENTIAL._replace(cruise_m_s=linear_m_s, turn_rad_s=turn_rad_s)
        ),
    }
    if name not in rules:
        raise ProgramError("~rule is %r, but must be one of: %s" % (name, ", ".join(rules)))
    return rules[name]


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters(
        {"robots": "0", "rule": "sectors", "linear_m_s": WANDER.cruise_m_s, "turn_rad_s": WANDER.turn_rad_s, "seed": -1}
    )
    seed = given["seed"]
    if isinstance(seed, bool) or not isinstance(seed, int):
        raise ProgramError("~seed is %r, but must be a whole number; -1 draws one" % (seed,))
    linear_m_s = check_number("linear_m_s", given["linear_m_s"], 0.0, MAX_LINEAR_M_S, "m/s")
    rule = make_rule(given["rule"], linear_m_s, check_number("turn_rad_s", given["turn_rad_s"], 0.1, 4.0, "rad/s"))
    return Parameters(parse_robot_ids("robots", given["robots"]), rule, linear_m_s, None if seed < 0 else seed)


class Walker:
    """The random walk of one robot."""

    def __init__(self, robot: Robot, parameters: Parameters) -> None:
        """Begin to walk; every robot draws from a seed of its own."""
        self.robot = robot
        self.waiting_for: Optional[str] = "the first proximity message"
        self._rule = parameters.rule
        self._cruise_m_s = parameters.linear_m_s
        self._random = random.Random(None if parameters.seed is None else parameters.seed + robot.robot_id)
        self._memory = WanderMemory()
        self._color = ""
        self._steps_since_color = 0

    def step(self) -> None:
        """Send the next command: a standstill while the robot's sensors are silent."""
        try:
            ranges = self.robot.proximity
        except StaleDataError as error:
            self.waiting_for = str(error)
            self._memory = WanderMemory()
            self.robot.drive(*STANDSTILL)
            self._show(WAITING_COLOR)
            return
        if all(math.isnan(range_m) for range_m in ranges):
            self.waiting_for = "usable ranges on %s/proximity: is its infrared calibration set?" % self.robot.namespace
            self.robot.drive(*STANDSTILL)
            self._show(WAITING_COLOR)
            return
        self.waiting_for = None
        command, self._memory = self._rule(ranges, self._memory, self._random.random())
        self.robot.drive(*command)
        if self._memory.escape_sign:
            self._show(ESCAPING_COLOR)
        else:
            self._show(WALKING_COLOR if command.linear_m_s >= self._cruise_m_s else BENDING_COLOR)

    def _show(self, color: str) -> None:
        self._steps_since_color += 1
        if color != self._color or self._steps_since_color >= LED_PERIOD_S * RATE_HZ:
            self.robot.led(color)
            self._color = color
            self._steps_since_color = 0


def walk(program: Program, parameters: Parameters) -> None:
    """Let the robots walk until the program is to end."""
    with open_swarm(program, parameters.robot_ids, odom=False) as swarm:
        walkers = [Walker(robot, parameters) for robot in swarm]
        rospy.loginfo("random walk of %s", ", ".join(robot.name for robot in swarm))
        report = WaitReport()
        while program.pace(1.0 / RATE_HZ):
            for walker in walkers:
                walker.step()
            report.update({walker.robot.name: walker.waiting_for for walker in walkers})
        swarm.led("off")
    rospy.loginfo("random walk ended, robots stopped")


def _main() -> None:
    with Program("random_walk") as program:
        walk(program, load_parameters())


def main() -> None:
    """Run the node."""
    run(_main)
