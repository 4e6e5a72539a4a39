"""Ids, or the word for all -> a swarm, with words about what is waited for. Used by every node here."""

import time
from typing import Dict, List, Optional

import rospy

from .drivers import Drivers
from .program import Program, ProgramError
from .robot import RobotNotReadyError
from .swarm import Swarm

REPORT_PERIOD_S = 5.0
"""Between two lines that say what is waited for."""

FIRST_REPORT_S = 3.0
"""Most robots answer within a second or two, also when all is started at once: no line about those."""


def open_swarm(
    program: Program, robot_ids: Optional[List[int]], odom: bool = True, proximity: bool = True
) -> Swarm:
    """Return the swarm of these robots, or, for None, of all that the driver reports, waiting for the first one.

    Raises: ProgramError if the program is to end before there is any robot.
    """
    if robot_ids is not None:
        return Swarm(robot_ids, odom, proximity)
    while program.running:
        try:
            return Swarm.discover(REPORT_PERIOD_S, odom, proximity, program.sleep)
        except RobotNotReadyError as error:
            if program.running:
                rospy.logwarn("waiting: %s", error)
    raise ProgramError("ended before any robot was there")


def check_stop(drivers: Drivers) -> None:
    """Wait until the outcome of the last stop or release is known, for 1.5 s at most; for the end of a program.

    Raises: ProgramError with who did not do it.
    """
    status = drivers.wait_for_stop()
    if status is not None and status.level == "error":
        raise ProgramError(status.text)


class WaitReport:
    """Says which robots are waited for, and when they are there, without a line for every step."""

    def __init__(self) -> None:
        """Nothing was said yet."""
        self._said: Dict[str, str] = {}
        self._next_s = time.monotonic() + FIRST_REPORT_S

    def update(self, waiting: Dict[str, Optional[str]]) -> None:
        """Write lines where needed. waiting: robot's name -> what is missing, or None."""
        for name in [name for name in self._said if waiting.get(name) is None]:
            rospy.loginfo("%s answers", name)
            del self._said[name]
        if time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + REPORT_PERIOD_S
        for name, missing in waiting.items():
            if missing is not None:
                rospy.logwarn("%s: waiting: %s", name, missing)
                self._said[name] = missing
