"""The true size of a print in an image, whatever the camera's gamma, blur and exposure. Pure but for OpenCV.

Where a camera brightens dark shades (gamma), white grows by half a pixel or more, and black squares measure up to 2 %
less. How much follows from the shades of the edges: the print is rendered with the blur and gamma that explain the
image best.
"""

import math
from typing import List, NamedTuple, Optional, Sequence

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

SMALL_PX, MAX_SIZE_ERRORS_PX = 18.0, (0.05, 0.033)
"""Error of the size of a robot's tag below this size, and from it on, by many images of some robots: the second is half
of what 5 mm of height change of 25 px. Gamma makes small tags seem a sixtieth of a pixel larger."""

ROUNDS, MIN_GAIN = 20, 1e-4
FIRST_BLUR_PX = 0.8
STEPS = np.array((0.002, 0.02, 0.5, 0.5, 0.02))
LOW, HIGH = np.array((0.9, 0.3, 1.0, 30.0, 0.4)), np.array((1.1, 4.0, 200.0, 255.0, 4.0))
"""Limits of what is fitted: scale, blur (px), shades of black and white (of 255), gamma."""


def refine_corners(gray: np.ndarray, tags: Sequence[TagCorners], family: str) -> List[TagCorners]:
    """Return tags of an image (H, W), 8 bit, with corners in true distance from their centers."""
    fits = [_fit_print(gray, tag, draw_tag(family, tag.tag_id)) for tag in tags]
    return [tag if fit is None else _scale(tag, fit[0]) for tag, fit in zip(tags, fits)]


class PrintScale(NamedTuple):
    """Findings from the reference tags in an image: about its camera and their printer.

    share: measured size of the reference tags by that of their print; blur_px, gamma: of the image.
    """

    share: float
    blur_px: float
    gamma: float


def find_print_scale(
    camera: Camera, gray: np.ndarray, tags: Sequence[TagCorners], layout: TagLayout, family: str
) -> Optional[PrintScale]:
    """Return the scale of the prints in an image (H, W); None if no reference tag lies well within it."""
    chosen = [tag for tag in tags if tag.tag_id in layout.references]
    fits = [(tag, _fit_print(gray, tag, draw_tag(family, tag.tag_id))) for tag in chosen]
    known = [(_scale(tag, fit[0]), fit) for tag, fit in fits if fit is not None]
    if not known:
        return None
    sizes_m = [fit.size_m for fit in fit_squares(camera, [tag for tag, _ in known], 0.0)]
    _, blur_px, _, _, gamma = np.median([fit for _, fit in known], axis=0)
    return PrintScale(float(np.median(sizes_m)) / layout.reference_size_m, blur_px, gamma)


def estimate_height(
    camera: Camera, gray: np.ndarray, tag: TagCorners, scale: PrintScale, layout: TagLayout, family: str
) -> float:
    """Return the height above the floor (m) of a robot's tag in an image (H, W), by its size; nan at the image's rim.

    It is printed as the reference tags are: the errors of printer and tape measure are the same in both. Blur and gamma
    of the image are those of the reference tags, of which larger tags tell more.
    """
    fit = _fit_print(gray, tag, draw_tag(family, tag.tag_id), scale)
    if fit is None:
        return math.nan
    own_m = fit_squares(camera, [_scale(tag, fit[0])], layout.height_m)[0].size_m
    from_camera_m = float(camera.position_m[2]) - layout.height_m
    return layout.height_m + from_camera_m - from_camera_m * layout.size_m * scale.share / own_m


def find_height_error(camera: Camera, layout: TagLayout) -> float:
    """Return the error, m, that heights of robots' tags by their size may have below a camera."""
    from_camera_m = float(camera.position_m[2]) - layout.height_m
    side_px = float(camera.lens.matrix[0, 0]) * layout.size_m / from_camera_m
    return MAX_SIZE_ERRORS_PX[side_px >= SMALL_PX] / side_px * from_camera_m


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


def _fit_print(
    gray: np.ndarray, tag: TagCorners, cells: np.ndarray, known: Optional[PrintScale] = None
) -> Optional[np.ndarray]:
    """Return scale, blur, black, white and gamma that explain a print best; None at the rim of the image (H, W).

    known: blur and gamma are not fitted, but these.
    """
    from scipy.optimize import least_squares  # takes 0.1 s, which --help does not need

    half_px = math.ceil(0.85 * tag.side_px)
    corner_px, size_px = np.rint(tag.center).astype(int) - half_px, 2 * half_px + 1
    if corner_px.min() < 0 or (corner_px + size_px > gray.shape[::-1]).any():
        return None
    image = gray[corner_px[1] : corner_px[1] + size_px, corner_px[0] : corner_px[0] + size_px].astype(float)
    model = _Print(cells, tag, corner_px, size_px)
    seen = image[model.seen]
    fit = np.clip((1.0, FIRST_BLUR_PX, *np.percentile(seen, (5, 95)), 1.0), LOW, HIGH)
    fitted = np.arange(len(fit))
    if known is not None:
        fit[[1, 4]], fitted = (known.blur_px, known.gamma), np.array((0, 2, 3))

    def compare(values: np.ndarray) -> np.ndarray:
        fit[fitted] = values
        return model.render(fit) - seen

    fit[fitted] = least_squares(
        compare,
        fit[fitted],
        bounds=(LOW[fitted], HIGH[fitted]),
        diff_step=STEPS[fitted] / fit[fitted],
        x_scale=STEPS[fitted],
        ftol=MIN_GAIN,
        max_nfev=ROUNDS,
    ).x
    return fit


def _scale(tag: TagCorners, share: float) -> TagCorners:
    """Return a tag with corners in this many times their distance from the center."""
    return tag._replace(corners=tag.center + share * (tag.corners - tag.center))
