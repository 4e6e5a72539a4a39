"""One robot under calibration: what was received of it, and the raw commands that a procedure gives it. Knows no ROS.

How commands reach the robot, and its data this program, is up to a subclass: over topics (ros_probe), or stepped.
"""

import math
import threading
from abc import ABC, abstractmethod
from collections import deque
from typing import Deque, Dict, List, Optional, Sequence, Tuple

import numpy as np

from hero_node import Pose
from hero_node.robot_constants import BEAMS

from ..errors import CalibrationError
from ..models.encoder_readings import Readings, make_readings
from ..models.infrared_model import average

KEPT_READINGS = 4000
"""Two minutes of encoder readings."""

KEPT_SCANS = 200

STALE_S = 3.0
"""Encoder readings come 29 times a second, scans 5 times. Wi-Fi may stall for a second or two."""


class Probe(ABC):
    """One robot. Times are those of the session's clock.

    robot_id, name: 3, "hero_3".
    model: as its driver reports it.
    failure: why it takes no further part, as text; None while it does.
    pose: the newest one by odometry.
    """

    def __init__(self, robot_id: int, model: str = "hero") -> None:
        """Start without data of /hero_{robot_id}."""
        self.robot_id = robot_id
        self.model = model
        self.name = "hero_%d" % robot_id
        self.failure: Optional[str] = None
        self.pose = Pose(0.0, 0.0, 0.0)
        self._lock = threading.Lock()  # the receiving threads are not the procedure's
        self._encoder: Deque[Tuple[float, int, float, float, float]] = deque(maxlen=KEPT_READINGS)
        self._last_seq = 0
        self._count = 0
        self._scans: Deque[Tuple[Sequence[float], Sequence[float]]] = deque(maxlen=KEPT_SCANS)
        self._places: Deque[Tuple[float, Pose]] = deque(maxlen=KEPT_SCANS)
        self._heard_s: Dict[str, float] = dict.fromkeys(("encoder", "laser", "odom"), -math.inf)

    def receive_encoder(self, heard_s: float, stamp_s: float, seq: int, left_ticks: float, right_ticks: float) -> None:
        """Keep an encoder reading; heard_s: when it arrived, stamp_s: when it was made, by the robot's clock."""
        with self._lock:
            self._heard_s["encoder"] = heard_s
            # The driver numbers readings; a number is missing if this program was too slow.
            lost = seq - self._last_seq - 1
            self._count += 1 + (lost if 0 < lost < KEPT_READINGS else 0)
            self._last_seq = seq
            self._encoder.append((stamp_s, self._count, left_ticks, right_ticks, heard_s))

    def receive_scan(self, heard_s: float, signals: Sequence[float], ranges_m: Sequence[float]) -> None:
        """Keep the readings (counts) and ranges of all infrared sensors."""
        with self._lock:
            self._heard_s["laser"] = heard_s
            self._scans.append((signals, ranges_m))

    def receive_pose(self, heard_s: float, pose: Pose) -> None:
        """Keep a pose of the odometry."""
        self.pose = pose
        self._heard_s["odom"] = heard_s

    def receive_place(self, heard_s: float, place: Pose) -> None:
        """Keep a measured pose in the common frame."""
        with self._lock:
            self._places.append((heard_s, place))

    def find_place(self, since_s: float) -> Optional[Pose]:
        """Return the average of the measured poses since a time at which it stopped; None without any."""
        with self._lock:
            places = [place for heard_s, place in self._places if heard_s >= since_s]
        if not places:
            return None
        x_m, y_m, yaw_rad = np.array(places).T
        mean_rad = math.atan2(np.sin(yaw_rad).sum(), np.cos(yaw_rad).sum())
        return Pose(float(x_m.mean()), float(y_m.mean()), mean_rad)

    def find_silence(self, now_s: float) -> Optional[str]:
        """Return what is missing of the robot, as text; None if all its topics are alive."""
        for topic, heard_s in self._heard_s.items():
            if now_s - heard_s > STALE_S:
                return f"nothing received on /{self.name}/{topic}: is the robot on and in reach?"
        return None

    def check_alive(self, now_s: float) -> None:
        """Raise CalibrationError with what is missing of the robot, if anything."""
        silence = self.find_silence(now_s)
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
            raise CalibrationError(f"no infrared readings came on /{self.name}/laser")
        signals, ranges_m = np.array(scans).transpose(1, 0, 2)
        return average(signals), average(ranges_m)

    @abstractmethod
    def drive(self, angular_rad_s: float, linear_m_s: float = 0.0) -> None:
        """Turn on the spot, or drive, under the velocity controller."""

    @abstractmethod
    def turn(self, angle_rad: float) -> None:
        """Turn by an angle under the position controller, which goes as far as the speed reaches in a second."""

    @abstractmethod
    def set_pulses(self, left_us: int, right_us: int) -> None:
        """Set the pulses of the servos."""

    @abstractmethod
    def stop(self) -> None:
        """Stop, whichever controller drives: a zero for one leaves the other driving."""

    @abstractmethod
    def write(self, key: str, values: List[float]) -> None:
        """Write one of SETTINGS of hero_node.files.calibration_file to the robot's flash; wait until it is there.

        Raises: CalibrationError with the reason if it fails.
        """
