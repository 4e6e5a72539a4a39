"""Log lines to /rosout on a thread of their own, as terminal and file may block; each at most once in a while."""

import logging
import sys
import time
from typing import Dict, List, Tuple

from hero_node import TokenBuckets, print_error

from ..transport.call_queue import Worker
from .rospy_internals import ROSOUT_LOGGER

QUEUE_LENGTH = 2000
THROTTLE_S = 10.0
KNOWN_KEYS_MAX = 1000

ROBOT_LINES_MAX = 20
"""Different messages about one robot at once, and in each THROTTLE_S after that."""


class LogRelay:
    """The log for every other thread of the driver."""

    def __init__(self) -> None:
        self._worker = Worker("log relay", QUEUE_LENGTH, "a log line was lost", print_error)
        self._last: Dict[str, Tuple[float, int]] = {}
        self._robots = TokenBuckets(ROBOT_LINES_MAX, ROBOT_LINES_MAX / THROTTLE_S)
        self._reported_drops = 0
        self._logger = logging.getLogger(ROSOUT_LOGGER)

    def log(self, level: str, text: str) -> None:
        """Log one line at level debug, info, warn, error or fatal."""
        # Robots send a routine line per second each; to hand one over costs more than a burst of their data.
        number: int = getattr(logging, level.upper())
        if not self._logger.isEnabledFor(number):
            return
        dropped = self._worker.refused
        if dropped != self._reported_drops:
            text = "%s (%d log lines before it were dropped)" % (text, dropped - self._reported_drops)
        if self._worker.submit(lambda: self._logger.log(number, "%s", text)):
            self._reported_drops = dropped

    def log_throttled(self, level: str, key: str, text: str, robot: str = "") -> None:
        """Log a line unless its key was in the last THROTTLE_S; those about a robot, or an unknown one, are limited."""
        now_s = time.monotonic()
        last_s, suppressed = self._last.get(key, (None, 0))
        if last_s is not None and now_s - last_s < THROTTLE_S:
            self._last[key] = (last_s, suppressed + 1)
            return
        # What is said again and again takes nothing of what else may be said.
        if robot and not self._robots.take(robot, 1.0, now_s):
            text = f"{robot}: too many different messages; further ones are suppressed"
            self.log_throttled("warn", "suppressed " + robot, text)
            return
        if len(self._last) >= KNOWN_KEYS_MAX:
            self._last.clear()
        self._last[key] = (now_s, 0)
        self.log(level, "%s (and %d times more before)" % (text, suppressed) if suppressed else text)

    def close(self) -> None:
        """Write what waits and end the thread."""
        self._worker.close(drain=True)


def report_dropped_log_lines() -> None:
    """Say once, on stderr, what keeps lines out of the log file; Python would print a traceback for each."""
    told: List[BaseException] = []

    def tell(handler: logging.Handler, record: logging.LogRecord) -> None:
        error = sys.exc_info()[1]
        if error is not None and not told:
            told.append(error)
            print_error(
                "the log file cannot be written (%s): lines are lost until it can; make space below ROS_LOG_DIR or"
                " ~/.ros/log" % error
            )

    logging.Handler.handleError = tell  # type: ignore[method-assign, assignment]
