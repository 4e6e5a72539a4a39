"""Projection between arena and pixels of a calibrated camera. Pure but for OpenCV.

Pixels are OpenCV's: u right, v down, the center of the first pixel is (0, 0). The optical frame is REP 103's: x right,
y down, z forward. Lenses are those of sensor_msgs/CameraInfo: `plumb_bob`, `rational_polynomial`, and `equidistant`
(fisheye). Source: OpenCV, Camera Calibration and 3D Reconstruction; Fisheye camera model.
"""

from typing import NamedTuple, Optional, Sequence, Union

import cv2
import numpy as np

from hero_node import shorten

from ..errors import CalibrationError

MAX_SIZE_PX = 20_000
"""Limit of an image's width and height; cameras have up to 12,000."""

PLUMB_BOB, RATIONAL, EQUIDISTANT = "plumb_bob", "rational_polynomial", "equidistant"
MODELS = {PLUMB_BOB: (0, 4, 5), RATIONAL: (8,), EQUIDISTANT: (4,)}
"""Models of lenses, and how many numbers their distortion has."""
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 50, 1e-10)
"""Rounds, and error in normalized image coordinates: a ten millionth of a pixel."""


class Intrinsics(NamedTuple):
    """Projection of directions in the optical frame to pixels."""

    width_px: int
    height_px: int
    matrix: np.ndarray
    """Focal lengths and principal point, (3, 3), px: K of CameraInfo."""
    distortion: np.ndarray
    """k1, k2, p1, p2, k3 (rational: and k4, k5, k6; equidistant: k1 to k4): D of CameraInfo."""
    model: str = PLUMB_BOB
    """One of MODELS."""

    @classmethod
    def from_camera_info(
        cls, width_px: int, height_px: int, matrix: Sequence[float], model: str, d: Sequence[float]
    ) -> "Intrinsics":
        """Return the intrinsics that a sensor_msgs/CameraInfo describes (K as nine numbers, distortion_model, D).

        Raises: ValueError for images of no size, a camera that is not calibrated, or a lens of another model.
        """
        if not (0 < width_px <= MAX_SIZE_PX and 0 < height_px <= MAX_SIZE_PX):
            size = f"{shorten(width_px)} x {shorten(height_px)}"
            raise ValueError("images must have 1 to %d pixels in width and height, not %s" % (MAX_SIZE_PX, size))
        values = np.asarray(matrix, dtype=float).reshape(-1)
        if values.shape != (9,) or not np.isfinite(values).all() or values[0] <= 0.0 or values[4] <= 0.0:
            raise ValueError(f"this camera is not calibrated: K is {list(values)}")
        distortion = np.asarray(d, dtype=float).reshape(-1)
        model = EQUIDISTANT if model == "fisheye" else model
        if not distortion.any() and len(distortion) in MODELS[PLUMB_BOB] and model != EQUIDISTANT:
            model = PLUMB_BOB
        if len(distortion) not in MODELS.get(model, ()):
            known = ", ".join("%s (%s numbers)" % (name, counts[-1]) for name, counts in MODELS.items())
            raise ValueError(f"a lens of the model {model!r} with {len(distortion)} numbers; known are: {known}")
        if not np.isfinite(distortion).all():
            raise ValueError(f"the distortion of a lens must be finite, not {list(distortion)}")
        if model == PLUMB_BOB:
            distortion = np.concatenate((distortion, np.zeros(5 - len(distortion))))
        return cls(int(width_px), int(height_px), values.reshape(3, 3), distortion, model)

    def check_size(self, height_px: int, width_px: int) -> None:
        """Refuse images of another size. Raises: CalibrationError."""
        if (width_px, height_px) != (self.width_px, self.height_px):
            raise CalibrationError(
                "images have %d x %d pixels, but the lens was calibrated with %d x %d: set the camera to that, or"
                " calibrate lens and arena again" % (width_px, height_px, self.width_px, self.height_px)
            )

    def distort(self, rays: np.ndarray) -> np.ndarray:
        """Return the pixels (..., 2) of rays (..., 2): x / z and y / z in the optical frame."""
        return self._bend(np.asarray(rays, dtype=float)) @ self.matrix[:2, :2].T + self.matrix[:2, 2]

    def undistort(self, pixels: np.ndarray) -> np.ndarray:
        """Return the rays (N, 2) of pixels (N, 2): x / z and y / z in the optical frame.

        Pixels beyond what the lens can show, where the distortion folds back, are nan.
        """
        # Not by linalg.solve: OpenBLAS has several threads for it, which then spin and cost more than everything else.
        (focal_u, skew, center_u), (_, focal_v, center_v) = self.matrix[:2].tolist()
        u, v = np.asarray(pixels, dtype=float).reshape(-1, 2).T
        bent_y = (v - center_v) / focal_v
        bent = np.column_stack(((u - center_u - skew * bent_y) / focal_u, bent_y))
        if self.model == EQUIDISTANT:
            rays = cv2.fisheye.undistortPoints(bent[:, None], np.eye(3), self.distortion)[:, 0]
        else:
            undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # OpenCV 5 made them one
            still = np.eye(3)
            rays = undistort(bent[:, None], still, self.distortion, R=still, P=still, criteria=_CRITERIA)[:, 0]
        with np.errstate(over="ignore", invalid="ignore"):
            rays[~(np.abs(self._bend(rays) - bent) < 1e-6).all(axis=1)] = np.nan
        return rays

    def _bend(self, rays: np.ndarray) -> np.ndarray:
        """Return rays (..., 2) as the lens bends them; not by projectPoints, which computes all derivatives too."""
        if self.model == EQUIDISTANT:
            return cv2.fisheye.distortPoints(rays.reshape(-1, 1, 2), np.eye(3), self.distortion).reshape(rays.shape)
        k1, k2, p1, p2, k3, k4, k5, k6 = (*self.distortion, 0.0, 0.0, 0.0)[:8]
        x, y = rays[..., 0], rays[..., 1]
        r2 = x * x + y * y
        radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        return np.stack((bent_x, bent_y), axis=-1)


class Camera(NamedTuple):
    """Intrinsics and pose (extrinsics) in the frame `map`."""

    lens: Intrinsics
    rotation: np.ndarray
    """(3, 3): turns a vector of `map` into the optical frame."""
    position_m: np.ndarray
    """(3,), in `map`."""

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """Return the pixels (..., 2) of points (..., 3) in `map`; nan behind the camera."""
        seen_m = (np.asarray(points_m, dtype=float) - self.position_m) @ self.rotation.T
        depth_m = np.where(seen_m[..., 2:] > 1e-6, seen_m[..., 2:], np.nan)
        return self.lens.distort(seen_m[..., :2] / depth_m)

    def intersect(self, pixels: np.ndarray, height_m: Union[float, np.ndarray]) -> np.ndarray:
        """Return the points x, y (N, 2) in `map` that pixels (N, 2) show of the plane z = height_m; nan for none.

        height_m is one height, or one for each pixel (N,).
        """
        rays = self.lens.undistort(pixels)
        directions = np.column_stack((rays, np.ones(len(rays)))) @ self.rotation
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (height_m - self.position_m[2]) / directions[:, 2]
        distance[~(distance > 0.0)] = np.nan
        return self.position_m[:2] + distance[:, None] * directions[:, :2]


def solve_camera(
    lens: Intrinsics, pixels: np.ndarray, points_m: np.ndarray, start: Optional[Camera] = None
) -> Optional[Camera]:
    """Return the camera that sees points (N, 3) in `map` at pixels (N, 2), sought from start; None if there is none."""
    guess = () if start is None else (cv2.Rodrigues(start.rotation)[0], -start.rotation @ start.position_m, True)
    try:  # by rays, as solvePnP does not know all models of lenses
        is_found, turn, shift_m = cv2.solvePnP(points_m, lens.undistort(pixels), np.eye(3), None, *guess)
    except cv2.error:
        return None
    if not (is_found and np.isfinite(turn).all() and np.isfinite(shift_m).all()):
        return None
    rotation = cv2.Rodrigues(turn)[0]
    return Camera(lens, rotation, (-rotation.T @ shift_m).ravel())
