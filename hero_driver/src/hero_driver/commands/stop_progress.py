"""The stop of one robot: when to send it, and what the robot's wheels show. Pure: times and readings go in.

See stop_delivery for what is sent and why.
"""

import enum

from ..corrections.wheel_motion import REST_READINGS, WheelMotion

STOPS_MIN = 4
"""A stop may meet a motion command in the same reading cycle of the robot; one in the next cycle then counts."""

INTERVAL_S = 0.025
"""Between two stops: there is one in each reading cycle of the robot (51 ms). Those that the firmware drops, because
they come within 50 ms of the last one that it took, do no harm."""

STOPS_UNREAD = 6
"""So many are sent to a robot that gives no readings of its wheels."""

RESTLESS_READINGS = 29
"""Readings without a turn (1 s) after which wheels that turned though stopped are at rest again: slow creep shows."""

REPORT_AFTER_S = 1.0
"""After this time without rest a stop is reported as one that did not succeed (yet)."""

TUNING_AFTER_S = 0.4
"""Wheels that still turn after this time may be of a robot that tunes itself without having said so."""

TUNING_INTERVAL_S = 0.15
"""Between two stops to a robot that tunes itself, which needs 70 ms for each."""

STUBBORN_AFTER_S = 0.5
STUBBORN_INTERVAL_S = 0.25
TIRED_AFTER_S = 5.0
TIRED_INTERVAL_S = 1.0
"""Wheels that go on turning, of a robot that somebody pushes perhaps, get fewer stops, but get them for ever."""


class StopState(enum.Enum):
    """As in hero_msgs/Robot."""

    NOT_STOPPED = 0
    STOPPING = 1
    AT_REST = 2
    MOVING = 3
    UNCONFIRMED = 4


class StopProgress:
    """The stop of one robot over one connection: when to send, and what is known. Pure.

    Attributes:
        state: what is known.
    """

    def __init__(self, now_s: float, wheels: WheelMotion) -> None:
        """Begin at now_s; wheels are the robot's."""
        self.state = StopState.STOPPING
        self._wheels = wheels
        self._began_s = now_s
        self._stops = 0
        self._next_s = now_s
        self._mark = wheels.readings
        self._rest_readings = REST_READINGS

    @property
    def is_first(self) -> bool:
        """Whether no stop was sent yet."""
        return self._stops == 0

    def renew(self, now_s: float) -> None:
        """Somebody asked once more: send the next stop at once, unless the wheels are at rest."""
        if self.state is not StopState.AT_REST:
            self._next_s = now_s
            self._began_s = now_s

    def is_due(self, is_acknowledged: bool, now_s: float) -> bool:
        """Look at the wheels; return whether a stop is to be sent now.

        is_acknowledged: whether the robot's TCP has acknowledged the last stop.
        """
        self._assess(is_acknowledged, now_s)
        if self.state is StopState.AT_REST or now_s < self._next_s:
            return False
        if self.state is StopState.UNCONFIRMED and (
            self._wheels.readings == 0 or now_s - self._began_s > TIRED_AFTER_S
        ):
            return False
        # The first one goes at once; more in front of a robot that takes nothing would only pile up.
        return is_acknowledged or self._stops == 0

    def needs_burst(self, tunes: bool, now_s: float) -> bool:
        """Return whether the next stop has to be one that ends a self-tuning; tunes: whether the robot says so."""
        return tunes or (
            now_s - self._began_s >= TUNING_AFTER_S
            and self._wheels.readings - self._mark > 0
            and self._wheels.still_readings < REST_READINGS
        )

    def note_sent(self, was_burst: bool, now_s: float) -> None:
        """A stop was sent."""
        self._stops += 1
        if self._stops <= STOPS_MIN:
            self._mark = self._wheels.readings
        elapsed_s = now_s - self._began_s
        interval_s = TUNING_INTERVAL_S if was_burst else INTERVAL_S
        if elapsed_s >= TIRED_AFTER_S:
            interval_s = TIRED_INTERVAL_S
        elif elapsed_s >= STUBBORN_AFTER_S:
            interval_s = max(interval_s, STUBBORN_INTERVAL_S)
        self._next_s = now_s + interval_s

    def _assess(self, is_acknowledged: bool, now_s: float) -> None:
        wheels = self._wheels
        if self.state is StopState.AT_REST:
            if wheels.still_readings < REST_READINGS:
                self.state = StopState.MOVING
                self._rest_readings = RESTLESS_READINGS
                self._began_s = self._next_s = now_s
            return
        fresh = wheels.readings - self._mark
        if (
            self._stops >= STOPS_MIN
            and fresh >= REST_READINGS
            and wheels.still_readings >= self._rest_readings
        ):
            self.state = StopState.AT_REST
            wheels.settle()
            self._rest_readings = REST_READINGS
        elif wheels.readings == 0:
            if self._stops >= STOPS_UNREAD and is_acknowledged:
                self.state = StopState.UNCONFIRMED
        elif now_s - self._began_s >= REPORT_AFTER_S:
            if wheels.still_readings < self._rest_readings and fresh > 0:
                self.state = StopState.MOVING
            elif self.state is not StopState.MOVING and is_acknowledged:
                self.state = StopState.UNCONFIRMED
