"""Simulated robots in process: the robots of hero_sim and the interface of hero_client's Swarm, in virtual time. Pure.

from hero_sim.stepped.swarm import StepSwarm

with StepSwarm(count=4, seed=1) as swarm:
    for time_s in swarm.rate(10):
        swarm[3].drive(0.1, 0.5)
        if time_s > 5.0:
            break
"""

import argparse
import sys
from typing import List, Optional, Sequence, Union

from hero_client.robots import BaseSwarm
from hero_client.values import Steps
from hero_node import say

from ..population import build_radios, build_world, check_population
from ..robot.models import parse_models
from .robot import StepRobot
from .robot_rows import RobotRows
from .step_clock import StepClock, StepMotion
from .swarm_log import SwarmLog

LOG_PERIOD_S = 0.05

IDEAL = "ideal"
"""The network that adds nothing: no radio at all is faster."""


class StepWorld(BaseSwarm[StepRobot]):
    """The robots of one world; see Swarm in hero_client.

    Attributes:
        robots: list of StepRobot, in the order of their ids.
    """

    _clock: StepClock

    def emergency_stop(self) -> None:
        """Stop all robots until release_stop(): meanwhile they take no motion."""
        for robot in self.robots:
            robot.set_stopped(True)

    def release_stop(self) -> None:
        """Release all robots."""
        for robot in self.robots:
            robot.set_stopped(False)

    def _log(self, level: str, text: str) -> None:
        say(text, sys.stderr)


class StepSwarm(StepWorld):
    """Simulated robots that are stepped: time passes only while the program waits, by sleep(), rate() or a motion.

    The same options and calls give the same bytes, on any machine. Robots, places and differences are those of
    `hero_sim --count N --seed S`.

    With several worlds, commands to the swarm go to the robots of all of them, and swarm[3] is hero_3 of the first.

    Attributes:
        robots: list of StepRobot, world after world, in the order of their ids.
        worlds: list of StepWorld, the robots of each; world k is that of the seed seed + k alone.
        rows: the same robots as arrays, for programs that command many at once.
    """

    def __init__(
        self,
        count: int,
        seed: int = 0,
        arena: Optional[str] = None,
        wifi: str = "ideal",
        perfect: bool = False,
        first_id: int = 0,
        worlds: int = 1,
        error: Union[str, Sequence[str]] = (),
        model: Union[str, Sequence[str]] = (),
    ) -> None:
        """Switch on count robots in each world; the options are those of the simulator's command line.

        Raises: hero_sim.errors.OptionError for an option that cannot be used.
        """
        options = argparse.Namespace(
            count=count,
            seed=seed,
            arena=arena,
            wifi=wifi,
            perfect=perfect,
            first_id=first_id,
            errors=None,
            error=_list_texts(error),
            model=_list_texts(model),
        )
        check_population(options, worlds)
        radios = () if wifi == IDEAL else build_radios(options, worlds)
        models = parse_models(options.model, first_id, count) * worlds
        self.rows = RobotRows(build_world(options, worlds), radios, models)
        clock = StepClock(self.rows)
        robots = [StepRobot(first_id + row % count, clock, row) for row in range(count * worlds)]
        super().__init__(robots, clock)
        self.worlds = [StepWorld(robots[first : first + count], clock) for first in range(0, len(robots), count)]
        self._by_id = self.worlds[0]._by_id

    def log(self, ranges: bool = False) -> SwarmLog:
        """Return a log that from now on grows by a row every 0.05 s in which the program waits.

        ranges: also log what the proximity sensors see, which takes longer.
        """
        log = SwarmLog(self.rows, len(self.worlds), ranges)
        StepMotion(self._clock, self._note(log))
        return log

    def _note(self, log: SwarmLog) -> Steps:
        while True:
            log.note()
            yield LOG_PERIOD_S


def _list_texts(texts: Union[str, Sequence[str]]) -> List[str]:
    return [texts] if isinstance(texts, str) else [str(text) for text in texts]
