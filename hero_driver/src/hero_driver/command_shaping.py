"""Turns a stream of velocity commands into one that the robot accepts whole, so that a stop is never lost.

The firmware drops a velocity that arrives within 50 ms of the last accepted one, stops included
(VelocityControl.ino:159, PositionControl.ino:160). So: newest wins, commands are spaced, a zero is always
sent and sent once more. Pure: payloads and time go in, payloads come out.
"""

import math
import struct
from typing import Optional

COMMAND_INTERVAL_S = 0.06
"""Time between two velocities to one robot: the firmware's 50 ms and some room for its 51 ms read cycle."""

ZERO_REPEATS = 1
"""How often a zero is sent again."""

LINEAR_LIMIT_M_S = 0.20
"""The firmware's own limit (config.h:60)."""

TURN_LIMIT_RAD_S = 8.0
"""The firmware's own limit (config.h:61)."""

TWIST_LENGTH = 48
_TWIST = struct.Struct("<6d")

ZERO_TWIST = bytes(TWIST_LENGTH)

MOTOR_HALT_US = 1500
HALTED_MOTORS = struct.pack("<hh", MOTOR_HALT_US, MOTOR_HALT_US)


def check_twist(payload: bytes, clamp: bool) -> Optional[bytes]:
    """Return what to send for payload (geometry_msgs/Twist), or None if a component is not finite.

    What tells the robot to stand still becomes ZERO_TWIST: it uses only linear.x and angular.z. With clamp, these
    two are brought into the firmware's limits.
    """
    if len(payload) != TWIST_LENGTH:
        return None
    components = _TWIST.unpack(payload)
    # A sum of finite numbers may overflow; only then are the six looked at one by one.
    if not math.isfinite(sum(components)) and not all(map(math.isfinite, components)):
        return None
    linear_m_s, turn_rad_s = components[0], components[5]
    if linear_m_s == 0.0 and turn_rad_s == 0.0:
        return ZERO_TWIST
    is_within = abs(linear_m_s) <= LINEAR_LIMIT_M_S and abs(turn_rad_s) <= TURN_LIMIT_RAD_S
    if is_within or not clamp:
        return payload
    clamped_m_s = max(-LINEAR_LIMIT_M_S, min(LINEAR_LIMIT_M_S, linear_m_s))
    clamped_rad_s = max(-TURN_LIMIT_RAD_S, min(TURN_LIMIT_RAD_S, turn_rad_s))
    return _TWIST.pack(clamped_m_s, *components[1:5], clamped_rad_s)


class VelocityShaper:
    """The pending velocity commands of one topic of one robot.

    At most one zero and one later command wait; a zero that waits is never replaced by what comes after it.
    """

    def __init__(self, interval_s: float = COMMAND_INTERVAL_S) -> None:
        self._interval_s = interval_s
        self._zero_pending = False
        self._newest: Optional[bytes] = None
        self._repeats_left = 0
        self._next_s = -math.inf

    @property
    def is_idle(self) -> bool:
        """Whether nothing waits to be sent."""
        return not self._zero_pending and self._newest is None and self._repeats_left == 0

    def offer(self, payload: bytes) -> None:
        """Take a command, from check_twist(); it replaces one that waits, except a zero."""
        if payload == ZERO_TWIST:
            self._zero_pending = True
            self._newest = None
        else:
            self._newest = payload

    def discard_motion(self) -> None:
        """Forget what waits except stops; used when motion is held or the robot went away."""
        self._newest = None

    def due_in_s(self, now_s: float) -> Optional[float]:
        """Return in how many seconds take() has something, None if nothing waits."""
        if self.is_idle:
            return None
        return max(0.0, self._next_s - now_s)

    def take(self, now_s: float) -> Optional[bytes]:
        """Return the payload to send now, if any."""
        if now_s < self._next_s:
            return None
        if self._zero_pending:
            payload = ZERO_TWIST
            self._zero_pending = False
            self._repeats_left = ZERO_REPEATS
        elif self._newest is not None:
            payload = self._newest
            self._newest = None
            self._repeats_left = 0
        elif self._repeats_left:
            payload = ZERO_TWIST
            self._repeats_left -= 1
        else:
            return None
        self._next_s = now_s + self._interval_s
        return payload
