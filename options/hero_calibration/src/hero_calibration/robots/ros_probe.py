"""A robot under calibration over its topics and services."""

from typing import Any, Callable, Dict, List, Optional, Tuple

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_msgs.msg import Encoder, Motor, RobotPose, RobotPoses
from hero_msgs.srv import SetIRCalibration, SetMotor, SetPID
from hero_node import Pose, one_line, pose_of

from ..errors import CalibrationError
from ..models.infrared_model import read_signals
from .probe import Probe

SERVICE_WAIT_S = 5.0

SERVICES: Dict[str, Tuple[str, Any, Callable[[float], float]]] = {
    "motor_centers_us": ("motors_parameters", SetMotor, round),
    "velocity_gains": ("velocity_controller/pid_parameters", SetPID, float),
    "infrared_counts_m2": ("ir_calibration", SetIRCalibration, float),
}
"""Service that writes each of the SETTINGS, and the type of its numbers."""

STOCK_TICKS = {"hero_plus": 288.0 / 96.0}
"""Ticks of the stock robot in one of another model (docs/robot_interface.md); their wheels differ by less than 4 %."""


class RosProbe(Probe):
    """One robot; times are ROS time."""

    def __init__(self, robot_id: int, model: str) -> None:
        """Connect to the topics of /hero_{robot_id}."""
        super().__init__(robot_id, model)
        self._stock_ticks = STOCK_TICKS.get(model, 1.0)
        self._velocity = self._advertise("velocity_controller/cmd_vel", Twist)
        self._position = self._advertise("position_controller/cmd_vel", Twist)
        self._motors = self._advertise("cmd_motor", Motor)
        for topic, kind, receive in (
            ("encoder", Encoder, self._take_encoder),
            ("laser", LaserScan, self._take_scan),
            ("odom", Odometry, self._take_odometry),
        ):
            rospy.Subscriber(f"/{self.name}/{topic}", kind, receive, queue_size=20, tcp_nodelay=True)

        rospy.Subscriber("/localization/poses", RobotPoses, self._take_places, queue_size=2, tcp_nodelay=True)

    def _advertise(self, topic: str, kind: Any) -> rospy.Publisher:
        return rospy.Publisher(f"/{self.name}/{topic}", kind, queue_size=2, tcp_nodelay=True)

    def _take_encoder(self, message: Encoder) -> None:
        header = message.header
        left_ticks, right_ticks = (ticks * self._stock_ticks for ticks in (message.left_ticks, message.right_ticks))
        self.receive_encoder(rospy.get_time(), header.stamp.to_sec(), header.seq, left_ticks, right_ticks)

    def _take_scan(self, message: LaserScan) -> None:
        self.receive_scan(rospy.get_time(), read_signals(message.intensities), read_signals(message.ranges))

    def _take_odometry(self, message: Odometry) -> None:
        pose = message.pose.pose
        self.receive_pose(rospy.get_time(), pose_of(pose.position, pose.orientation))

    def _take_places(self, report: RobotPoses) -> None:
        for robot in report.robots:
            if robot.id == self.robot_id and robot.state == RobotPose.TRACKED:
                self.receive_place(rospy.get_time(), Pose(robot.x, robot.y, robot.yaw))

    def find_silence(self, now_s: float) -> Optional[str]:
        """Return what is missing of the robot or its driver, as text; None if all its topics are alive."""
        silence = super().find_silence(now_s)
        for publisher in (self._motors, self._velocity, self._position):
            if silence is None and not publisher.get_num_connections():
                silence = f"nothing subscribes to {publisher.name}: is the driver running?"
        return silence

    def drive(self, angular_rad_s: float, linear_m_s: float = 0.0) -> None:
        self._velocity.publish(Twist(Vector3(x=linear_m_s), Vector3(z=angular_rad_s)))

    def turn(self, angle_rad: float) -> None:
        self._position.publish(Twist(angular=Vector3(z=angle_rad)))

    def set_pulses(self, left_us: int, right_us: int) -> None:
        self._motors.publish(Motor(left_us, right_us))

    def stop(self) -> None:
        self.drive(0.0)
        self.turn(0.0)

    def write(self, key: str, values: List[float]) -> None:
        service, kind, number = SERVICES[key]
        name = f"/{self.name}/{service}"
        try:
            rospy.wait_for_service(name, SERVICE_WAIT_S)
            answer = rospy.ServiceProxy(name, kind)(*map(number, values))
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise CalibrationError(f"{name}: {one_line(error)}") from error
        if not answer.success:
            raise CalibrationError(f"{name}: the robot answers: {answer.message}")
