"""Which commands of a teleoperation are sent.

Every motion, one stop after it, and no motion of before a pause, a stop or a release of all robots.
"""

from typing import Callable, Iterable, Set

from hero_node import STOP, Velocity

from ..robots.robot_base import BaseRobot

PAUSE_S = 0.5
"""A teleoperation takes a step every 0.05 to 0.1 s; after more than this it, or its PC, was suspended or too busy."""

HOLD_ENDED = "robots were stopped or released, which ends what you hold: let go, then press again"


class TeleopOutput:
    """Lets motions pass, and one stop after a motion: then other programs may drive the robots. Pure."""

    def __init__(self, warn: Callable[[str], None]) -> None:
        """warn: tells the operator."""
        self._warn = warn
        self._is_moving = False
        self._is_held = False
        self._stopped: Set[str] = set()
        self._is_hold_over = False

    def note_hold(self, is_held: bool) -> None:
        """The operator holds what drives robots, or has let go of it."""
        self._is_held = is_held
        self._is_hold_over = self._is_hold_over and is_held

    def limit(self, command: Velocity, robots: Iterable[BaseRobot]) -> Velocity:
        """Return the command, but STOP after a stop or release during a hold, until the operator has let go.

        robots: all that the operator can choose. Call it in every step.
        """
        stopped = {robot.name for robot in robots if robot.is_stopped}
        if stopped != self._stopped:
            self._stopped, self._is_hold_over = stopped, self._is_held
            if self._is_held:
                self._warn(HOLD_ENDED)
        return STOP if self._is_hold_over else command

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
