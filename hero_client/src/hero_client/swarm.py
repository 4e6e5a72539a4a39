"""Several robots as one object, and the lists of robots that the drivers publish: see robot."""

import time
from typing import Any, Dict, Iterable, Iterator, List, Mapping, Optional

import rospy

from hero_msgs.msg import RobotArray

from .background_motion import BackgroundMotion, Sleep
from .colors import Color
from .drivers import USUAL_TOPIC, share_drivers
from .errors import GoalError, HeroError, ProgramError, RobotNotReadyError
from .group import POLL_PERIOD_S, drive_all, leave_all, stop_all, wait_for_all
from .program import Program
from .robot import Robot
from .script import sleep_unless_shutdown, start_node
from .stop_status import StopStatus

__all__ = ["Swarm", "open_swarm"]

REPORT_PERIOD_S = 5.0
"""Between two lines on what is waited for."""

FIRST_REPORT_S = 3.0
"""Most robots answer within a second or two even when all starts at once: no line about those."""


class Swarm:
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
        numbers = list(robot_ids)
        for number in numbers:
            if numbers.count(number) > 1:
                raise ValueError("robot %r is named more than once" % (number,))
        start_node()
        self.robots = [Robot(number, odom, proximity) for number in numbers]
        self.drivers = share_drivers()
        self._by_id = {robot.robot_id: robot for robot in self.robots}
        self._reported: Dict[str, str] = {}
        self._next_report_s = time.monotonic() + FIRST_REPORT_S

    @classmethod
    def discover(
        cls, timeout_s: float = 10.0, odom: bool = True, proximity: bool = True, sleep: Sleep = sleep_unless_shutdown
    ) -> "Swarm":
        """Return all robots that the drivers report as ready, as soon as there is at least one.

        Raises: RobotNotReadyError after timeout_s without the driver or without a robot. NodeError if no ROS master
        answers within 3 s.
        """
        start_node()
        deadline_s = time.monotonic() + timeout_s
        report = None
        drivers = share_drivers()
        while time.monotonic() < deadline_s and sleep(POLL_PERIOD_S):
            report = drivers.read()
            ids = ready_ids(report) if report else []
            if ids and drivers.is_settled:
                return cls(ids, odom, proximity)
        if report is None:
            raise RobotNotReadyError(
                "nothing on %s within %.3g s: is the driver running?" % (USUAL_TOPIC, timeout_s)
            )
        raise RobotNotReadyError("no robot joined the driver within %.3g s: are they on?" % timeout_s)

    def wait_until_ready(self, timeout_s: float = 10.0, sleep: Sleep = sleep_unless_shutdown) -> "Swarm":
        """Wait until every robot is ready; return the swarm itself.

        Raises: RobotNotReadyError after timeout_s, with the robots that are not.
        """
        wait_for_all(self.robots, timeout_s, sleep)
        return self

    def drive(self, linear_m_s: float, angular_rad_s: float, duration_s: Optional[float] = None) -> None:
        """Drive all robots with the same velocities: see Robot.drive()."""
        if duration_s is not None:
            drive_all(self.robots, linear_m_s, angular_rad_s, duration_s)
            return
        for robot in self.robots:
            robot.drive(linear_m_s, angular_rad_s)

    def go_to(self, x_m: float, y_m: float, yaw_rad: Optional[float] = None, **options: Any) -> None:
        """Drive every robot to this place of its own frame, all at once; return when all have ended.

        options: as in Robot.go_to(). With frame="robot" all robots make the same move. For goals of each robot, use
        robot.start_go_to(); for goals in a common frame without collisions, controllers.swarm_go_to.

        Raises: as Robot.go_to(), for the robots that failed; the others reach their goals.
        """
        motions = self.start_go_to(x_m, y_m, yaw_rad, **options)
        errors = [error for error in (motion.exception() for motion in motions) if error is not None]
        if len(errors) > 1 and all(isinstance(error, HeroError) for error in errors):
            raise GoalError("; ".join(map(str, errors)))
        for error in errors:
            raise error

    def start_go_to(
        self, x_m: float, y_m: float, yaw_rad: Optional[float] = None, **options: Any
    ) -> List[BackgroundMotion]:
        """Start go_to() of every robot, and return the motions in the order of the robots: see Robot.start_go_to()."""
        return [robot.start_go_to(x_m, y_m, yaw_rad, **options) for robot in self.robots]

    def stop(self) -> None:
        """Stop all robots of this swarm at once; returns when the stops are sent (about 0.2 s)."""
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
        """Let all robots of all drivers move again; returns the outcome as emergency_stop() does."""
        self.drivers.request_stop(False)
        return self.drivers.wait_for_stop()

    def led(self, color: Color) -> None:
        """Show a color on all robots: see Robot.led()."""
        for robot in self.robots:
            robot.led(color)

    def blink(self, color: Color, period_s: float = 1.0) -> None:
        """Let all lights blink: see Robot.blink()."""
        for robot in self.robots:
            robot.blink(color, period_s)

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
        leave_all(self.robots)
        for robot in self.robots:
            robot._data.close()

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
        leave_all(self.robots)

    def __repr__(self) -> str:
        """Return the robots' names, and how many are ready."""
        ready = sum(robot.missing() is None for robot in self.robots)
        names = ", ".join(robot.name for robot in self.robots)
        return "<Swarm of %s: %d of %d ready>" % (names, ready, len(self.robots))


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
