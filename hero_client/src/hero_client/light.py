"""The light of one robot: a color, or blinking."""

import itertools
import math
import threading
import time
from typing import Callable, Optional, Sequence

from std_msgs.msg import ColorRGBA

from .colors import Color, parse_color
from .robot_topics import CommandTopic

__all__ = ["Light"]

REPEAT_PERIOD_S = 2.0
"""Between two messages of the same color: the robot's light goes dark 15 s after the last one."""

MIN_BLINK_PERIOD_S = 0.2
"""The robot reads commands every 51 ms."""


class Light:
    """The light of one robot."""

    def __init__(self, namespace: str, explain_absence: Callable[[], str]) -> None:
        """explain_absence: see CommandTopic."""
        self._topic = CommandTopic(namespace + "/led", ColorRGBA, explain_absence)
        self._color: Optional[Color] = None
        self._sent_s = -math.inf
        self._lock = threading.Lock()
        self._blink_end: Optional[threading.Event] = None

    def show(self, color: Color) -> None:
        """Show a color; the same one again is sent every REPEAT_PERIOD_S only.

        Raises: ValueError for a color that is not known.
        """
        red, green, blue = parse_color(color)
        self._end_blinking()
        now_s = time.monotonic()
        if color != self._color or now_s - self._sent_s >= REPEAT_PERIOD_S or not self._topic.connected:
            self._color, self._sent_s = color, now_s
            self._topic.publish(ColorRGBA(red, green, blue, 1.0))

    def blink(self, color: Color, period_s: float) -> None:
        """Show the color for half of each period, on a thread of its own, until another color is asked for."""
        red, green, blue = parse_color(color)
        if not period_s >= MIN_BLINK_PERIOD_S:
            raise ValueError("a period must be at least %g s, not %r" % (MIN_BLINK_PERIOD_S, period_s))
        self._end_blinking()
        self._color = None
        self._blink_end = threading.Event()
        messages = (ColorRGBA(red, green, blue, 1.0), ColorRGBA(0.0, 0.0, 0.0, 1.0))
        threading.Thread(
            target=self._alternate, args=(messages, period_s, self._blink_end), name="blinking", daemon=True
        ).start()

    def _alternate(self, messages: Sequence[ColorRGBA], period_s: float, end: threading.Event) -> None:
        for message in itertools.cycle(messages):
            with self._lock:  # else this could come after the color that ends the blinking
                if end.is_set():
                    return
                self._topic.publish(message)
            end.wait(period_s / 2.0)

    def _end_blinking(self) -> None:
        with self._lock:
            if self._blink_end is not None:
                self._blink_end.set()
                self._blink_end = None

    def close(self) -> None:
        """Switch the light off if it blinks; safe twice."""
        if self._blink_end is not None:
            self.show("off")
