"""Lines on robots that are lost and found again: each of a few robots, one summary of many. Pure."""

import collections
import math
from typing import Counter, List

PERIOD_S = 10.0
SINGLE_LINES = 4
"""More than so many within PERIOD_S become one line at its end: a busy computer loses and finds all robots at once."""

NAMED_ROBOTS = 5


class LossLines:
    """Passes lines on while they are few. Times are those of SwarmLocalizer.find_lost()."""

    def __init__(self) -> None:
        self._start_s = -math.inf
        self._singles_left = SINGLE_LINES
        self._summed: Counter[int] = collections.Counter()

    def add(self, robot_id: int, line: str, now_s: float) -> List[str]:
        """Return the line, or nothing if it is counted for the summary."""
        if now_s >= self._start_s + PERIOD_S:
            self._start_s = now_s
        if self._singles_left:
            self._singles_left -= 1
            return [line]
        self._summed[robot_id] += 1
        return []

    def end_period(self, now_s: float) -> List[str]:
        """Return the summary if one is due."""
        if now_s < self._start_s + PERIOD_S:
            return []
        counts, self._summed = self._summed, collections.Counter()
        if not counts:
            self._singles_left = SINGLE_LINES
            return []
        # Until a period without any, all lines are summed up.
        self._start_s, self._singles_left = now_s, 0
        names = ", ".join("hero_%d" % robot_id for robot_id, _ in counts.most_common(NAMED_ROBOTS))
        more = ", ..." if len(counts) > NAMED_ROBOTS else ""
        text = "%d more lines on robots lost or found again in %.0f s: %d robots (%s%s)"
        return [text % (sum(counts.values()), PERIOD_S, len(counts), names, more)]
