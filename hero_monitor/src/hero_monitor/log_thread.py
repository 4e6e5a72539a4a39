"""Writes log lines on a thread of its own: a terminal that is paused (Ctrl-S) blocks whoever writes to it."""

import contextlib
import queue
import threading
from typing import NamedTuple

import rospy

LINES_MAX = 100
"""Lines that wait for a terminal; more are lost."""


class Line(NamedTuple):
    """One line, at most once in period_s."""

    text: str
    period_s: float


class LogThread:
    """What the thread that serves pages logs with."""

    def __init__(self) -> None:
        self._lines: queue.Queue[Line] = queue.Queue(LINES_MAX)
        threading.Thread(target=self._write, name="log", daemon=True).start()

    def warn(self, text: str, period_s: float = 0.0) -> None:
        """Log a warning; with a period, at most one in that time."""
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(Line(text, period_s))

    def _write(self) -> None:
        while True:
            line = self._lines.get()
            if line.period_s:
                rospy.logwarn_throttle(line.period_s, line.text)
            else:
                rospy.logwarn("%s", line.text)
