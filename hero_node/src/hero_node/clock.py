"""The time of a program: of the machine, or of simulated robots that are stepped. Pure."""

import math
from abc import ABC, abstractmethod
from typing import Iterator

__all__ = ["Clock"]


class Clock(ABC):
    """A time in seconds, and waits. Program, Robot and Swarm are clocks: a loop needs no other time."""

    _due_s = -math.inf

    @property
    @abstractmethod
    def now_s(self) -> float:
        """Seconds since some moment; never steps back."""

    @abstractmethod
    def sleep(self, duration_s: float) -> bool:
        """Wait for duration_s; return whether the program is to continue."""

    def pace(self, period_s: float) -> bool:
        """Wait until period_s after the last such wait was due to end.

        This keeps the rate of a loop whose steps take time; a step that took longer than the period is not made up
        for. Returns whether the program is to continue.
        """
        now_s = self.now_s
        self._due_s = max(now_s, self._due_s + period_s) if now_s - self._due_s < 2.0 * period_s else now_s + period_s
        return self.sleep(self._due_s - now_s)

    def rate(self, hz: float) -> Iterator[float]:
        """Repeat the body of a `for` loop hz times per second, until the program is to end.

            for time_s in swarm.rate(10):
                robot.drive(0.1, math.sin(time_s))

        Yields the seconds since the start of the loop. A body that takes longer than its period is not made up for.

        Raises: ValueError unless hz is more than 0.
        """
        if not hz > 0.0:
            raise ValueError("a rate must be more than 0 Hz, not %r" % (hz,))
        start_s = due_s = self.now_s
        while self.sleep(due_s - self.now_s):
            yield self.now_s - start_s
            due_s = max(due_s + 1.0 / hz, self.now_s)
