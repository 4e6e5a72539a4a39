"""Small shifts of a camera since its calibration, by all reference tags together. Pure but for OpenCV.

A tag's place in one image is right to 0.1 mm, the mean of a second to 0.02 mm: far less than what a shift moves. Where
all tags moved as a moved camera would show them, or all but one, its pose follows them slowly.
"""

import math
from typing import Dict, List, Mapping, Optional, Sequence, Tuple

import cv2
import numpy as np

from hero_node import Pose

from ..camera.camera_model import Camera, solve_camera
from .tag_pose import TagCorners

MIN_TAGS = 4
PERIOD_S = 1.0
MIN_SEEN = 5
"""Images of a period in which a tag must be seen."""

STILL_M = 0.0004
"""Shift, rms over the tags, that is none: light, and the detector."""

EXPLAINED_SHARE, EXPLAINED_M = 0.3, 0.00015
"""Rest of the shift, rms, with the pose of a moved camera; more of it is of tags that moved, or are covered in part."""

STEP_SHARE = 0.4
"""Share of the rest of a shift that is corrected at once."""


class CameraShift:
    """The calibrated camera, shifted as its reference tags show it.

    shift_m: by how much that moves the reference tag that it moves most.
    rest_m: shift of the tags that is not corrected, rms.
    wrong: tag that moved by itself, and by how much (m); None if there is none.
    """

    def __init__(self, camera: Camera, seen: Mapping[int, Pose]) -> None:
        """camera: as calibrated; seen: where it saw the reference tags then."""
        self.camera = self._calibrated = camera
        self.shift_m = self.rest_m = 0.0
        self.wrong: Optional[Tuple[int, float]] = None
        self._places_m = {tag_id: np.array(pose[:2]) for tag_id, pose in seen.items()}
        self._centers: Dict[int, List[np.ndarray]] = {}
        self._start_s = math.inf

    def add(self, tags: Sequence[TagCorners], stamp_s: float) -> None:
        """Take the tags of an image; others than reference tags are ignored."""
        if not self._start_s <= stamp_s:  # time goes back when a recording is played again
            self._start_s = stamp_s
            self._centers.clear()
        for tag in tags:
            if tag.tag_id in self._places_m:
                self._centers.setdefault(tag.tag_id, []).append(tag.center)
        if stamp_s >= self._start_s + PERIOD_S:
            means = {tag_id: np.mean(seen, axis=0) for tag_id, seen in self._centers.items() if len(seen) >= MIN_SEEN}
            self._start_s = stamp_s
            self._centers.clear()
            if len(means) >= MIN_TAGS:
                self._follow(means)

    def _follow(self, means: Mapping[int, np.ndarray]) -> None:
        ids = sorted(means)
        fits: Dict[Optional[int], Tuple[float, Optional[Camera]]] = {}
        for left_out in [None, *ids] if len(ids) > MIN_TAGS else [None]:
            fits[left_out] = self._explain(*self._pair(means, left_out))
            if fits[None][0] <= EXPLAINED_M:
                break
        left_out = min(fits, key=lambda tag_id: fits[tag_id][0])
        moved, self.wrong = fits[left_out][1], None
        if moved is None:
            moved, left_out = self.camera, None
        elif left_out is not None:
            off_m = moved.intersect(means[left_out][None], 0.0)[0] - self._places_m[left_out]
            self.wrong = (left_out, float(np.hypot(*off_m)))
        pixels, places_m = self._pair(means, left_out)
        turn = cv2.Rodrigues(moved.rotation @ self.camera.rotation.T)[0]
        rotation = cv2.Rodrigues(STEP_SHARE * turn)[0] @ self.camera.rotation
        position_m = self.camera.position_m + STEP_SHARE * (moved.position_m - self.camera.position_m)
        self.camera = Camera(self.camera.lens, rotation, position_m)
        self.rest_m = max(0.0, _measure_shift(self.camera, pixels, places_m) - STILL_M)
        off_m = self.camera.intersect(pixels, 0.0) - self._calibrated.intersect(pixels, 0.0)
        self.shift_m = float(np.hypot(*off_m.T).max())

    def _pair(self, means: Mapping[int, np.ndarray], left_out: Optional[int]) -> Tuple[np.ndarray, np.ndarray]:
        """Return pixels and places of the tags, but for one."""
        kept = [tag_id for tag_id in sorted(means) if tag_id != left_out]
        pixels, places_m = (np.array([part[tag_id] for tag_id in kept]) for part in (means, self._places_m))
        return pixels, places_m

    def _explain(self, pixels: np.ndarray, places_m: np.ndarray) -> Tuple[float, Optional[Camera]]:
        """Return the rest of the shift, rms, and the camera, moved or not, with it; None: that explains too little."""
        shift_m = _measure_shift(self._calibrated, pixels, places_m)
        if shift_m <= STILL_M:
            return min(shift_m, EXPLAINED_M), self._calibrated
        points_m = np.column_stack((places_m, np.zeros(len(places_m))))
        fitted = solve_camera(self._calibrated.lens, pixels, points_m, self._calibrated) or self._calibrated
        rest_m = _measure_shift(fitted, pixels, places_m)
        return rest_m, fitted if rest_m < max(EXPLAINED_SHARE * shift_m, EXPLAINED_M) else None


def _measure_shift(camera: Camera, pixels: np.ndarray, places_m: np.ndarray) -> float:
    """Return how far a camera sees tags from their places, rms; inf if it does not see the floor there."""
    off_m = camera.intersect(pixels, 0.0) - places_m
    return float(np.sqrt((off_m**2).sum(axis=1).mean())) if np.isfinite(off_m).all() else math.inf
