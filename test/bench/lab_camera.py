"""Images as a webcam in a lab takes them: a renderer apart from the simulated camera's, so that none hides a mistake.

Each tag, and a calibration board, is sampled along the rays of 4 x 4 points of each pixel and of several moments of the
exposure; the lens is inverted by a table along the radius. Then, in this order: vignette, blur, gamma, noise, JPEG.
"""

import itertools
import math
from typing import Dict, List, NamedTuple, Sequence, Tuple

import cv2
import numpy as np

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.prints.boards import SQUARE_M, draw_board
from hero_localization.prints.tag_images import draw_tag

SAMPLES = 4
MOMENTS = 5
MAX_RADIUS, RADIUS_STEP = 3.0, 1e-4
"""Of rays, per unit of depth."""
BOARD_CELLS_PX, BOARD_MARGIN = 60, 1
"""Of a square of the board; white squares around it."""
BODY_RADIUS_M, PLATE_RADIUS_M = 0.0375, 0.0365
PENUMBRA_M = 0.003
FLOOR, BODY, BLACK, WHITE = 0.45, 0.05, 0.06, 0.85
"""Reflected shares of the light."""


class LabLens(NamedTuple):
    """Focal length (px), radial distortion, and size of the images."""

    focal_px: float
    k1: float
    k2: float
    size_px: Tuple[int, int] = (1920, 1080)
    k4: float = 0.0
    """First coefficient of the denominator of a rational lens; 0: it has none."""
    is_fisheye: bool = False

    def bend(self, radius: np.ndarray) -> np.ndarray:
        """Return the distance from the principal point at which rays of this slope are seen, by the focal length."""
        bent = np.arctan(radius) if self.is_fisheye else radius
        return bent * (1.0 + self.k1 * bent**2 + self.k2 * bent**4) / (1.0 + self.k4 * bent**2)


LENS_A = LabLens(1391.0, -0.32, 0.11)
LENS_B = LabLens(900.0, -0.38, 0.16)
FISHEYE = LabLens(700.0, -0.02, 0.004, is_fisheye=True)
RATIONAL = LabLens(800.0, -0.1, 0.02, k4=0.2)


SETUPS: Dict[str, Tuple[LabLens, float, Dict[str, float]]] = {
    "f 1391, 2.2 m": (LENS_A, 2.2, {}),
    "f 1391, 2.2 m, gamma 2.2, blur 1.2 px": (LENS_A, 2.2, {"gamma": 2.2, "blur_px": 1.2}),
    "f 900, 1.9 m": (LENS_B, 1.9, {}),
    "f 900, 2.2 m, gamma 2.2": (LENS_B, 2.2, {"gamma": 2.2}),
}
"""Lens, height above the floor, and faults of cameras that are calibrated."""

REFERENCES_M = ((-1.15, -0.58), (1.15, -0.58), (1.15, 0.58), (-1.15, 0.58), (0.0, -0.62), (0.0, 0.62))
REFERENCE_M = 0.1
TAPE_SD_M = 0.0007
"""In x and y each, of places that people measured."""


class LabTag(NamedTuple):
    """A print at a true pose, moving at m/s along its robot's heading and rad/s; robots' tags sit on a disc."""

    tag_id: int
    x_m: float
    y_m: float
    yaw_rad: float = 0.0
    size_m: float = 0.04
    height_m: float = 0.076
    speed_m_s: float = 0.0
    turn_rad_s: float = 0.0
    shade: float = 1.0
    """Share of the light that a shadow leaves; its edge lies edge_m from the center, across edge_rad."""
    edge_rad: float = 0.0
    edge_m: float = 0.0


class LabCamera(NamedTuple):
    """A camera that looks down, tilted."""

    lens: LabLens = LENS_A
    position_m: Tuple[float, float, float] = (0.02, -0.03, 2.2)
    tilt_rad: Tuple[float, float, float] = (math.radians(5.0), math.radians(-3.3), 0.02)
    exposure_s: float = 0.008
    blur_px: float = 0.8
    noise: float = 3.0
    vignette: float = 0.45
    gamma: float = 1.0
    jpeg_quality: int = 80

    @property
    def rotation(self) -> np.ndarray:
        """The rotation from the arena's frame into the optical frame, (3, 3)."""
        return cv2.Rodrigues(np.array(self.tilt_rad))[0] @ np.diag((1.0, -1.0, -1.0))

    @property
    def center_px(self) -> Tuple[float, float]:
        """The principal point."""
        return self.lens.size_px[0] / 2.0 + 7.0, self.lens.size_px[1] / 2.0 - 5.0

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """Return the pixels (N, 2) of points (N, 3)."""
        seen = (points_m - self.position_m) @ self.rotation.T
        return self._bend(seen[:, :2] / seen[:, 2:])

    def _bend(self, rays: np.ndarray) -> np.ndarray:
        """Return the pixels (N, 2) that show rays (N, 2), per unit of depth."""
        radius = np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
        return rays * self.lens.bend(radius) / radius * self.lens.focal_px + self.center_px

    def _find_rays(self, pixels: np.ndarray) -> np.ndarray:
        """Return the rays (N, 2), per unit of depth, that pixels (N, 2) show; those beyond the lens's rim are its."""
        bent = (pixels - self.center_px) / self.lens.focal_px
        bent_r = np.hypot(*bent.T)
        radius = np.arange(0.0, MAX_RADIUS, RADIUS_STEP)
        image_r = self.lens.bend(radius)
        rising = int(np.argmax(np.append(np.diff(image_r) <= 0.0, True))) + 1
        found_r = np.interp(bent_r, image_r[:rising], radius[:rising])
        rays: np.ndarray = bent * (found_r / np.maximum(bent_r, 1e-12))[:, None]
        return rays

    def find_points(self, pixels: np.ndarray, height_m: float) -> np.ndarray:
        """Return the points (N, 2) of the plane at height_m that pixels (N, 2) show."""
        rays = self._find_rays(pixels)
        directions = np.column_stack((rays, np.ones(len(rays)))) @ self.rotation
        share = (height_m - self.position_m[2]) / directions[:, 2]
        return np.array(self.position_m[:2]) + share[:, None] * directions[:, :2]

    def render(self, tags: Sequence[LabTag], random: np.random.RandomState) -> np.ndarray:
        """Return an image (H, W), 8 bit, of tags on an empty floor."""
        width, height = self.lens.size_px
        light = np.full((height, width), FLOOR)
        for tag in tags:
            self._draw(light, tag)
        return self._expose(light, random)

    def render_board(
        self, turn_rad: Sequence[float], position_m: Sequence[float], random: np.random.RandomState
    ) -> np.ndarray:
        """Return an image (H, W), 8 bit, of the calibration board.

        turn_rad: rotation vector, position_m: of its center, both in the optical frame.
        """
        printed = np.pad(draw_board(BOARD_CELLS_PX), BOARD_MARGIN * BOARD_CELLS_PX, constant_values=255)
        cells_m = BOARD_CELLS_PX / SQUARE_M
        rotation = cv2.Rodrigues(np.array(turn_rad, dtype=float))[0]
        # A ray meets the board at x, y of the board, and at the depth that this matrix brings to 1.
        to_ray = np.column_stack((rotation[:, :2], np.array(position_m, dtype=float)))
        half_m = np.array(printed.shape[::-1]) / cells_m / 2.0
        rim = np.array([(x, y) for x in np.linspace(-1, 1, 9) for y in np.linspace(-1, 1, 9)]) * half_m
        seen = np.column_stack((rim, np.ones(len(rim)))) @ to_ray.T
        rim_px = self._bend(seen[:, :2] / seen[:, 2:])
        low = np.maximum(np.floor(rim_px.min(axis=0)).astype(int) - 4, 0)
        high = np.minimum(np.ceil(rim_px.max(axis=0)).astype(int) + 4, self.lens.size_px)
        u, v = np.meshgrid(*[np.arange(start, end) for start, end in zip(low, high)])
        rays = self._find_rays(np.column_stack((u.ravel(), v.ravel())))
        found = np.column_stack((rays, np.ones(len(rays)))) @ np.linalg.inv(to_ray).T
        cells = ((found[:, :2] / found[:, 2:] + half_m) * cells_m).reshape(*u.shape, 2)
        down, right = np.gradient(cells, axis=(0, 1))
        patch = np.zeros(u.shape)
        steps = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
        for step_u, step_v in itertools.product(steps, steps):
            column, row = np.moveaxis((cells + step_u * right + step_v * down).astype(int), 2, 0)
            inside = (np.minimum(column, row) > 0) & (column < printed.shape[1]) & (row < printed.shape[0])
            shade = np.full(u.shape, FLOOR)
            shade[inside] = np.where(printed[row[inside], column[inside]] > 127, WHITE, BLACK)
            patch += shade / SAMPLES**2
        light = np.full(self.lens.size_px[::-1], FLOOR)
        light[low[1] : high[1], low[0] : high[0]] = patch
        return self._expose(light, random)

    def _expose(self, light: np.ndarray, random: np.random.RandomState) -> np.ndarray:
        """Return the image that the camera makes of the light (H, W) that is reflected."""
        width, height = self.lens.size_px
        u, v = np.meshgrid(np.linspace(-1.0, 1.0, width), np.linspace(-1.0, 1.0, height))
        darker: np.ndarray = self.vignette * (0.35 * (u**2 + v**2) + 0.15 * (1.0 + u))
        light = light * (1.0 - darker)
        light = cv2.GaussianBlur(light, (0, 0), self.blur_px)
        image = 255.0 * light ** (1.0 / self.gamma) + random.normal(0.0, self.noise, light.shape)
        gray = np.clip(np.rint(image), 0, 255).astype(np.uint8)
        coded = cv2.imencode(".jpg", gray, (cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality))[1]
        return cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)

    def _draw(self, light: np.ndarray, tag: LabTag) -> None:
        cells = draw_tag("36h11", tag.tag_id)
        is_robot = tag.height_m > 0.0
        reach_m = BODY_RADIUS_M if is_robot else 0.75 * tag.size_m
        around = reach_m * np.array(((-1, -1), (-1, 1), (1, 1), (1, -1))) * 1.5 + (tag.x_m, tag.y_m)
        corners = self.project(np.column_stack((around, np.full(4, tag.height_m))))
        low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
        high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 1, self.lens.size_px)
        if (high - low < 1).any():
            return
        u, v = np.meshgrid(*_list_samples(low, high))
        points_m = self.find_points(np.column_stack((u.ravel(), v.ravel())), tag.height_m)
        moments = MOMENTS if tag.speed_m_s or tag.turn_rad_s else 1
        patch = np.zeros(len(points_m))
        under = np.kron(light[low[1] : high[1], low[0] : high[0]], np.ones((SAMPLES, SAMPLES))).ravel()
        for share in np.linspace(-0.5, 0.5, 2 * moments + 1)[1::2]:
            time_s = share * self.exposure_s
            yaw_rad = tag.yaw_rad + tag.turn_rad_s * time_s
            moved_m = tag.speed_m_s * time_s
            place_m = (tag.x_m + moved_m * math.cos(yaw_rad), tag.y_m + moved_m * math.sin(yaw_rad))
            patch += _shade(points_m - place_m, yaw_rad, tag.size_m, cells, is_robot, under) / moments
        across_m = (points_m - (tag.x_m, tag.y_m)) @ (math.cos(tag.edge_rad), math.sin(tag.edge_rad)) - tag.edge_m
        patch *= 1.0 - (1.0 - tag.shade) * np.clip(0.5 + across_m / PENUMBRA_M, 0.0, 1.0)
        light[low[1] : high[1], low[0] : high[0]] = _average(patch, low, high)


def _list_samples(low: Sequence[int], high: Sequence[int]) -> List[np.ndarray]:
    """Return the samples' columns and rows, px, from the pixels low to before high."""
    return [(np.arange(SAMPLES * (end - start)) + 0.5) / SAMPLES - 0.5 + start for start, end in zip(low, high)]


def _average(samples: np.ndarray, low: Sequence[int], high: Sequence[int]) -> np.ndarray:
    """Return the means (rows, columns) over each pixel of the samples of _list_samples()."""
    columns, rows = np.subtract(high, low)
    mean: np.ndarray = samples.reshape(rows, SAMPLES, columns, SAMPLES).mean(axis=(1, 3))
    return mean


def _shade(
    offsets_m: np.ndarray, yaw_rad: float, size_m: float, cells: np.ndarray, is_robot: bool, under: np.ndarray
) -> np.ndarray:
    """Return the shades (N,) at offsets (N, 2) from a tag's center; under: those of what it lies on."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    front_m = offsets_m @ (cos, sin)
    left_m = offsets_m @ (-sin, cos)
    row = np.floor((0.5 - front_m / size_m) * len(cells)).astype(int)
    column = np.floor((0.5 - left_m / size_m) * len(cells)).astype(int)
    inside = (np.minimum(row, column) >= 0) & (np.maximum(row, column) < len(cells))
    if is_robot:
        radius_m = np.hypot(front_m, left_m)
        shade = np.where(radius_m < PLATE_RADIUS_M, WHITE, np.where(radius_m < BODY_RADIUS_M, BODY, under))
    else:
        shade = np.where(np.maximum(np.abs(front_m), np.abs(left_m)) < 0.7 * size_m, WHITE, under)
    shade[inside] = np.where(cells[row[inside], column[inside]] > 0, WHITE, BLACK)
    return shade


def find_camera(lab: LabCamera) -> Camera:
    """Return the lab's camera as a perfect calibration would find it."""
    lens = lab.lens
    matrix = np.array(((lens.focal_px, 0, lab.center_px[0]), (0, lens.focal_px, lab.center_px[1]), (0, 0, 1.0)))
    model = Intrinsics(*lens.size_px, matrix, np.array((lens.k1, lens.k2, 0.0, 0.0, 0.0)))
    return Camera(model, lab.rotation, np.array(lab.position_m))


def make_lab(random: np.random.RandomState, lens: LabLens, height_m: float, **faults: float) -> LabCamera:
    """Return a camera that is tilted by 6 degrees somewhere, and whose middle shows that of the field."""
    angle_rad, tilt_rad = random.uniform(0.0, math.tau), math.radians(6.0)
    tilt = (tilt_rad * math.cos(angle_rad), tilt_rad * math.sin(angle_rad), random.uniform(-0.3, 0.3))
    lab = LabCamera(lens, (0.0, 0.0, height_m), tilt, **faults)
    aimed_m = lab.find_points(np.array(lens.size_px)[None] / 2.0, 0.0)[0]
    return lab._replace(position_m=(*-aimed_m, height_m))
