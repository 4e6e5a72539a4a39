"""The true size of a print in an image, whatever the camera's gamma, blur and exposure. Pure but for OpenCV.

Where a camera brightens dark shades (gamma), white grows by half a pixel or more, and black squares measure up to 2 %
less. How much follows from the shades of the edges: the print is rendered with the blur and gamma that explain the
image best.
"""

import math
from typing import List, Sequence

import cv2
import numpy as np

from ..camera.camera_model import Camera
from ..prints.tag_images import draw_tag
from ..tracking.tag_pose import TagCorners, TagLayout, fit_squares

SAMPLES = 4
"""Along each side of a pixel."""
CELL_TEXELS = 16
MARGIN_CELLS = 2
"""Margin of white around the print, of which SEEN_CELLS are compared."""
SEEN_CELLS = 0.7

MAX_SIZE_ERROR_PX = 0.04
"""Twice the standard deviation of a size. A tag of 25 px whose height is wrong by 5 mm differs by 0.06 px."""

ROUNDS, MIN_GAIN = 20, 1e-4
FIRST_BLUR_PX = 0.8
STEPS = np.array((0.002, 0.02, 0.5, 0.5, 0.02))
LOW, HIGH = np.array((0.9, 0.3, 1.0, 30.0, 0.4)), np.array((1.1, 4.0, 200.0, 255.0, 4.0))
"""Limits of what is fitted: scale, blur (px), shades of black and white (of 255), gamma."""


def refine_corners(gray: np.ndarray, tags: Sequence[TagCorners], family: str) -> List[TagCorners]:
    """Return tags of an image (H, W), 8 bit, with corners in true distance from their centers."""
    return [_refine(gray, tag, draw_tag(family, tag.tag_id)) for tag in tags]


def estimate_height(
    camera: Camera, gray: np.ndarray, tag_id: int, tags: Sequence[TagCorners], layout: TagLayout, family: str
) -> float:
    """Return a robot's tag's height above the floor (m), by its size beside that of reference tags in an image (H, W).

    All are printed alike: the errors of printer and tape measure are the same in both. The layout's height where they
    differ by less than the image can tell, or are not both seen well within it.
    """
    chosen = [tag for tag in tags if tag.tag_id == tag_id] + [tag for tag in tags if tag.tag_id in layout.references]
    refined = [new for new, tag in zip(refine_corners(gray, chosen, family), chosen) if new is not tag]
    if [tag.tag_id == tag_id for tag in refined[:2]] != [True, False]:
        return layout.height_m
    heights_m = np.array([layout.height_m] + [0.0] * (len(refined) - 1))
    own_m, *others_m = (fit.size_m for fit in fit_squares(camera, refined, heights_m))
    share = own_m / layout.size_m * layout.reference_size_m / float(np.median(others_m))
    if abs(share - 1.0) * refined[0].side_px < MAX_SIZE_ERROR_PX:
        return layout.height_m
    from_camera_m = float(camera.position_m[2]) - layout.height_m
    return layout.height_m + from_camera_m - from_camera_m / share


class _Print:
    """A print as it would look at the place of a tag, in a square of the image."""

    def __init__(self, cells: np.ndarray, tag: TagCorners, corner_px: np.ndarray, size_px: int) -> None:
        texture = np.kron(np.pad(cells, MARGIN_CELLS, constant_values=255), np.ones((CELL_TEXELS, CELL_TEXELS)))
        self._texture = (texture > 127).astype(np.float32)
        count, self._size_px = len(cells), size_px
        self._square = np.array(((0, 0), (count, 0), (count, count), (0, count)), np.float32)
        self._center, self._corners = tag.center - corner_px, tag.corners - corner_px
        to_cells = cv2.getPerspectiveTransform(self._corners.astype(np.float32), self._square)
        pixels = np.stack(np.meshgrid(*[np.arange(size_px, dtype=np.float32)] * 2), axis=-1)
        at_cells = cv2.perspectiveTransform(pixels, to_cells)
        self.seen = (np.abs(at_cells - count / 2.0) < count / 2.0 + SEEN_CELLS).all(axis=2)
        """Pixels (size, size) that show the print."""

    def render(self, fit: np.ndarray) -> np.ndarray:
        """Return the shades (K,) of the seen pixels for scale, blur, black, white and gamma."""
        scale, blur_px, black, white, gamma = fit
        corners = self._center + scale * (self._corners - self._center)
        # Pixels and texels have their centers at whole numbers, corners at halves.
        texels = (self._square + MARGIN_CELLS) * CELL_TEXELS - 0.5
        samples = (corners + 0.5) * SAMPLES - 0.5
        to_samples = cv2.getPerspectiveTransform(texels.astype(np.float32), samples.astype(np.float32))
        size = (SAMPLES * self._size_px,) * 2
        fine = cv2.warpPerspective(self._texture, to_samples, size, borderMode=cv2.BORDER_CONSTANT, borderValue=1.0)
        fine = cv2.GaussianBlur(fine, (0, 0), blur_px * SAMPLES)
        white_share = cv2.resize(fine, (self._size_px,) * 2, interpolation=cv2.INTER_AREA)[self.seen]
        dark, bright = (black / 255.0) ** gamma, (white / 255.0) ** gamma
        shades: np.ndarray = 255.0 * (dark + (bright - dark) * np.clip(white_share, 0.0, 1.0)) ** (1.0 / gamma)
        return shades


def _refine(gray: np.ndarray, tag: TagCorners, cells: np.ndarray) -> TagCorners:
    from scipy.optimize import least_squares  # takes 0.1 s, which --help does not need

    half_px = math.ceil(0.85 * tag.side_px)
    corner_px, size_px = np.rint(tag.center).astype(int) - half_px, 2 * half_px + 1
    if corner_px.min() < 0 or (corner_px + size_px > gray.shape[::-1]).any():
        return tag
    image = gray[corner_px[1] : corner_px[1] + size_px, corner_px[0] : corner_px[0] + size_px].astype(float)
    model = _Print(cells, tag, corner_px, size_px)
    seen = image[model.seen]
    start = np.clip((1.0, FIRST_BLUR_PX, *np.percentile(seen, (5, 95)), 1.0), LOW, HIGH)
    fit = least_squares(
        lambda values: model.render(values) - seen,
        start,
        bounds=(LOW, HIGH),
        diff_step=STEPS / start,
        x_scale=STEPS,
        ftol=MIN_GAIN,
        max_nfev=ROUNDS,
    ).x
    return tag._replace(corners=tag.center + fit[0] * (tag.corners - tag.center))
