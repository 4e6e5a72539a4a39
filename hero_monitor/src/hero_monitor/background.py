"""Runs what may block, on the ROS master or a paused terminal (Ctrl-S), on threads other than that of the pages."""

from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Callable, Optional

import rospy

WORKERS = 8
"""A few more than can block at once: subscriptions, a goal, a topic for driving, a log line."""


class Background:
    """A few worker threads, on which functions run in any order."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(WORKERS, "background")
        self._line: Optional[Future[Any]] = None

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Run a function as soon as a worker is free."""
        return self._pool.submit(function, *arguments)

    def warn(self, text: str, period_s: float = 0.0) -> None:
        """Log a warning, at most one per period_s; dropped while the terminal still blocks the one before."""
        if self._line is None or self._line.done():
            self._line = self.submit(rospy.logwarn_throttle, period_s, text)

    def close(self) -> None:
        """Start nothing more."""
        self._pool.shutdown(wait=False)
