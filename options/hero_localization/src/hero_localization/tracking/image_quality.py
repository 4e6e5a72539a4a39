"""Light, noise and blur of images: why tags are not found. Pure."""

import math
from typing import List, Sequence, Tuple

import numpy as np

DARK, BRIGHT = 35.0, 225.0
"""Limits of the mean shade, of 255."""

MAX_NOISE = 12.0
"""Standard deviation of pixels, of 255: with 20, a tag in fifty is missed in each image."""

BLUR_PX, BLUR_CELLS = 0.35, 0.35
"""Most blur (standard deviation), in pixels and in cells of a tag, as the sum of both: a sharp image has two thirds."""

PERIOD_IMAGES, MAX_TAGS, MIN_TAGS = 30, 7, 3
CELLS = 8


class ImageQuality:
    """Faults of the images of one camera."""

    def __init__(self) -> None:
        self._shade = self._noise = self._blur_px = math.nan
        self._images = 0

    def measure(self, gray: np.ndarray, tags: Sequence[Tuple[np.ndarray, float]]) -> None:
        """Look at an image (H, W), 8 bit; tags: centers and sides of tags in the one before, px."""
        self._shade = float(gray[::16, ::16].mean())
        self._images += 1
        if self._images % PERIOD_IMAGES == 1:
            self._noise = float(np.median(np.abs(np.diff(gray[::16].astype(np.int16), axis=1)))) / 0.954
            blurs_px = [_measure_blur(gray, *tag) for tag in tags[:MAX_TAGS]]
            self._blur_px = float(np.median(blurs_px)) if len(blurs_px) >= MIN_TAGS else math.nan

    def list_problems(self, smallest_px: float) -> List[Tuple[str, bool]]:
        """Return problems as text, and whether tags are surely missed; smallest_px: side of the smallest tag."""
        problems = []
        if self._shade < DARK or self._shade > BRIGHT:
            kind, remedy = ("dark", "more") if self._shade < DARK else ("bright", "less")
            text = f"images are too {kind} (mean {self._shade:.0f} of 255): give {remedy} light or exposure"
            problems.append((text, True))
        if self._noise > MAX_NOISE:
            text = "it is too dark, images are noisy (%.0f of 255): give more light, and the camera less gain"
            problems.append((text % self._noise, False))
        if self._blur_px > BLUR_PX + BLUR_CELLS * smallest_px / CELLS:
            problems.append((f"images are blurred by {self._blur_px:.1f} px: set the focus, clean the lens", False))
        return problems


def _measure_blur(gray: np.ndarray, center: np.ndarray, side_px: float) -> float:
    """Return the blur (standard deviation, px) of the steepest edges of a tag."""
    half_px = max(4, round(side_px / 2.0))
    u, v = (max(half_px, int(place)) for place in center)
    window = gray[v - half_px : v + half_px, u - half_px : u + half_px].astype(float)
    if min(window.shape) < 3:
        return math.nan
    steepest = float(np.percentile(np.hypot(*np.gradient(window)), 98))
    low, high = np.percentile(window, (3, 97))
    return float(high - low) / (math.sqrt(math.tau) * max(steepest, 1e-3))
