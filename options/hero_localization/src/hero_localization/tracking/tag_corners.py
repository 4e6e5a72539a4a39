"""The corners of a tag in an image. Pure."""

import math
from typing import NamedTuple

import numpy as np


class TagCorners(NamedTuple):
    """A tag in an image."""

    tag_id: int
    corners: np.ndarray
    """(4, 2) px: upper left, upper right, lower right, lower left of the upright print."""

    @property
    def center(self) -> np.ndarray:
        """The crossing of the diagonals, (2,) px: the center of the print, whatever the perspective."""
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = self.corners.tolist()
        area = (cx - ax) * (dy - by) - (cy - ay) * (dx - bx)
        if abs(area) < 1e-9:
            return self.corners.mean(axis=0)
        share = ((bx - ax) * (dy - by) - (by - ay) * (dx - bx)) / area
        return np.array((ax + share * (cx - ax), ay + share * (cy - ay)))

    @property
    def side_px(self) -> float:
        """Side of a square of the same area."""
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = self.corners.tolist()
        return math.sqrt(abs((cx - ax) * (dy - by) - (cy - ay) * (dx - bx)) / 2.0)
