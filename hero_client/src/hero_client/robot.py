"""One robot as an object: methods send commands, properties return the newest data.

    from hero_client import Robot

    with Robot(0) as robot:
        robot.forward(0.2)
        robot.turn(1.57)
        print(robot.pose, robot.nearest())

All that needs no ROS is in BaseRobot, which robots that are stepped in process (hero_sim.stepped) share.
"""

import atexit
from typing import Any

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from hero_msgs.msg import Encoder
from hero_node import print_error
from hero_node.ros import start_node

from .robots.group import check_robot_id
from .robots.robot_base import COMMAND_S, BaseRobot
from .robots.robot_readings import NEXT_ODOM_S
from .ros.ros_link import RosLink
from .values.errors import StaleDataError


class Robot(BaseRobot):
    """One robot by the number in its name: Robot(3) is /hero_3.

    Data properties return the newest message only while it is fresh, else they raise StaleDataError. Methods that
    drive until something is done (`drive` for a time, `forward`, `turn`, `go_to`) first wait up to 2 s for a robot that
    is not ready, and raise an error if the robot could not do it. As a context manager a Robot stops at the end, also
    after an error.
    """

    _link: RosLink

    def __init__(self, robot_id: int, odom: bool = True, proximity: bool = True) -> None:
        """Connect to the topics of /hero_{robot_id}. Returns at once: see wait_until_ready().

        odom, proximity: whether to subscribe to these; a program that does not need them saves their load. Starts a
        ROS node if the program has none yet.

        Raises: ValueError for a number that no robot can have. NodeError if no ROS master answers within 3 s.
        """
        robot_id = check_robot_id(robot_id)
        start_node()
        super().__init__(robot_id, RosLink(robot_id))
        if odom:
            self._link.subscribe("odom")
        if proximity:
            self._link.subscribe("proximity")
        atexit.register(self._explain_end)

    def _explain_end(self) -> None:
        """Say that the end of a program ends a single command, which its robot would otherwise obey for 2 s."""
        if self._moves_sent == 1 and self.now_s - self._last_move_s < COMMAND_S:
            print_error(
                "%s stops, as the program ends right after drive(): name a time, such as duration_s=2.0, or repeat it"
                " in a loop" % self.name
            )

    def read(self, name: str) -> Any:
        """Return the newest value of a topic that fleet.yaml declares, such as "battery" (README of hero_tools).

        The first use subscribes and waits up to 5 s. Raises: ValueError for a name that is not declared. StaleDataError
        without a message.
        """
        return self._link.read_extra(name, NEXT_ODOM_S)

    @property
    def odometry(self) -> Odometry:
        """The newest nav_msgs/Odometry, with pose (hero_N/odom), velocity and covariances.

        Raises: StaleDataError if it is older than 1 s.
        """
        self._check_fresh("odom")
        return self._link.read("odom")

    @property
    def encoder(self) -> Encoder:
        """The newest hero_msgs/Encoder: ticks, distances and speeds of both wheels.

        The first use subscribes and waits up to 5 s. Raises: StaleDataError if it is older than 1 s.
        """
        self._check_asked("encoder")
        return self._link.read("encoder")

    @property
    def imu(self) -> Imu:
        """The newest sensor_msgs/Imu of a robot with the IMU hat; what its numbers mean: docs/robot_interface.md.

        The first use subscribes and waits up to 5 s. Raises: StaleDataError if it is older than 1 s, or without a hat.
        """
        try:
            self._check_asked("imu")
        except StaleDataError as error:
            raise StaleDataError(f"{error}: only robots with the IMU hat publish it") from None
        return self._link.read("imu")
