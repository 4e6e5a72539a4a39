"""The driver's shaping of motion commands, for one motion topic of all robots.

Pure: numpy only, robots last in all arrays; the rules of VelocityShaper in hero_driver/commands: the newest command
wins, commands are 60 ms apart, a stop is never dropped and is sent twice. What was sent has to be taken more often
than once in 60 ms, as the robots' reads do, which are 51 ms apart.
"""

import math
from typing import Any, Dict, NamedTuple, Sequence, Tuple, Union

import numpy as np

from hero_driver.commands import COMMAND_INTERVAL_S, STOP_REPEATS

Rows = Union[int, Sequence[int], np.ndarray]
"""The row of one robot, or the rows of several (K,), each named once."""

Values = Any  # a number for all these rows, or one for each: a sequence or an array (K,)

INTERVAL_MS = round(COMMAND_INTERVAL_S * 1000)

MAX_AGE_MS = 2000
"""Motion that could not be sent for this long is dropped: the driver's command_max_age_s, unless it was set."""


class Sent(NamedTuple):
    """Commands that were sent to robots.

    Attributes:
        rows: to which robots (K,), each once.
        values: the commands (2, K).
        at_ms: when (K,).
    """

    rows: np.ndarray
    values: np.ndarray
    at_ms: np.ndarray


_NOTHING = Sent(np.empty(0, dtype=np.int64), np.empty((2, 0)), np.empty(0, dtype=np.int64))


class CommandShaper:
    """The pending commands; at most one stop and one later command wait for each robot."""

    def __init__(self, rows: int, stop: float) -> None:
        """Begin with nothing; stop is each value of the command that stops a robot."""
        self._stop = stop
        self._stop_waits = np.zeros(rows, dtype=bool)
        self._newest_waits = np.zeros(rows, dtype=bool)
        self._newest = np.zeros((2, rows))
        self._offered_ms = np.zeros(rows, dtype=np.int64)
        self._repeats = np.zeros(rows, dtype=np.int64)
        self._next_ms = np.zeros(rows, dtype=np.int64)
        self._is_sent = np.zeros(rows, dtype=bool)
        self._sent = np.zeros((2, rows))
        self._sent_ms = np.zeros(rows, dtype=np.int64)
        self._is_idle = True
        self._has_sent = False
        self._collected: Dict[int, Tuple[float, float]] = {}
        self._collected_ms = 0

    def offer(self, now_ms: int, rows: Rows, first: Values, second: Values) -> None:
        """Take the two values of a command at now_ms, for one robot or for several.

        Raises: ValueError for values that are not finite, as the driver refuses them. IndexError for a row that no
        robot has.
        """
        if now_ms != self._collected_ms or not isinstance(rows, int) or rows in self._collected:
            self._shape_collected()
            self._collected_ms = now_ms
        if isinstance(rows, int):
            if not (math.isfinite(first) and math.isfinite(second)):
                raise ValueError("the command for robot row %d must be finite, not %r and %r" % (rows, first, second))
            if not 0 <= rows < len(self._repeats):
                raise IndexError("there is no robot row %d; rows are 0..%d" % (rows, len(self._repeats) - 1))
            self._collected[rows] = (first, second)
            return
        rows = np.asarray(rows)
        values = np.empty((2, rows.size))
        values[0], values[1] = first, second
        if not np.isfinite(values).all():
            wrong = rows.reshape(-1)[~np.isfinite(values).all(axis=0)]
            text = "the commands for robot rows %s must be finite; sensors give nan for what is not known"
            raise ValueError(text % wrong[:10].tolist())
        self._shape(now_ms, rows.reshape(-1), values)

    def _shape_collected(self) -> None:
        """Shape the commands for single robots that came at one time, all together: that is much faster."""
        if self._collected:
            rows, values = np.array(list(self._collected)), np.array(list(zip(*self._collected.values())), dtype=float)
            self._collected.clear()
            self._shape(self._collected_ms, rows, values)

    def _shape(self, now_ms: int, rows: Any, values: np.ndarray) -> None:
        self._send_due(now_ms)
        if len(rows) == len(self._repeats) and (rows[1:] > rows[:-1]).all() and rows[0] >= 0:
            rows = slice(None)  # all of them: much faster than by number
        # What is offered to a robot that waits for nothing goes at once.
        self._next_ms[rows] = np.maximum(self._next_ms[rows], now_ms)
        stops = np.logical_and(*(values == self._stop))
        self._stop_waits[rows] |= stops
        self._newest_waits[rows] = ~stops
        self._newest[:, rows] = values.astype(np.float32)  # a robot computes in single precision
        self._offered_ms[rows] = now_ms
        self._is_idle = False
        self._send_due(now_ms)

    def delay_until(self, rows: np.ndarray, next_ms: np.ndarray) -> None:
        """Send nothing to the robots at rows (K,) before next_ms (K,): the last command is still on its way.

        Two in flight could reach a robot together, which would take the older one.
        """
        self._next_ms[rows] = np.maximum(self._next_ms[rows], next_ms)

    def _send_due(self, now_ms: int) -> None:
        if self._is_idle:
            return
        self._newest_waits &= self._offered_ms >= now_ms - MAX_AGE_MS
        due = self._find_waiting()
        due &= self._next_ms <= now_ms
        if np.count_nonzero(due):
            self._send(due)
        self._is_idle = not np.count_nonzero(self._find_waiting())

    def _find_waiting(self) -> np.ndarray:
        waiting = self._repeats > 0
        waiting |= self._stop_waits
        waiting |= self._newest_waits
        return waiting

    def _send(self, due: np.ndarray) -> None:
        moves = due & self._newest_waits & ~self._stop_waits
        stops = due & ~moves
        if np.count_nonzero(stops):
            repeats = np.where(self._stop_waits, STOP_REPEATS, self._repeats - 1)
            np.copyto(self._repeats, repeats, where=stops)
            self._stop_waits[stops] = False
            self._sent[:, stops] = self._stop
        self._repeats[moves] = 0
        self._newest_waits[moves] = False
        np.copyto(self._sent, self._newest, where=moves)
        np.copyto(self._sent_ms, self._next_ms, where=due)
        self._next_ms[due] += INTERVAL_MS
        self._is_sent |= due
        self._has_sent = True

    def take(self, now_ms: int) -> Sent:
        """Return what was sent since the last call, up to now_ms."""
        self._shape_collected()
        self._send_due(now_ms)
        if not self._has_sent:
            return _NOTHING
        rows = self._is_sent.nonzero()[0]
        sent = Sent(rows, self._sent[:, rows], self._sent_ms[rows])
        self._is_sent[rows] = self._has_sent = False
        return sent
