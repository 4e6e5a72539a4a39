"""One robot on its topics and services, as a calibration needs it: raw readings, raw commands. Knows topics only.

Encoder readings are kept with their stamps and numbers: see encoder_steps.
"""

import threading
import time
from collections import deque
from typing import Any, Deque, List, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_client.geometry import Pose, yaw_of
from hero_msgs.msg import Encoder, Motor

from .encoder_steps import Readings, count_steps
from .errors import CalibrationError
from .infrared import BEAMS, average, read_signals

KEPT_READINGS = 4000
"""Two minutes of encoder readings."""

STALE_S = 3.0
"""Wall time; encoder readings come 29 times a second, scans 5 times. Wi-Fi may stand still for a second or two."""

SERVICE_WAIT_S = 5.0


class Probe:
    """One robot.

    Attributes:
        robot_id, name: 3, "hero_3".
        failure: why it takes no further part, in words; None while it does.
    """

    def __init__(self, robot_id: int) -> None:
        """Connect to the topics of /hero_{robot_id}."""
        self.robot_id = robot_id
        self.name = "hero_%d" % robot_id
        self.failure: Optional[str] = None
        self._lock = threading.Lock()
        self._encoder: Deque[Tuple[float, int, float, float, float]] = deque(maxlen=KEPT_READINGS)
        self._last_seq = 0
        self._count = 0
        self._scans: Deque[Tuple[List[float], List[float]]] = deque(maxlen=200)
        self._pose: Optional[Pose] = None
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

    # -- what comes in (threads of rospy) ------------------------------------------------------------------

    def _receive_encoder(self, message: Encoder) -> None:
        with self._lock:
            self._heard_s["encoder"] = time.monotonic()
            # The driver numbers readings; a number is missing where this program was too slow.
            lost = message.header.seq - self._last_seq - 1
            self._count += 1 + (lost if 0 < lost < KEPT_READINGS else 0)
            self._last_seq = message.header.seq
            stamp_s = message.header.stamp.to_sec()
            self._encoder.append(
                (stamp_s, self._count, message.left_ticks, message.right_ticks, rospy.get_time())
            )

    def _receive_scan(self, message: LaserScan) -> None:
        with self._lock:
            self._heard_s["laser"] = time.monotonic()
            self._scans.append((read_signals(message.intensities), read_signals(message.ranges)))

    def _receive_odometry(self, message: Odometry) -> None:
        pose = message.pose.pose
        with self._lock:
            self._heard_s["odom"] = time.monotonic()
            self._pose = Pose(pose.position.x, pose.position.y, yaw_of(pose.orientation))

    # -- what was seen -------------------------------------------------------------------------------------

    def find_silence(self) -> Optional[str]:
        """Return what is missing of the robot, in words; None if all comes in."""
        for topic, heard_s in sorted(self._heard_s.items()):
            if time.monotonic() - heard_s > STALE_S:
                return "nothing comes on /%s/%s: is the robot on and in reach?" % (self.name, topic)
        for publisher in (self._motors, self._velocity, self._position):
            if not publisher.get_num_connections():
                return "nobody takes %s: does the driver run?" % publisher.name
        return None

    def read_wheels(self) -> Readings:
        """Return the readings of the encoders of the last two minutes."""
        with self._lock:
            table = np.array(self._encoder).reshape(-1, 5)
        return count_steps(*table.T)

    def forget_scans(self) -> None:
        """Begin to collect scans anew."""
        with self._lock:
            self._scans.clear()

    def count_scans(self) -> int:
        """Return how many scans came since forget_scans()."""
        with self._lock:
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

    def read_pose(self) -> Pose:
        """Return the newest pose. Raises: CalibrationError if none came lately."""
        with self._lock:
            pose, heard_s = self._pose, self._heard_s["odom"]
        if pose is None or time.monotonic() - heard_s > STALE_S:
            raise CalibrationError("nothing comes on /%s/odom any more: has the robot gone?" % self.name)
        return pose

    # -- what it is told -----------------------------------------------------------------------------------

    def drive(self, turn_rad_s: float) -> None:
        """Turn on the spot with this speed, 0 stops; under the velocity controller."""
        twist = Twist()
        twist.angular.z = turn_rad_s
        self._velocity.publish(twist)

    def turn(self, angle_rad: float) -> None:
        """Turn by an angle: the position controller goes as far as the speed reaches in a second."""
        twist = Twist()
        twist.angular.z = angle_rad
        self._position.publish(twist)

    def push(self, pulse_us: int) -> None:
        """Give both servos a pulse."""
        self._motors.publish(Motor(pulse_us, pulse_us))

    def call(self, service: str, kind: Any, *values: float) -> None:
        """Call a service of the robot. Raises: CalibrationError with the reason if it fails."""
        name = "/%s/%s" % (self.name, service)
        try:
            rospy.wait_for_service(name, SERVICE_WAIT_S)
            answer = rospy.ServiceProxy(name, kind)(*values)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise CalibrationError("%s: %s" % (name, " ".join(str(error).split()))) from error
        if not answer.success:
            raise CalibrationError("%s: the robot says: %s" % (name, answer.message))
