"""The packets that a robot sends 29 times a second, from its wheels, infrared sensors and IMU, and its light.

Pure. Order within a cycle and gates as measured on the stock robot: imu, laser, odom, five transforms,
encoder.
"""

import struct
from typing import List, Tuple

import numpy as np

from hero_driver.rosserial import packets
from hero_node import Pose

from ..robot_constants import LED_WATCHDOG_MS
from ..world.body import Body
from . import messages
from .clock import NEVER_MS
from .flash import Flash
from .imu_hat import ImuHat
from .models import HERO, RobotModel
from .ranges import convert_to_ranges
from .wheel_odometry import WheelOdometry

CYCLE_MS = 34
"""Time between two odoms: 1000/30 + 1."""

LASER_GATE_MS = 200
"""/laser comes with the first cycle after more than this."""

LASER_READ_MS = 1
"""Delay of the cycle by reading the infrared sensors; with it /laser comes every 205 ms, as measured."""

DISTANCE_MS = 50
"""Time between two readings of the distance sensor (tof.ino of HeRo+: continuous, every 50 ms)."""

BLUE_MS = 2000
"""Time that the light is blue after startup."""

Color = Tuple[float, ...]  # red, green, blue, alpha (0..1)

_BLUE: Color = (0.0, 0.0, 1.0, 1.0)
_RED: Color = (1.0, 0.0, 0.0, 1.0)
_DARK: Color = (0.0, 0.0, 0.0, 0.0)


class Sensing:
    """Odometry, encoders, infrared sensors, IMU and light of one robot; times are the robot's own.

    Attributes:
        due_ms, distance_due_ms: when run_cycle() and measure_distance() have to be called.
        laser_enabled: whether /laser is sent; not kept over a restart.
        odometry: the robot's own view of its wheels.
    """

    def __init__(self, name: str, body: Body, has_imu_hat: bool, flash: Flash, model: RobotModel = HERO) -> None:
        """Build the sensors of the robot called name (hero_N)."""
        self.distance_due_ms = 0 if model.is_plus else NEVER_MS
        self._name = name
        self._ids = model.sent_ids
        self.due_ms = 0
        self.laser_enabled = True
        left_m, right_m = body.travels_m
        self.odometry = WheelOdometry(left_m, right_m, model.tick_m)
        self._body = body
        self._flash = flash
        self._imu = ImuHat(body.true_pose.yaw_rad) if has_imu_hat and not model.is_plus else None
        self._cycle_messages = messages.CycleMessages(name, model)
        self._laser_seq = 0
        self._laser_at_ms = 0
        self._light = _DARK
        self._light_until_ms = 0

    def set_odometry(self, pose: Pose) -> None:
        """Set the odometry's pose."""
        self.odometry.set_pose(pose)
        self._body.set_odometry(pose)

    def begin(self, now_ms: int) -> None:
        """Start at the first pass of loop()."""
        self.due_ms = now_ms
        self._light, self._light_until_ms = _BLUE, now_ms + BLUE_MS

    def show_searching(self) -> None:
        """Light up red, as while looking for the network."""
        self._light, self._light_until_ms = _RED, NEVER_MS

    def set_light(self, now_ms: int, color: Color) -> None:
        """Obey a command for the light."""
        self._light, self._light_until_ms = color, now_ms + LED_WATCHDOG_MS

    def show_light(self, now_ms: int) -> Color:
        """Return the visible color."""
        return self._light if now_ms <= self._light_until_ms else _DARK

    def run_cycle(self, now_ms: int, stamp: Tuple[int, int]) -> bytes:
        """Return the packets of one cycle."""
        parts: List[bytes] = []
        odometry = self.odometry
        odometry.integrate()
        if self._imu is not None:
            parts.append(self._measure_imu(self._imu, now_ms, stamp))
        if self.laser_enabled and now_ms - self._laser_at_ms > LASER_GATE_MS:
            self._laser_at_ms = now_ms
            parts.append(self._measure_laser(stamp))
        shown = (odometry.pose, odometry.twist, odometry.ticks)
        odometry.read_encoders(now_ms * 1000, *self._body.read_wheels(now_ms))
        parts.append(self._cycle_messages.encode(stamp, *shown, odometry.list_encoder_values()))
        self.due_ms = now_ms + CYCLE_MS
        if self.laser_enabled and self.due_ms - self._laser_at_ms > LASER_GATE_MS:
            self.due_ms += LASER_READ_MS
            self._body.expect_infrared(self.due_ms)
        return b"".join(parts)

    def measure_distance(self, now_ms: int) -> bytes:
        """Return the packet of the distance sensor."""
        self.distance_due_ms = now_ms + DISTANCE_MS
        return packets.encode_packet(self._ids["distance"], struct.pack("<f", self._body.read_distance()))

    def _measure_laser(self, stamp: Tuple[int, int]) -> bytes:
        self._laser_seq += 1
        counts = self._body.read_infrared()
        ranges_m = convert_to_ranges(counts, np.array(self._flash.ir_calibration_counts_m2))
        payload = messages.encode_laser(self._name, self._laser_seq, stamp, ranges_m.tolist(), counts.tolist())
        return packets.encode_packet(self._ids["laser"], payload)

    def _measure_imu(self, imu: ImuHat, now_ms: int, stamp: Tuple[int, int]) -> bytes:
        heading_rad, angular_counts = imu.read(now_ms, self._body.true_pose.yaw_rad, self._body.angular_rad_s)
        self.odometry.set_heading(heading_rad)
        payload = messages.encode_imu(self._name, stamp, heading_rad, angular_counts)
        return packets.encode_packet(self._ids["imu"], payload)
