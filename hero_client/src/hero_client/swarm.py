"""Several robots as one object, and the lists of robots that the drivers publish: see robot."""

import time
from typing import Dict, Iterable, Iterator, List, Mapping, Optional

import rospy

from hero_msgs.msg import RobotArray

from .colors import Color
from .drivers import USUAL_TOPIC, Drivers
from .program import Program, ProgramError
from .robot import (
    POLL_PERIOD_S,
    Robot,
    RobotNotReadyError,
    Sleep,
    sleep_unless_shutdown,
    start_node,
    stop_all,
)
from .stop_status import StopStatus

__all__ = ["Swarm", "open_swarm"]

REPORT_PERIOD_S = 5.0
"""Between two lines on what is waited for."""

FIRST_REPORT_S = 3.0
"""Most robots answer within a second or two even when all starts at once: no line about those."""


class Swarm:
    """Several robots; iterate over them, or take one by its id: swarm[3].

    Attributes:
        drivers: all drivers, connected so that a stop of all robots needs no ROS master.
    """

    def __init__(
        self, robot_ids: Iterable[int], odom: bool = True, proximity: bool = True, drivers: Optional[Drivers] = None
    ) -> None:
        """Connect to the robots with these ids; odom, proximity: see Robot; drivers: None connects to them anew.

        Raises: ValueError for an invalid or repeated id.
        """
        numbers = list(robot_ids)
        for number in numbers:
            if numbers.count(number) > 1:
                raise ValueError("robot %r is named more than once" % (number,))
        self.robots = [Robot(number, odom, proximity) for number in numbers]
        start_node()
        self.drivers = drivers or Drivers()
        self._by_id = {robot.robot_id: robot for robot in self.robots}
        self._reported: Dict[str, str] = {}
        self._next_report_s = time.monotonic() + FIRST_REPORT_S

    @classmethod
    def discover(
        cls, timeout_s: float = 10.0, odom: bool = True, proximity: bool = True, sleep: Sleep = sleep_unless_shutdown
    ) -> "Swarm":
        """Return all robots that the drivers report as ready, as soon as there is at least one.

        Raises: RobotNotReadyError after timeout_s without the driver or without a robot.
        """
        start_node()
        deadline_s = time.monotonic() + timeout_s
        report = None
        drivers = Drivers()
        while time.monotonic() < deadline_s and sleep(POLL_PERIOD_S):
            report = drivers.read()
            ids = ready_ids(report) if report else []
            if ids and drivers.is_settled:
                return cls(ids, odom, proximity, drivers)
        drivers.close()
        if report is None:
            raise RobotNotReadyError(
                "nothing on %s within %g s: is the driver running?" % (USUAL_TOPIC, timeout_s)
            )
        raise RobotNotReadyError("no robot joined the driver within %g s: are they on?" % timeout_s)

    def wait_until_ready(self, timeout_s: float = 10.0, sleep: Sleep = sleep_unless_shutdown) -> "Swarm":
        """Wait until every robot is ready; return the swarm itself.

        Raises: RobotNotReadyError after timeout_s, for the first robot that is not.
        """
        deadline_s = time.monotonic() + timeout_s
        for robot in self.robots:
            robot.wait_until_ready(max(0.0, deadline_s - time.monotonic()), sleep)
        return self

    def stop(self) -> None:
        """Stop all robots at once; returns when the stops are sent (about 0.2 s)."""
        stop_all(self.robots)

    def emergency_stop(self) -> StopStatus:
        """Stop all robots of all drivers, not only those of this swarm, until release_stop().

        Returns the outcome as soon as it is known, after 1.5 s at most: status.level is "info" if all wheels are at
        rest, "error" if status.text names robots or drivers that did not stop. Those are asked again while the
        program runs.
        """
        self.drivers.request_stop(True)
        return self.drivers.wait_for_stop()

    def release_stop(self) -> StopStatus:
        """Let all robots of all drivers move again; returns the outcome, after 1.5 s at most."""
        self.drivers.request_stop(False)
        return self.drivers.wait_for_stop()

    def led(self, color: Color) -> None:
        """Show a color on all robots."""
        for robot in self.robots:
            robot.led(color)

    def report_missing(self, missing: Optional[Mapping[str, Optional[str]]] = None) -> None:
        """Log which robots are waited for, every 5 s, and when they answer; call it in every step of a loop.

        missing: robot's name -> what is missing, or None; without it, robot.missing() of each robot.
        """
        if missing is None:
            missing = {robot.name: robot.missing() for robot in self.robots}
        for name in [name for name in self._reported if missing.get(name) is None]:
            rospy.loginfo("%s answers", name)
            del self._reported[name]
        if time.monotonic() < self._next_report_s:
            return
        self._next_report_s = time.monotonic() + REPORT_PERIOD_S
        for name, reason in missing.items():
            if reason is not None:
                rospy.logwarn("%s: waiting: %s", name, reason)
                self._reported[name] = reason

    def close(self) -> None:
        """Stop all robots that were driven from here, and leave their topics; safe twice."""
        self._stop_if_driven()
        self.drivers.close()
        for robot in self.robots:
            robot._disconnect()

    def _stop_if_driven(self) -> None:
        stop_all([robot for robot in self.robots if robot.driven])

    def __getitem__(self, robot_id: int) -> Robot:
        if robot_id not in self._by_id:
            names = ", ".join(robot.name for robot in self.robots)
            raise KeyError("hero_%s is not in this swarm: %s" % (robot_id, names))
        return self._by_id[robot_id]

    def __iter__(self) -> Iterator[Robot]:
        return iter(self.robots)

    def __len__(self) -> int:
        return len(self.robots)

    def __enter__(self) -> "Swarm":
        return self

    def __exit__(self, *error: object) -> None:
        # Topics are left to the end of the program: leaving them one by one takes 20 ms each.
        self._stop_if_driven()


def ready_ids(robots: RobotArray) -> List[int]:
    """Return the numbers of the robots that can be driven now, sorted."""
    return sorted(robot.id for robot in robots.robots if robot.state == robot.READY and robot.id >= 0)


def open_swarm(
    program: Program, robot_ids: Optional[List[int]], odom: bool = True, proximity: bool = True
) -> Swarm:
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
