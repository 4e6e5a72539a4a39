"""Key presses and the time -> what a robot is told: hold a key to drive, let go to stop. No clock, no ROS.

A terminal says when a key is pressed and then, while it is held, again and again; it never says when it is let go.
So a motion ends when its key has not come for a moment: longer after the first press, because terminals wait
(0.25..0.66 s) before they repeat, and short once the key repeats (every 30..50 ms).
"""

import math
from typing import Dict, Tuple

from .control_laws import Command

FIRST_TIMEOUT_S = 0.75
"""A single press drives for so long: a little more than the longest usual wait for the first repeat."""

REPEAT_TIMEOUT_S = 0.3
"""A held key that stays away for so long was let go: several repeats, so that a hiccup of ssh does not stop."""

MIN_LINEAR_M_S, MAX_LINEAR_M_S, LINEAR_STEP_M_S = 0.02, 0.20, 0.02
MIN_TURN_RAD_S, MAX_TURN_RAD_S, TURN_STEP_RAD_S = 0.25, 4.0, 0.25

MOTIONS: Dict[str, Tuple[int, int]] = {
    "w": (1, 0),
    "x": (-1, 0),
    "a": (0, 1),
    "d": (0, -1),
    "q": (1, 1),
    "e": (1, -1),
    "z": (-1, -1),
    "c": (-1, 1),
    "up": (1, 0),
    "down": (-1, 0),
    "left": (0, 1),
    "right": (0, -1),
}
"""Key -> (ahead, left). A curve backwards to the left (z) swings the tail to the left: the turn is to the right."""

STOP_KEYS = ("s", " ", "\x1a")
"""s, space, and Ctrl-Z, which looks like a wish to hold on."""

STOP_ALL_KEYS = ("\r", "\n")
RELEASE_KEY = "r"

HELP = """\
Hold a key to drive; let go, and the robot stops.

      q   w   e        w x    forward, backward      + -   drive faster, slower
      a   s   d        a d    turn left, right       > <   turn faster, slower
      z   x   c        q e    forward in a curve     0..9  this robot    Tab  next robot
                       z c    backward in a curve    g     all robots
  s or space: stop     arrows work too               ?     this text     Ctrl-C  end

  Enter: STOP ALL ROBOTS of all drivers     r: release them
"""


class KeyDrive:
    """Turns keys into a command that runs out by itself."""

    def __init__(self, linear_m_s: float, turn_rad_s: float) -> None:
        """Start at standstill; linear_m_s, turn_rad_s: the speeds that keys will give."""
        self.linear_m_s = linear_m_s
        self.turn_rad_s = turn_rad_s
        self._ahead = 0
        self._left = 0
        self._last_key = ""
        self._last_press_s = -math.inf
        self._ahead_end_s = -math.inf
        self._left_end_s = -math.inf

    def press(self, key: str, now_s: float) -> bool:
        """Take a key; return whether it means something here."""
        if key in STOP_KEYS:
            self.stop()
            return True
        lower = key.lower()  # caps lock must not take the controls away
        if lower in MOTIONS:
            self._move(lower, now_s)
            return True
        if key in "+=" or key in "-_":
            step_m_s = LINEAR_STEP_M_S if key in "+=" else -LINEAR_STEP_M_S
            self.linear_m_s = min(MAX_LINEAR_M_S, max(MIN_LINEAR_M_S, self.linear_m_s + step_m_s))
            return True
        if key in ">." or key in "<,":
            step_rad_s = TURN_STEP_RAD_S if key in ">." else -TURN_STEP_RAD_S
            self.turn_rad_s = min(MAX_TURN_RAD_S, max(MIN_TURN_RAD_S, self.turn_rad_s + step_rad_s))
            return True
        return False

    def _move(self, key: str, now_s: float) -> None:
        """Set the parts of the motion that the key names; the other part runs out on its own."""
        held = key == self._last_key and now_s - self._last_press_s < REPEAT_TIMEOUT_S
        end_s = now_s + (REPEAT_TIMEOUT_S if held else FIRST_TIMEOUT_S)
        ahead, left = MOTIONS[key]
        if ahead:
            self._ahead, self._ahead_end_s = ahead, end_s
        if left:
            self._left, self._left_end_s = left, end_s
        self._last_key, self._last_press_s = key, now_s

    def stop(self) -> None:
        """Forget every motion."""
        self._ahead = self._left = 0
        self._last_key = ""

    def command(self, now_s: float) -> Command:
        """Return what the robot shall do now."""
        ahead = self._ahead if now_s < self._ahead_end_s else 0
        left = self._left if now_s < self._left_end_s else 0
        return Command(ahead * self.linear_m_s, left * self.turn_rad_s)
