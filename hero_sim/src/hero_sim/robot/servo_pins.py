"""Time that servo pulses block a robot's loop, by the ESP8266 Arduino core that its firmware was built with. Pure.

Cores 2.x (2.5.0 to 2.7.4) change a pulse at once. Since core 3.0.0 all pins share one mailbox for a change of their
pulse, which the pin empties as its next period begins: the next write of either servo waits for that, also where it
writes the same pulse, and detaching a servo waits for one period. A pin that is attached begins its period at once.
Source: core_esp8266_waveform_pwm.cpp and Servo.cpp of the cores.
"""

from typing import Optional

CORE_2, CORE_3 = "core2", "core3"

PERIOD_US = 20000

_RIGHT_AFTER_US = 250
"""The right servo is attached, and begins its periods, this long after the left one: half of what a cmd_motor takes."""


class ServoPins:
    """The pins of the left and the right servo; times are the robot's own microseconds."""

    def __init__(self, timing: str) -> None:
        """Begin detached; timing is CORE_2 or CORE_3."""
        self._waits = timing == CORE_3
        self._attached_us: Optional[int] = None
        self._empty_us = 0  # from when on the mailbox is empty

    def write(self, now_us: int) -> int:
        """Write the pulses of both servos; return how long (us) that holds the loop."""
        if not self._waits:
            return 0
        if self._attached_us is None:
            self._attached_us = now_us
            return 0
        at_us = now_us
        for begin_us in (self._attached_us, self._attached_us + _RIGHT_AFTER_US):
            at_us = max(at_us, self._empty_us)
            self._empty_us = at_us + PERIOD_US - (at_us - begin_us) % PERIOD_US
        return at_us - now_us

    def detach(self) -> int:
        """Stop the pulses of both servos, and what waits in the mailbox; return how long (us) that holds the loop."""
        if self._attached_us is None:
            return 0
        self._attached_us = None
        self._empty_us = 0
        return 2 * PERIOD_US
