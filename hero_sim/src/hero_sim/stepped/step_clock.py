"""Simulated time that passes in waits, and motions in the background: a scheduler without threads. Pure.

Motions take their steps while the program waits, ordered by time, and at the same time in the order in which they
began to wait; so two runs are alike.
"""

import heapq
import itertools
import math
from typing import Any, List, Optional, Tuple

from hero_client.values import BackgroundMotion, FullWait, Steps
from hero_node import Clock, HeroError

from .robot_rows import RobotRows

_ROUNDING_MS = 1e-6
"""Sums of seconds are this exact."""


class StepClock(Clock):
    """The time of robots that are stepped.

    Attributes:
        rows: these robots.
    """

    def __init__(self, rows: RobotRows) -> None:
        """Begin at their time."""
        self.rows = rows
        self._queue: List[Tuple[int, int, StepMotion]] = []
        self._order = itertools.count()

    @property
    def now_s(self) -> float:
        """Simulated seconds since the robots were switched on."""
        return self.rows.now_ms / 1000.0

    def sleep(self, duration_s: float) -> bool:
        """Simulate the robots for duration_s, in whole milliseconds, of which it takes one at least; return True."""
        self.advance(self.rows.now_ms + _to_ms(duration_s))
        return True

    def advance(self, until_ms: int) -> None:
        """Move robots and motions on to until_ms."""
        queue = self._queue
        while queue and queue[0][0] <= until_ms:
            due_ms, number, motion = heapq.heappop(queue)
            if motion.number == number:  # else it was cancelled since
                self.rows.advance(max(due_ms, self.rows.now_ms))
                motion.take_step()
        self.rows.advance(max(until_ms, self.rows.now_ms))

    def schedule(self, motion: "StepMotion") -> None:
        """Schedule a motion's next step at its due_ms."""
        motion.number = next(self._order)
        heapq.heappush(self._queue, (motion.due_ms, motion.number, motion))


class StepMotion(BackgroundMotion):
    """A motion in the background; it takes its steps while the program waits.

    Attributes:
        due_ms: when it takes its next step.
        number: of that step in the clock's queue; an earlier one is not taken.
    """

    number: int

    def __init__(self, clock: StepClock, steps: Steps) -> None:
        """Take the first step as soon as the program waits."""
        super().__init__()
        self.due_ms = clock.rows.now_ms
        self._clock = clock
        self._steps = steps
        self._has_begun = False
        self._is_cancelled = False
        self._is_held = False
        self.set_running_or_notify_cancel()
        clock.schedule(self)

    def take_step(self) -> None:
        """Take the step that is due now."""
        try:
            wait_s = self._steps.send(not self._is_cancelled) if self._has_begun else next(self._steps)
        except StopIteration:
            self.set_result(None)
        except (HeroError, ValueError, TypeError) as error:
            self.set_exception(error)
        else:
            self._has_begun = True
            self._is_held = isinstance(wait_s, FullWait)
            self.due_ms = self._clock.rows.now_ms + _to_ms(wait_s)
            self._clock.schedule(self)

    def cancel(self) -> bool:
        if self.done():
            return False
        self._is_cancelled = True
        if self._has_begun and not self._is_held and self.due_ms > self._clock.rows.now_ms:
            self.due_ms = self._clock.rows.now_ms
            self._clock.schedule(self)
        return True

    def cancel_and_wait(self) -> None:
        self.cancel()
        self._wait(None)

    def result(self, timeout: Optional[float] = None) -> Any:
        """Simulate until the motion has ended; then as concurrent.futures.Future, timeout in simulated s."""
        self._wait(timeout)
        return super().result(0)

    def exception(self, timeout: Optional[float] = None) -> Optional[BaseException]:
        """As result(), but return the error."""
        self._wait(timeout)
        return super().exception(0)

    def _wait(self, timeout_s: Optional[float]) -> None:
        clock = self._clock
        end_ms = None if timeout_s is None else clock.rows.now_ms + _to_ms(timeout_s)
        while not self.done() and (end_ms is None or clock.rows.now_ms < end_ms):
            clock.advance(self.due_ms if end_ms is None else min(self.due_ms, end_ms))


def _to_ms(duration_s: float) -> int:
    """Return whole milliseconds; a wait that is not nothing takes time, or a loop that waits for a time would hang."""
    return max(1, math.ceil(duration_s * 1000.0 - _ROUNDING_MS)) if duration_s > 0.0 else 0
