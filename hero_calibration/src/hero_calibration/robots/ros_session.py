"""The session over ROS: its time, which may be simulated, and the end of the program."""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Callable, Sequence

import rospy

from hero_node.ros.program import Program

from .probe import Probe
from .session import Session

CALLS_AT_ONCE = 32


class RosSession(Session):
    """The robots under calibration, in ROS time."""

    def __init__(self, program: Program, probes: Sequence[Probe]) -> None:
        """Work with probes until program ends."""
        super().__init__(probes)
        self._program = program

    def now_s(self) -> float:
        """Return ROS time."""
        return rospy.get_time()

    def sleep(self, duration_s: float) -> None:
        """Sleep by the clock of this computer."""
        time.sleep(duration_s)

    @property
    def is_ending(self) -> bool:
        return not self._program.running

    def map(self, work: Callable[[Probe], None], probes: Sequence[Probe]) -> None:
        """Do work in threads: a service call waits for its robot."""
        with ThreadPoolExecutor(CALLS_AT_ONCE) as pool:
            list(pool.map(work, probes))
