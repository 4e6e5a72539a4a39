"""Which commands of a teleoperation are sent: every motion, and some stops after it."""

from ..values.geometry import STOP, Velocity

__all__ = ["TeleopOutput"]

STOPS = 5
"""How often a stop is sent. Counted, not timed: a program that hung after a motion sends them, too."""


class TeleopOutput:
    """Lets motions pass, and stops only after a motion: then other programs may drive the robots. Pure."""

    def __init__(self) -> None:
        """Start silent."""
        self._stops = 0

    def passes(self, command: Velocity) -> bool:
        """Return whether to send a command, for which this is called each time that one is due."""
        if command != STOP:
            self._stops = STOPS
            return True
        self._stops -= 1
        return self._stops >= 0
