"""Infrared readings of single robots: those that are due in the same physics step are computed together.

Pure. Together five readings cost hardly more than one.
"""

from typing import Dict

import numpy as np

from .world import STEP_MS, World


class SharedReadings:
    """The infrared readings of all robots in a world.

    Attributes:
        due_ms: when each robot is expected to read its sensors (R,); one that reads at another time pays for it alone.
    """

    def __init__(self, world: World) -> None:
        """Expect no reading yet."""
        self.due_ms = np.full(len(world.poses), -STEP_MS)
        self._world = world
        self._time_ms = -1
        self._readings: Dict[int, np.ndarray] = {}

    def read(self, row: int) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors of a robot; each is given once."""
        time_ms = self._world.time_ms
        if self._time_ms != time_ms:
            self._time_ms, self._readings = time_ms, {}
        if row not in self._readings:
            # A step's state is shown until its next one.
            due = (self.due_ms > time_ms) & (self.due_ms <= time_ms + STEP_MS)
            due[row] = True
            rows = due.nonzero()[0]
            self._readings = dict(zip(rows.tolist(), self._world.read_infrared(rows)))
        self.due_ms[row] = -STEP_MS
        return self._readings.pop(row)
