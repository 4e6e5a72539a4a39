"""Which commands of a teleoperation are sent: every motion, one stop after it, and no motion of before a pause."""

from hero_node.geometry import STOP, Velocity

PAUSE_S = 0.5
"""A teleoperation takes a step every 0.05 to 0.1 s; after more than this it, or its PC, was suspended or too busy."""


class TeleopOutput:
    """Lets motions pass, and one stop after a motion: then other programs may drive the robots. Pure."""

    def __init__(self) -> None:
        self._is_moving = False

    def demand_stop(self) -> None:
        """Pass the next stop on, also without a motion before it."""
        self._is_moving = True

    def passes(self, command: Velocity) -> bool:
        """Return whether to send a command, for which this is called each time that one is due."""
        was_moving, self._is_moving = self._is_moving, command != STOP
        return was_moving or self._is_moving


class PauseDetector:
    """Notices that a program did not run: input that waited meanwhile is old. Pure."""

    def __init__(self, now_s: float) -> None:
        self._ran_s = now_s

    def is_paused(self, now_s: float) -> bool:
        """Return whether the program has not taken a step for longer than PAUSE_S."""
        return now_s - self._ran_s > PAUSE_S

    def step(self, now_s: float) -> bool:
        """The program takes a step; return whether it comes after a pause."""
        after_pause = self.is_paused(now_s)
        self._ran_s = now_s
        return after_pause
