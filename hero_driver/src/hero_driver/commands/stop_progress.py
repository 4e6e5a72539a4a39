"""The stop of one robot: when to send it, and what the robot's wheels show. Pure: times and readings go in.

See stops.delivery for what is sent and why. Wheels are classified by readings in time and by time since the robot
acknowledged a stop: delayed readings come all at once, and an ordinary stop takes 0.25 to 0.35 s. Late readings are
ignored, whatever they show: a robot whose wheels turn is reported as soon as readings are in time.
"""

import enum
from typing import NamedTuple, Optional

from ..corrections.wheel_motion import MOVES_KEPT, REST_READINGS, WheelMotion

STOPS_MIN = 4
"""A stop may meet a motion command in the same reading cycle of the robot; one in the next cycle then counts."""

BURST_STOPS = 2
"""Number of stops that a burst counts for: the robot reads it in a reading cycle of its own, as it does two stops."""

INTERVAL_S = 0.025
"""Time between two stops: each reading cycle of the robot (51 ms) has one; those that the firmware drops do no harm."""

STOPS_UNREAD = 6
"""Number of stops sent to a robot that gives no readings of its wheels."""

MOVING_READINGS = 29
"""Wheels that still turn after this many (1 s) are reported, and at rest again after as many: slow creep shows."""

UNREAD_AFTER_S = 1.0
SILENT_AFTER_S = 2.0
"""Without any reading of its wheels a robot's stop is unconfirmed after this time; without a new one after that."""

STUBBORN_AFTER_S = 0.5
STUBBORN_INTERVAL_S = 0.25
TIRED_AFTER_S = 5.0
TIRED_INTERVAL_S = 1.0
"""Wheels that keep turning, as of a robot that is pushed, get fewer stops, but without end."""

READING_S = 0.034
"""Time between two readings, by the robot's time."""

BURST_READINGS_MIN = 3
"""Two readings (34 ms apart) may leave between the acknowledgement and the robot's next reading cycle (51 ms)."""

BURST_WAIT_S = 2.0
"""To a robot that never gives readings the next burst goes after this time, and each further one after twice the time
of the last: the robot finishes sooner or later, whatever it takes for one."""


class _Mark(NamedTuple):
    readings: int
    now_s: float


class StopState(enum.Enum):
    """State of a robot's stop, numbered as STOP_* in hero_msgs/Robot."""

    NOT_STOPPED = 0
    STOPPING = 1
    AT_REST = 2
    MOVING = 3
    UNCONFIRMED = 4


class StopProgress:
    """The stop of one robot over one connection: when to send, and its `state`, which is what is known."""

    def __init__(self, now_s: float, wheels: WheelMotion) -> None:
        """Begin at now_s (monotonic); wheels show the motion that readings of this connection tell."""
        self.state = StopState.STOPPING
        self._wheels = wheels
        self._began_s = now_s
        self._stops = 0
        self._next_s = now_s
        self._late_s = now_s  # when the robot was last heard late
        self._mark = wheels.readings
        self._acknowledged: Optional[_Mark] = None  # when a stop first was
        self._watched: Optional[_Mark] = None  # when one first was after the last burst
        self._rest_readings = REST_READINGS

    @property
    def has_begun(self) -> bool:
        """True once a stop was sent."""
        return self._stops > 0

    def renew(self, now_s: float) -> None:
        """A stop was requested again: send the next stop at once, unless the wheels are at rest."""
        if self.state is not StopState.AT_REST:
            self._next_s = self._began_s = now_s

    def lacks_evidence(self, now_s: float) -> bool:
        """Return whether only late readings have come for as long as it takes to see that wheels turn on."""
        return (
            self._wheels.is_late
            and self._acknowledged is not None
            and now_s - self._acknowledged.now_s >= MOVING_READINGS * READING_S
        )

    def is_due(self, is_acknowledged: bool, now_s: float) -> bool:
        """Look at the wheels; return whether a stop is due. is_acknowledged: the robot's TCP has the last one."""
        self._assess(is_acknowledged, now_s)
        if self.state is StopState.AT_REST or now_s < self._next_s:
            return False
        if self._wheels.readings == 0 and self._stops >= STOPS_UNREAD:
            return False
        if self.state is StopState.UNCONFIRMED and now_s - self._began_s > TIRED_AFTER_S:
            return False
        # The first one goes at once; more in front of a robot that takes nothing would only pile up.
        return is_acknowledged or self._stops == 0

    def needs_burst(self, tunes: bool, now_s: float) -> bool:
        """Return whether the next stop has to end a self-tuning: tunes, or wheels that do not slow down for 0.8 s."""
        return tunes or (self._has_passed(self._watched, MOVES_KEPT, now_s) and self._wheels.go_on)

    def note_sent(self, was_burst: bool, now_s: float) -> None:
        """Note that a stop was sent at now_s, and plan the next one; was_burst: with a burst against self-tuning."""
        if self._stops < STOPS_MIN:
            self._mark = self._wheels.readings
        self._stops += BURST_STOPS if was_burst else 1
        if was_burst:
            self._watched = None
        elapsed_s = now_s - self._began_s
        interval_s = INTERVAL_S
        if elapsed_s >= TIRED_AFTER_S:
            interval_s = TIRED_INTERVAL_S
        elif elapsed_s >= STUBBORN_AFTER_S:
            interval_s = STUBBORN_INTERVAL_S
        self._next_s = now_s + interval_s

    def _has_passed(self, mark: Optional[_Mark], readings: int, now_s: float) -> bool:
        """Return whether this many readings came since mark, and the time that they take has passed."""
        return (
            mark is not None
            and self._wheels.readings - mark.readings >= readings
            and now_s - mark.now_s >= readings * READING_S
        )

    def _assess(self, is_acknowledged: bool, now_s: float) -> None:
        wheels = self._wheels
        if wheels.is_late:
            self._late_s = now_s
        if is_acknowledged and self._stops > 0:
            self._acknowledged = self._acknowledged or _Mark(wheels.readings, now_s)
            self._watched = self._watched or _Mark(wheels.readings, now_s)
        if self.state is StopState.AT_REST:
            if wheels.still_readings < REST_READINGS:
                self.state = StopState.MOVING
                self._rest_readings = MOVING_READINGS
                self._began_s = self._next_s = now_s
                self._watched = None
            return
        fresh = wheels.readings - self._mark
        is_still = wheels.still_readings >= self._rest_readings
        if self._stops >= STOPS_MIN and fresh >= REST_READINGS and is_still:
            self.state = StopState.AT_REST
            wheels.settle()
            self._rest_readings = REST_READINGS
        elif not is_still and self._has_passed(self._acknowledged, MOVING_READINGS, now_s):
            self.state = StopState.MOVING
        elif fresh == 0 and is_acknowledged and self.state is not StopState.MOVING:
            silent_s = now_s - max(self._began_s, self._late_s)
            if silent_s >= (SILENT_AFTER_S if wheels.readings else UNREAD_AFTER_S):
                self.state = StopState.UNCONFIRMED


class BurstGate:
    """The bursts to one robot that tunes itself, over one connection: when the next one may go.

    A robot reads until nothing is left, and does nothing else meanwhile: a burst that comes before it has finished the
    last keeps it deaf. How long it takes is not known (0.06 s and 0.17 s were measured), and TCP acknowledges for it at
    once, so only its readings show that it has finished.
    """

    def __init__(self, wheels: WheelMotion) -> None:
        """wheels count the readings of the same connection."""
        self._wheels = wheels
        self._is_outstanding = False
        self._acknowledged_readings: Optional[int] = None  # number of readings when the last burst was
        self._wait_s = 0.0
        self._retry_s = 0.0

    def note_sent(self, now_s: float) -> None:
        """Close the gate behind a burst that was sent at now_s (monotonic), until the robot has finished it."""
        self._wait_s = 2.0 * self._wait_s if self._is_outstanding else BURST_WAIT_S
        self._retry_s = now_s + self._wait_s
        self._is_outstanding = True
        self._acknowledged_readings = None

    def is_open(self, is_acknowledged: bool, now_s: float) -> bool:
        """Return whether the next burst may go; is_acknowledged: whether the robot's TCP has the last one."""
        if self._is_outstanding and is_acknowledged:
            if self._acknowledged_readings is None:
                self._acknowledged_readings = self._wheels.readings
            self._is_outstanding = self._wheels.readings - self._acknowledged_readings < BURST_READINGS_MIN
        return not self._is_outstanding or (self._wheels.readings == 0 and now_s >= self._retry_s)
