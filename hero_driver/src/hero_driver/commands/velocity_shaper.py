"""Shapes a stream of motion commands so that the robot accepts all of them and a stop is never lost.

The firmware drops a velocity within 50 ms of the last accepted one, stops included (VelocityControl.ino:159,
PositionControl.ino:160). So the newest command wins, commands are spaced, and a stop is always sent, twice. Servo
pulses (cmd_motor) are shaped alike: the robot reads every 51 ms, and none may pile up in front of a stop. Pure.
"""

import math
import struct
from typing import Optional

from hero_node.robot_constants import SERVO_CENTER_US
from hero_node.ros_messages import TWIST_FORM

COMMAND_INTERVAL_S = 0.06
"""Time between two commands to one controller: the firmware drops one within 50 ms of the last accepted one."""

STOP_REPEATS = 1
"""Number of repetitions of a stop."""

ZERO_TWIST = bytes(TWIST_FORM.size)

STOPPED_MOTORS = struct.pack("<hh", SERVO_CENTER_US, SERVO_CENTER_US)

STOP_PAYLOADS = {"geometry_msgs/Twist": ZERO_TWIST, "hero_msgs/Motor": STOPPED_MOTORS}
"""Message types that move a robot, and the payload of each that stops it."""


def check_twist(payload: bytes) -> Optional[bytes]:
    """Return what to send for a geometry_msgs/Twist: ZERO_TWIST for a stop; None if a component is not finite.

    The robot uses only linear.x and angular.z, and clamps both.
    """
    if len(payload) != TWIST_FORM.size:
        return None
    components = TWIST_FORM.unpack(payload)
    # A sum of finite numbers may overflow; only then are the six looked at one by one.
    if not math.isfinite(sum(components)) and not all(map(math.isfinite, components)):
        return None
    return ZERO_TWIST if components[0] == 0.0 and components[5] == 0.0 else payload


def check_motor_pulses(payload: bytes) -> Optional[bytes]:
    """Return payload (hero_msgs/Motor) unchanged, or None if it has another length."""
    return payload if len(payload) == len(STOPPED_MOTORS) else None


class VelocityShaper:
    """The pending commands of one motion topic of one robot: a stop, which nothing replaces, and one later command."""

    def __init__(self, stop_payload: bytes = ZERO_TWIST) -> None:
        """stop_payload: the message of this topic that stops the robot."""
        self._stop_payload = stop_payload
        self._stop_pending = False
        self._newest: Optional[bytes] = None
        self._repeats_left = 0
        self._next_s = -math.inf

    @property
    def has_stop(self) -> bool:
        """Return whether a stop, or its repeat, waits to be sent."""
        return self._stop_pending or self._repeats_left > 0

    @property
    def has_motion(self) -> bool:
        """Return whether a command that is no stop waits to be sent."""
        return self._newest is not None

    @property
    def is_idle(self) -> bool:
        """Return whether nothing waits to be sent."""
        return self._newest is None and not self._stop_pending and not self._repeats_left

    def offer(self, payload: bytes) -> None:
        """Take a checked command; it replaces one that waits, except a stop."""
        if payload == self._stop_payload:
            self._stop_pending = True
            self._newest = None
        else:
            self._newest = payload

    def discard_motion(self) -> None:
        """Drop pending motion, but not stops."""
        self._newest = None

    def delay_until(self, next_s: float) -> None:
        """Send nothing before next_s: another command went to the same controller."""
        self._next_s = max(self._next_s, next_s)

    def due_in_s(self, now_s: float) -> Optional[float]:
        """Return in how many seconds take() has something, None if nothing waits."""
        if self.is_idle:
            return None
        return max(0.0, self._next_s - now_s)

    def take(self, now_s: float, stops_only: bool = False) -> Optional[bytes]:
        """Return the payload to send now, if any; with stops_only nothing but a stop."""
        if now_s < self._next_s:
            return None
        if self._stop_pending:
            payload = self._stop_payload
            self._stop_pending = False
            self._repeats_left = STOP_REPEATS
        elif self._newest is not None and not stops_only:
            payload = self._newest
            self._newest = None
            self._repeats_left = 0
        elif self._repeats_left:
            payload = self._stop_payload
            self._repeats_left -= 1
        else:
            return None
        self._next_s = now_s + COMMAND_INTERVAL_S
        return payload
