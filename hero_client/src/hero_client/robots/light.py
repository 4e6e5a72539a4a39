"""The light of one robot: a color, or blinking. Pure."""

import itertools
from typing import Optional, Tuple

from ..values.background_motion import BackgroundMotion, Steps
from ..values.colors import COLORS, Color, parse_color
from ..values.robot_link import RobotLink

REPEAT_PERIOD_S = 5.0
"""Time between two messages of the same color: the robot's light goes dark 15 s after the last one."""

MIN_BLINK_PERIOD_S = 0.2
"""The robot reads commands every 51 ms."""


class Light:
    """The light of one robot, which is told its color again and again as long as it shines."""

    def __init__(self, link: RobotLink) -> None:
        self._link = link
        self._shown = COLORS["off"]
        self._motion: Optional[BackgroundMotion] = None
        self._is_blinking = False

    def show(self, color: Color) -> None:
        """Show a color from now on. Raises: ValueError for a color that is not known."""
        rgb = parse_color(color)
        if self._is_blinking:
            self._end_motion()
        if self._motion is not None and rgb == self._shown and self._link.connected:
            return
        self._shown = rgb
        self._link.send_color(rgb)
        if self._motion is None:
            self._motion = self._link.start(self._repeat())

    def _repeat(self) -> Steps:
        while (yield REPEAT_PERIOD_S):
            self._link.send_color(self._shown)

    def blink(self, color: Color, period_s: float) -> None:
        """Show the color for half of each period, in the background, until another color is asked for."""
        rgb = parse_color(color)
        if not period_s >= MIN_BLINK_PERIOD_S:
            raise ValueError(f"a period must be at least {MIN_BLINK_PERIOD_S:g} s, not {period_s!r}")
        self._end_motion()
        self._motion, self._is_blinking = self._link.start(self._alternate(rgb, period_s)), True

    def _alternate(self, rgb: Tuple[float, float, float], period_s: float) -> Steps:
        for shown in itertools.cycle((rgb, COLORS["off"])):
            self._link.send_color(shown)
            if not (yield period_s / 2.0):
                return

    def _end_motion(self) -> None:
        if self._motion is not None:
            # Its last color is not to come after the next one.
            self._motion.cancel_and_wait()
        self._motion, self._is_blinking = None, False

    def close(self) -> None:
        """Send nothing more: switch a light off that blinks, and leave another one to go dark. Safe twice."""
        if self._is_blinking:
            self.show("off")
        self._end_motion()
