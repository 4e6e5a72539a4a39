"""What a detector would find in the camera's pictures, without the pictures: for swarms too large to render. Pure."""

from typing import List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from .view import CameraOptions, PrintedTag, View, hand_outlines, tag_corners

__all__ = ["CornerLister", "SeenTag"]

NOISE_PX = 0.06
"""Standard deviation of a corner's place, as measured on rendered pictures."""


class SeenTag(NamedTuple):
    """A tag in a picture."""

    tag_id: int
    corners: np.ndarray
    """(4, 2) px: upper left, upper right, lower right, lower left of the upright print."""


class CornerLister:
    """Lists the tags that one camera sees."""

    def __init__(
        self,
        options: CameraOptions,
        robot_tags: Sequence[Optional[PrintedTag]],
        noise_px: float = NOISE_PX,
        missed_share: float = 0.005,
        seed: int = 0,
    ) -> None:
        self.view = View(options)
        self._size_px = (options.width_px, options.height_px)
        self._tags = {index: tag for index, tag in enumerate(robot_tags) if tag is not None}
        self._noise_px, self._missed_share = noise_px, missed_share
        self._random = np.random.RandomState(seed)

    def list_tags(self, poses: np.ndarray, hand_m: Optional[Tuple[float, float]] = None) -> List[SeenTag]:
        """Return the tags of robots at poses (N, 3) that lie in the picture, are not covered, and are not missed."""
        if not self._tags:
            return []
        corners_m = np.array([tag_corners(tag, poses[[index]])[0] for index, tag in self._tags.items()])
        pixels = self.view.project(corners_m)
        inside = ((pixels >= 0.0) & (pixels <= np.array(self._size_px) - 1.0)).all(axis=(1, 2))
        pixels += self._random.normal(0.0, self._noise_px, pixels.shape)
        found = inside & (self._random.random_sample(len(self._tags)) >= self._missed_share)
        covers = (
            [] if hand_m is None else [self.view.project(outline_m) for outline_m in hand_outlines(hand_m)]
        )
        return [
            SeenTag(tag.tag_id, corners)
            for tag, corners, is_found in zip(self._tags.values(), pixels, found)
            if is_found and not any(_covers(cover, corners) for cover in covers)
        ]


def _covers(outline: np.ndarray, corners: np.ndarray) -> bool:
    hull = outline.astype(np.float32)
    return any(cv2.pointPolygonTest(hull, (float(u), float(v)), False) >= 0.0 for u, v in corners)
