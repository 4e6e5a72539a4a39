"""Which motion commands a fake robot accepts, and whether its wheels turn: the stock firmware's rules.

Pure: time enters in seconds. Source: firmware v3.8 as measured: a controller drops
each Twist that comes within 50 ms after its watchdog was set; an accepted motion sets the watchdog, self-tuning
keeps setting it, and an accepted zero resets it. Of the motion watchdogs (2, 4 and 1 s) nothing is modeled.
"""

import collections
import struct
from typing import DefaultDict, Sequence

VELOCITY_GATE_S = 0.050
"""The firmware drops a velocity that it reads within this time after its controller's watchdog was set."""

PULSES_HOLD_S = 0.0005
LED_HOLD_S = 0.001
"""So long each cmd_motor and each led holds the robot's program, and so delays what comes behind it."""

DEAD_ZONE_US = 15
"""A wheel rests within this distance of its servo's center."""

LAG_S = 0.3
"""Wheels that are stopped come to rest so much later (measured: 0.25 to 0.35 s)."""

TICKS_PER_S = 200.0
"""How fast the wheels turn when they do, about 0.1 m/s."""

TICK_M = 0.000537

_NEVER_S = float("-inf")


class Controller:
    """What one controller was told last."""

    def __init__(self) -> None:
        self.is_tuning = False
        self.is_driving = False
        self.watchdog_s = _NEVER_S


class FakeMotors:
    """The controllers, by the part of their topics' names in front of cmd_vel, and the wheels.

    Attributes:
        is_pushed: whether a hand turns the wheels.
        lag_s: for how long the wheels turn on when nothing drives them.
        light_s: for how long each led holds the robot's program.
        read_s: when the robot has finished what it reads.
    """

    def __init__(
        self, centers_us: Sequence[int] = (1500, 1500), lag_s: float = 0.0, light_s: float = LED_HOLD_S
    ) -> None:
        """centers_us: the servos' real centers, left and right."""
        self.is_pushed = False
        self.lag_s = lag_s
        self.light_s = light_s
        self.read_s = 0.0
        self._centers_us = centers_us
        self._driven_s = _NEVER_S
        self._controllers: DefaultDict[str, Controller] = collections.defaultdict(Controller)
        self._has_pulses = False
        self._ticks = 0.0
        self._turned_s = 0.0

    def start_tuning(self, controller: str) -> None:
        """Let a controller (velocity_controller, position_controller) tune itself until an accepted Twist."""
        self._controllers[controller].is_tuning = True

    @property
    def is_tuning(self) -> bool:
        """Whether a controller tunes itself."""
        return any(controller.is_tuning for controller in list(self._controllers.values()))

    @property
    def is_turning(self) -> bool:
        """Whether the wheels turn."""
        return (
            self.is_pushed
            or self._has_pulses
            or any(controller.is_tuning or controller.is_driving for controller in list(self._controllers.values()))
        )

    def begin_read(self, now_s: float) -> None:
        """Be told that the robot reads what has come; until now its controllers ran."""
        self.read_s = now_s
        for controller in list(self._controllers.values()):
            if controller.is_tuning:
                controller.watchdog_s = now_s

    def take_led(self) -> None:
        """Take a color."""
        self.read_s += self.light_s

    def take_pulses(self, payload: bytes) -> None:
        """Take a Motor command."""
        self.read_s += PULSES_HOLD_S
        pulses_us = struct.unpack("<2h", payload)
        offsets_us = [pulse_us - center_us for pulse_us, center_us in zip(pulses_us, self._centers_us)]
        self._has_pulses = any(abs(offset_us) > DEAD_ZONE_US for offset_us in offsets_us)

    def take_velocity(self, name: str, is_zero: bool) -> None:
        """Take a Twist for the controller in a topic's name, which may drop it."""
        controller = self._controllers[name.split("/")[-2]]
        if self.read_s - controller.watchdog_s < VELOCITY_GATE_S:
            return
        controller.is_tuning = False
        controller.is_driving = not is_zero
        controller.watchdog_s = _NEVER_S if is_zero else self.read_s
        if is_zero:
            self._has_pulses = False

    def count_ticks(self, now_s: float) -> int:
        """Return the ticks of each wheel at now_s."""
        if self.is_turning:
            self._driven_s = now_s
        if now_s - self._driven_s <= self.lag_s:
            self._ticks += TICKS_PER_S * (now_s - self._turned_s)
        self._turned_s = now_s
        return int(self._ticks)

    def encode_encoder(self, name: str, now_s: float, stamp_s: float) -> bytes:
        """Return the payload of hero_common/Encoder that a robot called name sends at now_s."""
        before = int(self._ticks)
        ticks = self.count_ticks(now_s)
        speed_m_s = TICKS_PER_S * TICK_M if self.is_turning else 0.0
        frame_id = (name + "/encoder").encode()
        seconds = int(stamp_s)
        return struct.pack(
            "<4I%ds11d" % len(frame_id),
            0xFFFFFFFF,
            seconds,
            int((stamp_s - seconds) * 1e9),
            len(frame_id),
            frame_id,
            *(ticks, ticks, ticks - before, ticks - before),
            *((ticks - before) * TICK_M,) * 2,
            0.034,
            *(speed_m_s,) * 4,
        )
