"""Runs what may block, on the ROS master or a paused terminal (Ctrl-S), on threads other than that of the pages."""

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Callable, Optional

import rospy

WORKERS = 8
"""A few more than can block at once: subscriptions, a goal, a topic for driving, a log line."""


class Background(ThreadPoolExecutor):
    """A few worker threads, on which functions run in any order."""

    def __init__(self) -> None:
        super().__init__(WORKERS, "background")
        self._line: Optional[Future[Any]] = None

    def warn(self, text: str, period_s: float = 0.0) -> None:
        """Log a warning, at most one per period_s; dropped while the terminal still blocks the one before."""
        self._log(rospy.logwarn_throttle, period_s, text)

    def inform(self, text: str) -> None:
        """Log a line; dropped as a warning is."""
        self._log(rospy.loginfo, text)

    def _log(self, log: Callable[..., None], *arguments: Any) -> None:
        if self._line is None or self._line.done():
            self._line = self.submit(log, *arguments)
