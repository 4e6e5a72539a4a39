"""Several robots as one object, and the lists of robots that the drivers publish: see robot."""

from typing import Iterable, List, Optional

import rospy

from hero_node import ProgramError
from hero_node.ros import ROS_CLOCK, Program, start_node

from .robot import Robot
from .robots.group import check_robot_id
from .robots.swarm_base import REPORT_PERIOD_S, BaseSwarm
from .ros.drivers import Drivers, share_drivers
from .ros.stop_status import StopStatus
from .values.background_motion import Sleep
from .values.errors import RobotNotReadyError


class Swarm(BaseSwarm[Robot]):
    """Several robots; iterate over them, or take one by its id: swarm[3] is hero_3, not the fourth robot.

    A command to a swarm is given to each of its robots.

    Attributes:
        robots: list of Robot, in the order of the ids given.
        drivers: all drivers, connected so that a stop of all robots needs no ROS master.
    """

    def __init__(self, robot_ids: Iterable[int], odom: bool = True, proximity: bool = True) -> None:
        """Connect to the robots with these ids; odom, proximity: see Robot.

        Raises: ValueError for an invalid or repeated id. NodeError if no ROS master answers within 3 s.
        """
        if isinstance(robot_ids, str) or not isinstance(robot_ids, Iterable):
            raise ValueError(f"a swarm is named by numbers, such as [0, 1, 2] or range(3), not by {robot_ids!r}")
        numbers = [check_robot_id(number) for number in robot_ids]
        for number in numbers:
            if numbers.count(number) > 1:
                raise ValueError("robot %d is named more than once" % number)
        start_node()
        super().__init__([Robot(number, odom, proximity) for number in numbers], ROS_CLOCK)
        self.drivers: Drivers = share_drivers()

    @classmethod
    def discover(
        cls, timeout_s: float = 10.0, odom: bool = True, proximity: bool = True, sleep: Sleep = ROS_CLOCK.sleep
    ) -> "Swarm":
        """Return all robots that the drivers report as ready, as soon as there is at least one.

        Raises: RobotNotReadyError after timeout_s without the driver or without a robot. NodeError if no ROS master
        answers within 3 s.
        """
        start_node()
        return cls(share_drivers().wait_for_robots(timeout_s, sleep), odom, proximity)

    def emergency_stop(self) -> StopStatus:
        """Stop all robots of all drivers, not only those of this swarm, until release_stop().

        Returns the outcome as soon as it is known, after 1.5 s at most: status.level is "info" if all wheels are at
        rest, "error" if status.text names robots or drivers that did not stop. Those are asked again while the
        program runs.
        """
        return self._ask_drivers(True)

    def release_stop(self) -> StopStatus:
        """Release all robots of all drivers; returns the outcome as emergency_stop() does."""
        return self._ask_drivers(False)

    def _ask_drivers(self, stopped: bool) -> StopStatus:
        self.drivers.request_stop(stopped)
        status = self.drivers.wait_for_stop()
        assert status is not None  # something was just requested
        return status

    def _log(self, level: str, text: str) -> None:
        (rospy.loginfo if level == "info" else rospy.logwarn)(text)


def open_swarm(program: Program, robot_ids: Optional[List[int]], odom: bool = True, proximity: bool = True) -> Swarm:
    """Return the swarm of these robots; for None, of all that the drivers report, waiting for the first one.

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
