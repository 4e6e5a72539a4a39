"""The topics and services of one robot that a calibration needs: raw readings and raw commands."""

import threading
import time
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_client.geometry import Pose, yaw_of
from hero_msgs.msg import Encoder, Motor
from hero_msgs.srv import SetIRCalibration, SetMotor, SetPID

from .encoder_readings import Readings, make_readings
from .errors import CalibrationError
from .infrared_model import BEAMS, average, read_signals

KEPT_READINGS = 4000
"""Two minutes of encoder readings."""

KEPT_SCANS = 200

STALE_S = 3.0
"""Wall time; encoder readings come 29 times a second, scans 5 times. Wi-Fi may stall for a second or two."""

SERVICE_WAIT_S = 5.0


SETTINGS: Dict[str, Tuple[str, Any, Callable[[float], float]]] = {
    "motor_centers_us": ("motors_parameters", SetMotor, round),
    "velocity_gains": ("velocity_controller/pid_parameters", SetPID, float),
    "infrared_counts_m2": ("ir_calibration", SetIRCalibration, float),
}
"""Services that write settings to the robot's flash, and the type of their numbers, by key in its file."""


class Probe:
    """One robot.

    Attributes:
        robot_id, name: 3, "hero_3".
        failure: why it takes no further part, as text; None while it does.
        pose: the newest one by odometry.
    """

    def __init__(self, robot_id: int) -> None:
        """Connect to the topics of /hero_{robot_id}."""
        self.robot_id = robot_id
        self.name = "hero_%d" % robot_id
        self.failure: Optional[str] = None
        self.pose = Pose(0.0, 0.0, 0.0)
        self._lock = threading.Lock()
        self._encoder: Deque[Tuple[float, int, float, float, float]] = deque(maxlen=KEPT_READINGS)
        self._last_seq = 0
        self._count = 0
        self._scans: Deque[Tuple[List[float], List[float]]] = deque(maxlen=KEPT_SCANS)
        self._heard_s = {"encoder": 0.0, "laser": 0.0, "odom": 0.0}
        self._velocity = self._advertise("velocity_controller/cmd_vel", Twist)
        self._position = self._advertise("position_controller/cmd_vel", Twist)
        self._motors = self._advertise("cmd_motor", Motor)
        for topic, kind, receive in (
            ("encoder", Encoder, self._receive_encoder),
            ("laser", LaserScan, self._receive_scan),
            ("odom", Odometry, self._receive_odometry),
        ):
            rospy.Subscriber("/%s/%s" % (self.name, topic), kind, receive, queue_size=20, tcp_nodelay=True)

    def _advertise(self, topic: str, kind: Any) -> rospy.Publisher:
        return rospy.Publisher("/%s/%s" % (self.name, topic), kind, queue_size=2, tcp_nodelay=True)

    # -- received data (threads of rospy) ------------------------------------------------------------------

    def _receive_encoder(self, message: Encoder) -> None:
        with self._lock:
            self._heard_s["encoder"] = time.monotonic()
            # The driver numbers readings; a number is missing if this program was too slow.
            lost = message.header.seq - self._last_seq - 1
            self._count += 1 + (lost if 0 < lost < KEPT_READINGS else 0)
            self._last_seq = message.header.seq
            stamp_s = message.header.stamp.to_sec()
            self._encoder.append((stamp_s, self._count, message.left_ticks, message.right_ticks, rospy.get_time()))

    def _receive_scan(self, message: LaserScan) -> None:
        with self._lock:
            self._heard_s["laser"] = time.monotonic()
            self._scans.append((read_signals(message.intensities), read_signals(message.ranges)))

    def _receive_odometry(self, message: Odometry) -> None:
        position = message.pose.pose.position
        self.pose = Pose(position.x, position.y, yaw_of(message.pose.pose.orientation))
        self._heard_s["odom"] = time.monotonic()

    # -- readings ------------------------------------------------------------------------------------------

    def find_silence(self) -> Optional[str]:
        """Return what is missing of the robot, as text; None if all its topics are alive."""
        for topic, heard_s in sorted(self._heard_s.items()):
            if time.monotonic() - heard_s > STALE_S:
                return "nothing received on /%s/%s: is the robot on and in reach?" % (self.name, topic)
        for publisher in (self._motors, self._velocity, self._position):
            if not publisher.get_num_connections():
                return "nothing subscribes to %s: is the driver running?" % publisher.name
        return None

    def check_alive(self) -> None:
        """Raise CalibrationError with what is missing of the robot, if anything."""
        silence = self.find_silence()
        if silence is not None:
            raise CalibrationError(silence)

    def read_wheels(self) -> Readings:
        """Return the encoder readings of the last two minutes."""
        with self._lock:
            table = np.array(self._encoder).reshape(-1, 5)
        return make_readings(*table.T)

    def forget_scans(self) -> None:
        """Start to collect scans again."""
        with self._lock:
            self._scans.clear()

    def count_scans(self) -> int:
        """Return the number of scans since forget_scans()."""
        return len(self._scans)

    def read_scans(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return the eight readings (counts) and ranges (m), averages since forget_scans().

        Raises: CalibrationError if there were none.
        """
        with self._lock:
            scans = list(self._scans)
        if not scans or any(len(values) != BEAMS for scan in scans for values in scan):
            raise CalibrationError("no infrared readings came on /%s/laser" % self.name)
        signals, ranges_m = np.array(scans).transpose(1, 0, 2)
        return average(signals), average(ranges_m)

    # -- commands ------------------------------------------------------------------------------------------

    def drive(self, angular_rad_s: float) -> None:
        """Turn on the spot under the velocity controller; 0 stops."""
        twist = Twist()
        twist.angular.z = angular_rad_s
        self._velocity.publish(twist)

    def turn(self, angle_rad: float) -> None:
        """Turn by an angle under the position controller, which goes as far as the speed reaches in a second."""
        twist = Twist()
        twist.angular.z = angle_rad
        self._position.publish(twist)

    def set_pulses(self, pulse_us: int) -> None:
        """Set the pulse of both servos."""
        self._motors.publish(Motor(pulse_us, pulse_us))

    def write(self, key: str, values: Sequence[float]) -> None:
        """Write one of SETTINGS to the robot. Raises: CalibrationError with the reason if it fails."""
        service, kind, number = SETTINGS[key]
        name = "/%s/%s" % (self.name, service)
        try:
            rospy.wait_for_service(name, SERVICE_WAIT_S)
            answer = rospy.ServiceProxy(name, kind)(*map(number, values))
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise CalibrationError("%s: %s" % (name, " ".join(str(error).split()))) from error
        if not answer.success:
            raise CalibrationError("%s: the robot answers: %s" % (name, answer.message))
