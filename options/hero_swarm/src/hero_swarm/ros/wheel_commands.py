"""Speeds to robots over ROS: velocities, or servo pulses if `calibrate motors` has measured their dead zones."""

from typing import Dict, List, Optional

import numpy as np
import rospy

from hero_client import Swarm
from hero_msgs.msg import Motor
from hero_node import list_names
from hero_node.files import read_calibrations
from hero_sim.stepped import StepSwarm

from ..behavior import PULSES
from ..wheel_pulses import find_pulses, list_dead_zones


def _find_dead_zones(folder: str, simulated: int) -> Dict[str, List[float]]:
    """Return the dead zones of the files of `calibrate`; files that cannot be used are logged.

    Those of the robots of `hero_sim --count SIMULATED` are as `calibrate motors` would find them.
    """
    edges_us = list_dead_zones(StepSwarm(simulated).rows.world.errors).tolist() if simulated else []
    found = {"hero_%d" % number: own for number, own in enumerate(edges_us)}
    calibrations = read_calibrations(folder)
    for problem in calibrations.problems.values():
        rospy.logwarn("a calibration is not used: %s", problem)
    for name, kept in calibrations.found.items():
        found[name] = kept.values.get("dead_zones_us", found.get(name))
    return {name: own for name, own in found.items() if own}


class WheelCommands:
    """Commands to all robots of a swarm."""

    def __init__(self, swarm: Swarm, drive: str, folder: str, simulated: int = 0) -> None:
        """Take the dead zones from folder if drive is "pulses".

        simulated: this many robots are those of a simulator with seed 0; their motors are as if calibrated.
        """
        self._swarm = swarm
        self._publishers: List[rospy.Publisher] = []
        self._dead_zones_us: Optional[np.ndarray] = None
        if drive != PULSES:
            return
        found = _find_dead_zones(folder, simulated)
        names = ["hero_%d" % robot.robot_id for robot in swarm]
        missing = [name for name in names if name not in found]
        if missing:
            rospy.logwarn(
                "the motors of %s are not calibrated (~calibration_folder %r): all robots are driven by their velocity"
                " controllers, which the wheels follow late; see rosrun hero_calibration calibrate motors",
                list_names(missing), folder,
            )  # fmt: skip
            return
        self._dead_zones_us = np.array([found[name] for name in names])
        self._publishers = [
            rospy.Publisher(f"/{name}/cmd_motor", Motor, queue_size=1, tcp_nodelay=True) for name in names
        ]

    def send(self, linear_m_s: np.ndarray, angular_rad_s: np.ndarray, may_move: np.ndarray) -> None:
        """Send speeds (R,) to the robots that may move (R,), and stop the others."""
        speeds = np.where(may_move, (linear_m_s, angular_rad_s), 0.0)
        if self._dead_zones_us is None:
            for robot, speed in zip(self._swarm, speeds.T.tolist()):
                robot.drive(*speed)
            return
        left_us, right_us = find_pulses(speeds[0], speeds[1], self._dead_zones_us)
        moves = speeds.any(axis=0).tolist()
        for row, (robot, publisher) in enumerate(zip(self._swarm, self._publishers)):
            if moves[row]:
                publisher.publish(Motor(int(left_us[row]), int(right_us[row])))
            else:
                # A zero velocity switches the servos off: a wheel rests wherever its center is.
                robot.drive(0.0, 0.0)
