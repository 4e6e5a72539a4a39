"""The session over ROS: its robots, as the drivers report them, its time, which may be simulated, and its end."""

import time
from typing import List, Optional, Sequence

import rospy

from hero_client.ros import share_drivers
from hero_msgs.msg import Robot
from hero_node.ros import Program

from ..errors import CalibrationError
from .probe import Probe
from .ros_probe import RosProbe
from .session import Session

TIMEOUT_S = 10.0


class RosSession(Session):
    """The robots under calibration, in ROS time."""

    def __init__(self, program: Program, probes: Sequence[Probe]) -> None:
        """Work with probes until program ends."""
        super().__init__(probes)
        self._program = program
        self._start_s = rospy.get_time() - time.monotonic()

    @property
    def now_s(self) -> float:
        """ROS time, as if the PC's clock were never set: motions are timed by it, and must not last longer for that."""
        return self._start_s + time.monotonic() if rospy.rostime.is_wallclock() else float(rospy.get_time())

    def sleep(self, duration_s: float) -> bool:
        """Sleep by the clock of this computer; return whether the program is to continue."""
        time.sleep(duration_s)
        return self._program.running


def find_robots(program: Program, robot_ids: Optional[Sequence[int]]) -> List[RosProbe]:
    """Return the robots with these ids, None: all that are ready; those that are not connected have failed.

    Raises: CalibrationError without a driver, without a robot, or while all robots are stopped.
    """
    drivers = share_drivers()
    report = None
    ready: List[int] = []
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        if not program.sleep(0.05):
            raise CalibrationError("ended before a robot was found")
        report = drivers.read()
        ready = [robot.id for robot in report.robots if robot.state == Robot.READY and robot.id >= 0] if report else []
        if ready and (drivers.is_settled if robot_ids is None else set(ready).issuperset(robot_ids)):
            break
    if report is None:
        raise CalibrationError(
            "no driver: nothing on /hero_driver/robots; start roslaunch hero_bringup hero_bringup.launch"
        )
    wanted = sorted(ready if robot_ids is None else robot_ids)
    for driver in sorted({drivers.find("/hero_%d" % robot_id) for robot_id in wanted}):
        if drivers.is_stopped(driver):
            raise CalibrationError(f"all robots are stopped; release them: rosservice call {driver}/stop false")
    if not set(ready).intersection(wanted):
        raise CalibrationError("no robot is ready: are they on, and connected to the driver?")
    probes = [RosProbe(robot_id, drivers.find_model("/hero_%d" % robot_id)) for robot_id in wanted]
    for probe in probes:
        probe.failure = None if probe.robot_id in ready else "is not connected to the driver: is it on?"
    return probes
