"""Projection between arena and pixels of a calibrated camera. Pure.

Pixels are OpenCV's: u right, v down, the center of the first pixel is (0, 0). The optical frame is REP 103's: x right,
y down, z forward. Lenses are those of sensor_msgs/CameraInfo: `plumb_bob`, `rational_polynomial`, and `equidistant`
(fisheye). Source: OpenCV, Camera Calibration and 3D Reconstruction; Fisheye camera model.
"""

from typing import NamedTuple, Sequence, Tuple, Union

import numpy as np

from hero_node import shorten

from ..errors import CalibrationError

MAX_SIZE_PX = 20_000
"""Limit of an image's width and height; cameras have up to 12,000."""

PLUMB_BOB, RATIONAL, EQUIDISTANT = "plumb_bob", "rational_polynomial", "equidistant"
MODELS = {PLUMB_BOB: (0, 4, 5), RATIONAL: (8,), EQUIDISTANT: (4,)}
"""Models of lenses, and how many numbers their distortion has."""
_FISHEYE = "fisheye"
"""Another name of the last."""

MAX_ANGLE_RAD = 1.48
"""Limit of the angle from the optical axis: rays at right angles to it have no x / z."""

_MAX_ROUNDS = 50
_ROUNDING = 1e-10
"""Normalized image coordinates: a ten millionth of a pixel."""


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
        if not distortion.any() and len(distortion) in MODELS[PLUMB_BOB] and model not in (EQUIDISTANT, _FISHEYE):
            model = PLUMB_BOB
        model = EQUIDISTANT if model == _FISHEYE else model
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
        bend = _bend_fisheye if self.model == EQUIDISTANT else _bend
        bent = bend(np.asarray(rays, dtype=float), self.distortion)
        return bent @ self.matrix[:2, :2].T + self.matrix[:2, 2]

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
            return _straighten_fisheye(bent, self.distortion)
        rays = bent.copy()
        error = np.full(rays.shape, np.inf)
        with np.errstate(over="ignore", invalid="ignore"):  # where nothing converges
            for _ in range(_MAX_ROUNDS):
                seen = _bend(rays, self.distortion)
                error = bent - seen
                if self.model == RATIONAL:  # wide ones compress the rim, where plain steps are too short
                    error = error * (np.hypot(*rays.T) / np.maximum(np.hypot(*seen.T), 1e-15))[:, None]
                rays = rays + error
                if not (np.abs(error) > _ROUNDING).any():
                    break
        rays[~(np.abs(error) < 1e-6).all(axis=1)] = np.nan
        return rays


def _bend(rays: np.ndarray, distortion: np.ndarray) -> np.ndarray:
    k1, k2, p1, p2, k3, *rational = distortion
    x, y = rays[..., 0], rays[..., 1]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    if rational:
        k4, k5, k6 = rational
        radial = radial / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack((bent_x, bent_y), axis=-1)


def _bend_fisheye(rays: np.ndarray, distortion: np.ndarray) -> np.ndarray:
    radius = np.maximum(np.hypot(rays[..., :1], rays[..., 1:]), 1e-12)
    angle_rad = np.arctan(radius)
    bent: np.ndarray = rays * (_bend_angle(angle_rad, distortion)[0] / radius)
    return bent


def _straighten_fisheye(bent: np.ndarray, distortion: np.ndarray) -> np.ndarray:
    """Return the rays (N, 2) that a fisheye lens bends to these; nan beyond MAX_ANGLE_RAD."""
    bent_rad = np.maximum(np.hypot(bent[:, :1], bent[:, 1:]), 1e-12)
    angle_rad = np.minimum(bent_rad, MAX_ANGLE_RAD)
    for _ in range(_MAX_ROUNDS):  # Newton's method
        found_rad, slope = _bend_angle(angle_rad, distortion)
        step_rad = (found_rad - bent_rad) / np.maximum(slope, 0.1)
        angle_rad = np.clip(angle_rad - step_rad, 0.0, MAX_ANGLE_RAD)
        if not (np.abs(step_rad) > _ROUNDING).any():
            break
    rays = bent * (np.tan(angle_rad) / bent_rad)
    rays[(np.abs(_bend_angle(angle_rad, distortion)[0] - bent_rad) > 1e-6).ravel()] = np.nan
    return rays


def _bend_angle(angle_rad: np.ndarray, distortion: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return the radius in the image of angles from the axis, per focal length, and its derivative."""
    powers = np.array((1.0, *distortion))
    orders = np.arange(1, 11, 2)
    radius = sum(share * angle_rad**order for share, order in zip(powers, orders))
    slope = sum(share * order * angle_rad ** (order - 1) for share, order in zip(powers, orders))
    return np.asarray(radius), np.asarray(slope)


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
