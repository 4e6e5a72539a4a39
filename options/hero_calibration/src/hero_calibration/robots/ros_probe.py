"""Robots under calibration over ROS: topics and services of each, and the session with its time and its end."""

import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_client import RobotNotReadyError
from hero_client.ros import share_drivers
from hero_msgs.msg import Encoder, Motor, RobotPose, RobotPoses
from hero_msgs.srv import SetIRCalibration, SetMotor, SetPID
from hero_node import Pose, one_line, pose_of
from hero_node.robot_constants import TICKS_PER_TURN
from hero_node.ros import Program

from ..errors import CalibrationError
from ..models.infrared_model import read_signals
from .probe import Probe
from .session import Session

SERVICE_WAIT_S, TIMEOUT_S = 5.0, 10.0

SERVICES: Dict[str, Tuple[str, Any, Callable[[float], float]]] = {
    "motor_centers_us": ("motors_parameters", SetMotor, round),
    "velocity_gains": ("velocity_controller/pid_parameters", SetPID, float),
    "infrared_counts_m2": ("ir_calibration", SetIRCalibration, float),
}
"""Service that writes each of the SETTINGS, and the type of its numbers."""

STOCK_TICKS = {"hero_plus": TICKS_PER_TURN / 96.0}
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
    try:
        ready = drivers.wait_for_robots(TIMEOUT_S, program.sleep, robot_ids)
    except RobotNotReadyError as error:
        raise CalibrationError(str(error) if program.running else "ended before a robot was found") from None
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
