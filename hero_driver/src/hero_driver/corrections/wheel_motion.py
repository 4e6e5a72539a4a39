"""Tells by encoder readings, or by odometry without them, whether the wheels of a robot turn. Pure.

Rest is counted in readings (29 per second of the robot's time): those that a network held back arrive all at once.
Readings behind which more wait to be read are late, and no evidence: they may be from before a stop.
"""

import collections
import math
from typing import Deque

REST_TICKS = 1.0
"""A wheel at rest on the edge of a tick (0.54 mm) counts it back and forth."""

SETTLED_TICKS = 2.0
"""Wheels that came to rest may still settle by a tick; what creeps passes this sooner or later."""

REST_READINGS = 5
"""Readings without a turn after which wheels are at rest: 0.17 s; 6 mm/s and more would show."""

MOVES_KEPT = 24
"""Readings that show that wheels keep turning: 0.8 s, more than twice what an ordinary stop takes."""

LINEAR_REST_M_S = 0.002
ANGULAR_REST_RAD_S = 0.05
"""Odometry's twist of a robot at rest stays within these."""


class WheelMotion:
    """Motion of the wheels by the readings of one connection that came in time; still_readings: those since a turn.

    is_late: whether the readings that come now are late; set by the receiver.
    """

    def __init__(self) -> None:
        self.is_late = False
        self.readings = 0
        self.still_readings = 0
        self._has_anchor = False
        self._tolerance_ticks = REST_TICKS
        self._left_ticks = self._right_ticks = 0.0
        self._moves: Deque[float] = collections.deque(maxlen=MOVES_KEPT)  # distance of each reading, of any unit

    @property
    def go_on(self) -> bool:
        """Return whether wheels turn and did not slow down by half in the last MOVES_KEPT readings."""
        moves = list(self._moves)
        half = len(moves) // 2
        return self.still_readings < REST_READINGS and 2.0 * sum(moves[half:]) >= sum(moves[:half])

    def settle(self) -> None:
        """The wheels are at rest: from here on only a turn by more than SETTLED_TICKS counts."""
        self._has_anchor = False
        self._tolerance_ticks = SETTLED_TICKS

    def forget_ticks(self) -> None:
        """The robot sets its counters to zero, which is no turn of a wheel."""
        self._has_anchor = False

    def read_ticks(self, left_ticks: float, right_ticks: float) -> None:
        """Take a reading of the wheels' counters; one that is not finite shows no turn."""
        if self.is_late:
            self._anchor(left_ticks, right_ticks)
            return
        tolerance_ticks = self._tolerance_ticks
        left_turn, right_turn = left_ticks - self._left_ticks, right_ticks - self._right_ticks
        # Comparisons with what is not finite fail.
        if (
            -tolerance_ticks <= left_turn <= tolerance_ticks
            and -tolerance_ticks <= right_turn <= tolerance_ticks
            and self._has_anchor
        ):
            self.readings += 1
            self.still_readings += 1
            self._moves.append(0.0)
            return
        distance = abs(left_turn) + abs(right_turn)
        if not math.isfinite(distance):
            return
        self.readings += 1
        # The first reading has none before it to compare with.
        if self._has_anchor:
            self.still_readings = 0
            self._moves.append(distance)
            self._tolerance_ticks = REST_TICKS
        self._anchor(left_ticks, right_ticks)

    def _anchor(self, left_ticks: float, right_ticks: float) -> None:
        """Compare the next reading with this one, if it is finite."""
        if math.isfinite(left_ticks + right_ticks):
            self._has_anchor = True
            self._left_ticks, self._right_ticks = left_ticks, right_ticks

    def read_velocity(self, linear_m_s: float, angular_rad_s: float) -> None:
        """Take a velocity from odometry, of a robot without an encoder topic: a reading, too."""
        if self.is_late:
            return
        self.readings += 1
        is_still = abs(linear_m_s) <= LINEAR_REST_M_S and abs(angular_rad_s) <= ANGULAR_REST_RAD_S
        self.still_readings = self.still_readings + 1 if is_still else 0
        self._moves.append(0.0 if is_still else abs(linear_m_s) + abs(angular_rad_s))
