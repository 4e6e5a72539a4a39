"""The Wi-Fi of all robots: when readings reach the program, and commands the robots.

Pure. The only loops over robots in a step are here, since each robot has a connection of its own.
"""

import heapq
import itertools
import math
from typing import Collection, Dict, Iterator, List, Sequence, Tuple

import numpy as np

from ...link.wifi import Radio
from ...robot.clock import NEVER_MS
from .command_shaper import Sent
from .readings import DISTANCE, SCAN, WHEELS, Readings

LENGTHS = {WHEELS: 1469, SCAN: 205, DISTANCE: 12}
"""Bytes of an odometry, five transforms and an encoder reading; of a scan; of a distance."""

COMMAND_LENGTH = 56
"""Bytes of a Twist (servo pulses have fewer)."""


class RadioRows:
    """The connections."""

    def __init__(self, radios: Sequence[Radio]) -> None:
        """Take the radio of each robot."""
        self._radios = radios
        self._order = itertools.count()
        self._up: List[Tuple[int, int, int, Readings, Collection[str]]] = []
        self._down: Dict[int, List[Tuple[int, int, int, Tuple[float, float]]]] = {}

    @property
    def due_ms(self) -> int:
        """When the next readings arrive."""
        return self._up[0][0] if self._up else NEVER_MS

    def send_readings(self, now_ms: int, readings: Readings, rows: np.ndarray, parts: Collection[str]) -> None:
        """Send parts of the readings of the robots at rows, which must not change any more.

        A robot whose last ones still wait for the channel sends none: its write blocks, and newer ones come next.
        """
        length = sum(LENGTHS[part] for part in parts)
        for row in rows.tolist():
            if self._radios[row].is_congested(now_ms):
                continue
            arrival_ms = math.ceil(self._radios[row].up.send(now_ms, length))
            heapq.heappush(self._up, (arrival_ms, next(self._order), row, readings, parts))

    def receive_readings(self, now_ms: int) -> Iterator[Tuple[Readings, int, Collection[str]]]:
        """Yield what has arrived by now, in order: readings as they were sent, the row of their robot, which parts."""
        while self.due_ms <= now_ms:
            _, _, row, readings, parts = heapq.heappop(self._up)
            yield readings, row, parts

    def drop_readings(self, row: int) -> None:
        """Drop the readings of one robot that are on their way."""
        self._up = [sent for sent in self._up if sent[2] != row]
        heapq.heapify(self._up)

    def send_commands(self, topic: int, sent: Sent) -> np.ndarray:
        """Send commands to robots; return when they arrive, ms (K,)."""
        queue = self._down.setdefault(topic, [])
        arrivals_ms: List[int] = []
        for row, at_ms, first, second in zip(sent.rows.tolist(), sent.at_ms.tolist(), *sent.values.tolist()):
            arrivals_ms.append(math.ceil(self._radios[row].down.send(at_ms, COMMAND_LENGTH)))
            heapq.heappush(queue, (arrivals_ms[-1], next(self._order), row, (first, second)))
        return np.array(arrivals_ms, dtype=np.int64)

    def receive_commands(self, topic: int, now_ms: int) -> List[Tuple[np.ndarray, np.ndarray]]:
        """Return the commands that have arrived by now: rows (K,), each once, and values (2, K); in order."""
        queue = self._down.get(topic, [])
        rounds: List[Dict[int, Tuple[float, float]]] = []
        while queue and queue[0][0] <= now_ms:
            _, _, row, values = heapq.heappop(queue)
            unused = next((commands for commands in rounds if row not in commands), None)
            if unused is None:
                rounds.append({row: values})
            else:
                unused[row] = values
        return [(np.array(list(commands)), np.array(list(commands.values())).T) for commands in rounds]
