"""Finds the robots to calibrate in the reports of the drivers."""

import time
from typing import Dict, List, Optional, Sequence

from hero_client.ros.drivers import Drivers
from hero_msgs.msg import Robot
from hero_node.ros.program import Program

from ..errors import CalibrationError
from .ros_probe import RosProbe

TIMEOUT_S = 10.0


def find_robots(program: Program, robot_ids: Optional[Sequence[int]]) -> List[RosProbe]:
    """Return the robots with these ids, None: all that are ready; those that are not connected have failed.

    Raises: CalibrationError without a driver, without a robot, or while all robots are stopped.
    """
    drivers = Drivers()
    try:
        states = _wait_for_robots(program, drivers, robot_ids)
    finally:
        drivers.close()
    ready = {robot_id for robot_id, state in states.items() if state == Robot.READY}
    wanted = sorted(ready if robot_ids is None else robot_ids)
    for driver in sorted({drivers.find("/hero_%d" % robot_id) for robot_id in wanted}):
        if drivers.is_stopped(driver):
            raise CalibrationError("all robots are stopped; release them: rosservice call %s/stop false" % driver)
    if not ready.intersection(wanted):
        raise CalibrationError("no robot is ready: are they on, and connected to the driver?")
    probes = [RosProbe(robot_id) for robot_id in wanted]
    for probe in probes:
        probe.failure = None if probe.robot_id in ready else "is not connected to the driver: is it on?"
    return probes


def _wait_for_robots(program: Program, drivers: Drivers, robot_ids: Optional[Sequence[int]]) -> Dict[int, int]:
    """Return the states of all robots by id, as soon as those wanted are ready, or after TIMEOUT_S."""
    report = None
    states: Dict[int, int] = {}
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        if not program.sleep(0.05):
            raise CalibrationError("ended before a robot was found")
        report = drivers.read()
        states = {robot.id: robot.state for robot in report.robots if robot.id >= 0} if report else {}
        ready = {robot_id for robot_id, state in states.items() if state == Robot.READY}
        if ready and (drivers.is_settled if robot_ids is None else ready.issuperset(robot_ids)):
            break
    if report is None:
        raise CalibrationError(
            "no driver: nothing on /hero_driver/robots; start roslaunch hero_bringup hero_bringup.launch"
        )
    return states
