"""The ChArUco board as the simulated camera sees it. Pure but for OpenCV."""

from typing import Iterator, Sequence, Tuple

import cv2
import numpy as np

from ..prints.boards import SQUARE_M, draw_board
from .view import CameraOptions, list_rays

TEXEL_M = 0.00025

Vector = Tuple[float, float, float]


def list_board_places(options: CameraOptions, random: np.random.RandomState) -> Iterator[Tuple[Vector, Vector]]:
    """Yield, without end, turns and places of a board that is held all over the image, tilted: see render()."""
    (fx, fy), (cx, cy) = options.focal_px, options.center_px
    index = 0
    while True:
        u = options.width_px * (0.18 + 0.32 * (index % 3))
        v = options.height_px * (0.2 + 0.3 * (index // 3 % 3))
        distance_m = random.uniform(0.35, 0.5)
        tilt_rad = random.choice((-1.0, 1.0), 2) * random.uniform(0.25, 0.6, 2)
        rotation_rad = (float(tilt_rad[0]), float(tilt_rad[1]), random.uniform(-0.3, 0.3))
        yield rotation_rad, ((u - cx) / fx * distance_m, (v - cy) / fy * distance_m, distance_m)
        index += 1


class BoardRenderer:
    """Images of the board that is held before the camera."""

    def __init__(self, options: CameraOptions) -> None:
        """options: lens, blur and noise of the camera."""
        self._options = options
        self._rays = list_rays(options.geometry.lens)
        per_square = round(SQUARE_M / TEXEL_M)
        margin = [2 * per_square] * 4
        printed = cv2.copyMakeBorder(draw_board(per_square), *margin, cv2.BORDER_CONSTANT, value=255)
        self._texture = printed.astype(np.float32)

    def render(
        self, rotation_rad: Sequence[float], position_m: Sequence[float], random: np.random.RandomState
    ) -> np.ndarray:
        """Return an image (H, W), gray, 8 bit.

        Args:
            rotation_rad: rotation vector of the board, in the optical frame.
            position_m: of the board's center, in the optical frame.
            random: noise is drawn from it.
        """
        options = self._options
        rotation = cv2.Rodrigues(np.array(rotation_rad, dtype=float))[0]
        # A point of the board, x and y from its center, lies along the ray that this matrix gives.
        to_ray = np.column_stack((rotation[:, 0], rotation[:, 1], np.asarray(position_m, dtype=float)))
        scale = 1.0 / TEXEL_M
        height, width = self._texture.shape
        to_texel = np.array(((scale, 0.0, (width - 1) / 2.0), (0.0, scale, (height - 1) / 2.0), (0.0, 0.0, 1.0)))
        pixel_texels = scale * float(position_m[2]) / options.focal_px[0]
        count = int(np.rint(pixel_texels)) | 1
        blurred = cv2.blur(self._texture, (count, count))
        smooth = cv2.GaussianBlur(blurred, (0, 0), max(options.blur_px, 0.1) * pixel_texels)
        texels = cv2.perspectiveTransform(self._rays, to_texel @ np.linalg.inv(to_ray))
        image = cv2.remap(smooth, texels, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=110.0)
        noisy = 20.0 + 0.8 * image + random.standard_normal(image.shape) * options.noise
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
