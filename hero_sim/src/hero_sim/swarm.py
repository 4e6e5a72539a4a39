"""A world and the firmware of every robot in it, moved through simulated time together.

Pure: no socket and no clock. The caller says up to which millisecond to go, carries the robots' bytes and
reports their connections; the same calls with the same seed give the same run.
"""

import heapq
from typing import Callable, List, Optional, Tuple

from .robot.firmware import Firmware
from .world.world import STEP_MS, World


class Swarm:
    """All robots, in the order of their places in the world.

    Attributes:
        now_ms: how far everything has been moved.
        robots: the firmware of each.
        after_step: called with the world's time (ms) after each physics step.
    """

    def __init__(self, world: World, robots: List[Firmware]) -> None:
        """Join robots with their world."""
        self.world = world
        self.robots = robots
        self.now_ms = world.time_ms
        self.after_step: Optional[Callable[[int], None]] = None
        self._queue: List[Tuple[int, int]] = []
        for index in range(len(robots)):
            self.reschedule(index)

    def reschedule(self, index: int) -> None:
        """Note that the time at which a robot has to run has changed."""
        heapq.heappush(self._queue, (self.robots[index].due_ms, index))

    def advance(self, until_ms: int) -> List[int]:
        """Move everything on to until_ms; return which robots have packets to send or want a connection."""
        touched = set()
        queue = self._queue
        while True:
            limit_ms = min(until_ms, self.world.time_ms + STEP_MS)
            while queue and queue[0][0] <= limit_ms:
                due_ms, index = heapq.heappop(queue)
                robot = self.robots[index]
                if due_ms != robot.due_ms:
                    continue  # it was rescheduled since
                self.now_ms = max(self.now_ms, due_ms)
                robot.run(self.now_ms)
                touched.add(index)
                heapq.heappush(queue, (robot.due_ms, index))
            self.now_ms = max(self.now_ms, limit_ms)
            if limit_ms < self.world.time_ms + STEP_MS:
                return sorted(touched)
            self.world.step()
            if self.after_step is not None:
                self.after_step(self.world.time_ms)
            if self.world.time_ms >= until_ms and not (queue and queue[0][0] <= until_ms):
                return sorted(touched)

    @property
    def next_due_ms(self) -> int:
        """When the next robot has to run."""
        return self._queue[0][0] if self._queue else self.world.time_ms + STEP_MS
