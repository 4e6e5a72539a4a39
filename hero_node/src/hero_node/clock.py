"""The time of a program: of the machine, or of simulated robots that are stepped. Pure."""

from abc import ABC, abstractmethod
from typing import Iterator


class Clock(ABC):
    """A time in seconds, and waits. A Program is a clock; Robot and Swarm have its methods, so loops need no other."""

    @property
    @abstractmethod
    def now_s(self) -> float:
        """Seconds since some moment; never steps back."""

    @abstractmethod
    def sleep(self, duration_s: float) -> bool:
        """Wait for duration_s; return whether the program is to continue."""

    def rate(self, hz: float) -> Iterator[float]:
        """Repeat the body of a `for` loop hz times per second, until the program is to end; yield the seconds so far.

            for time_s in swarm.rate(10):
                robot.drive(0.1, math.sin(time_s))

        A body that takes longer than its period is not made up for. Raises: ValueError unless hz is more than 0.
        """
        if not hz > 0.0:
            raise ValueError(f"a rate must be more than 0 Hz, not {hz!r}")
        start_s = due_s = self.now_s
        while self.sleep(due_s - self.now_s):
            yield self.now_s - start_s
            due_s = max(due_s + 1.0 / hz, self.now_s)
