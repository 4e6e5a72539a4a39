"""Wheels and infrared of one robot -> the frames that it sends 29 times a second.

Pure. Order within a cycle and gates as measured on the stock robot: imu, laser, odom, five transforms,
encoder.
"""

from typing import List, Tuple

import numpy as np

from ..robot_constants import LED_WATCHDOG_MS
from ..world.body import Body
from ..world.kinematics import compose, invert
from ..world.range_sensors import convert_to_ranges
from . import messages
from .flash import Flash
from .imu_hat import ImuHat
from .wheel_odometry import WheelOdometry

CYCLE_MS = 34
"""Between two odoms: 1000/30 + 1."""

LASER_GATE_MS = 200
"""/laser comes with the first cycle after more than this."""

LASER_READ_MS = 1
"""How long reading the infrared sensors holds the cycle up; with it /laser comes every 205 ms, as
measured."""

BLUE_MS = 2000
"""So long the light is blue after the robot came up."""

_BLUE = (0.0, 0.0, 1.0, 1.0)
_RED = (1.0, 0.0, 0.0, 1.0)
_DARK = (0.0, 0.0, 0.0, 0.0)


class Sensing:
    """Odometry, encoders, infrared sensors, IMU and light of one robot; times are the robot's own.

    Attributes:
        due_ms: when run_cycle() has to be called.
        laser_enabled: whether /laser is sent; not kept over a restart.
        odometry: what the robot believes of its wheels.
    """

    def __init__(self, name: str, body: Body, imu_hat: bool, exact_odometry: bool, flash: Flash) -> None:
        """Build the sensors of the robot called name (hero_N)."""
        self.due_ms = 0
        self.laser_enabled = True
        self.odometry = WheelOdometry(exact_odometry, *body.world.travels_m[body.index].tolist())
        self._body = body
        self._imu_hat = imu_hat
        self._flash = flash
        self._cycle_messages = messages.CycleMessages(name)
        self._laser_messages = messages.LaserMessages(name)
        self._imu_messages = messages.ImuMessages(name)
        self._laser_seq = 0
        self._laser_at_ms = 0
        self._imu_heading_rad = 0.0
        self._imu = ImuHat(float(body.world.poses[body.index, 2]))
        self._light = _DARK
        self._light_until_ms = 0

    def set_odometry(self, x_m: float, y_m: float, theta_rad: float) -> None:
        """Take a pose for the odometry."""
        self.odometry.set_pose(x_m, y_m, theta_rad)
        self._body.odom_origin = compose(self._body.true_pose, invert((x_m, y_m, theta_rad)))

    def begin(self, now_ms: int) -> None:
        """Be told that loop() begins."""
        self.due_ms = now_ms
        self._light, self._light_until_ms = _BLUE, now_ms + BLUE_MS

    def show_searching(self) -> None:
        """Light up red, as while looking for the network."""
        self._light, self._light_until_ms = _RED, 2**62

    def show_dark(self) -> None:
        """Put the light out."""
        self._light = _DARK

    def set_light(self, now_ms: int, color: Tuple[float, float, float, float]) -> None:
        """Take a command for the light: red, green, blue, alpha (0..1)."""
        self._light, self._light_until_ms = color, now_ms + LED_WATCHDOG_MS

    def show_light(self, now_ms: int) -> Tuple[float, float, float, float]:
        """Return the colour that people see."""
        return self._light if now_ms <= self._light_until_ms else _DARK

    def read_encoders(self, millis: int, now_ms: int) -> None:
        """Read the encoders, which takes the last interval away from the odometry."""
        self.odometry.read_encoders(millis * 1000, *self._body.read_wheels(now_ms))

    def run_cycle(self, millis: int, now_ms: int, stamp: Tuple[int, int]) -> bytes:
        """Return the frames of one cycle; millis is the robot's time, now_ms the world's."""
        parts: List[bytes] = []
        if self._imu_hat:
            parts.append(self._measure_imu(millis, stamp))
        if self.laser_enabled and millis - self._laser_at_ms > LASER_GATE_MS:
            self._laser_at_ms = millis
            self._laser_seq += 1
            parts.append(self._measure_laser(stamp))
        odometry = self.odometry
        odometry.integrate()
        if self._imu_hat:
            odometry.set_heading(self._imu_heading_rad)
        shown = (odometry.pose, odometry.twist, odometry.ticks)
        self.read_encoders(millis, now_ms)
        parts.append(self._cycle_messages.encode(stamp, *shown, odometry.list_encoder_values()))
        self.due_ms = millis + CYCLE_MS
        if self.laser_enabled and self.due_ms - self._laser_at_ms > LASER_GATE_MS:
            self.due_ms += LASER_READ_MS
        return b"".join(parts)

    def _measure_laser(self, stamp: Tuple[int, int]) -> bytes:
        body = self._body
        counts = body.world.read_infrared(np.array([body.index]))[0]
        ranges_m = convert_to_ranges(counts, np.array(self._flash.ir_calibration_counts_m2))
        return self._laser_messages.encode(self._laser_seq, stamp, ranges_m.tolist(), counts.tolist())

    def _measure_imu(self, millis: int, stamp: Tuple[int, int]) -> bytes:
        world, index = self._body.world, self._body.index
        turn_rad_s = float(world.measure_body_speeds()[index, 1])
        reading = self._imu.read(millis, float(world.poses[index, 2]), turn_rad_s)
        self._imu_heading_rad = reading.heading_rad
        return self._imu_messages.encode(stamp, reading.quaternion, reading.turn_counts, reading.acceleration)
