"""Images of the arena as the camera would take them. Pure but for OpenCV; deterministic by seed.

Only robots move: floor, walls and tags on the floor are rendered once. A robot's top is an image of its own, already
as blurred as lens and pixels make it; for each frame it is sampled along the rays of the few pixels that show it, at
several moments of the exposure if the robot moves.
"""

import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from hero_node.robot_constants import BODY_RADIUS_M
from hero_sim.world import Arena

from ..prints.tag_images import draw_tag
from .view import CIRCLE, CameraOptions, PrintedTag, list_rays, plane_homography, tag_corners

FLOOR, WALL, OBSTACLE, BODY, TOP, PAPER, SKIN, BLACK, WHITE = 150.0, 70.0, 60.0, 45.0, 205.0, 225.0, 185.0, 25.0, 225.0
"""Shades, of 255."""

WALL_HEIGHT_M = 0.05
HAND_HEIGHT_M, HAND_RADIUS_M = 0.25, 0.06
TEXEL_M = 0.0005
FINE = 2
"""Prints are drawn this many times finer than they are kept: blurred, they need no more."""
NOISE_FIELDS = 4
_SHIFT = 4
"""Bits of a pixel's fraction when polygons are drawn."""


class _Plate(NamedTuple):
    """A flat image with a tag in its middle.

    texture: shade times cover, and cover (0 to 1) of each texel, (T, T, 2), single precision.
    to_texel: turns a place on the robot (x, y, 1; m) into a texel, (3, 3).
    reach_m: how far from the tag's center the image reaches.
    """

    tag: PrintedTag
    texture: np.ndarray
    to_texel: np.ndarray
    reach_m: float


class CameraRenderer:
    """Renders frames of one arena."""

    def __init__(
        self,
        options: CameraOptions,
        arena: Arena,
        robot_tags: Sequence[Optional[PrintedTag]],
        floor_tags: Sequence[PrintedTag] = (),
        seed: int = 0,
    ) -> None:
        """Prepare images of robots with robot_tags (None: without a tag), and of tags in the arena."""
        self.options = options
        self.camera = options.geometry
        self._random = np.random.RandomState(seed)
        self._rays = list_rays(self.camera.lens)
        self._light = self._spread_light()
        self._body_height_m = max((tag.height_m for tag in robot_tags if tag), default=0.076)
        self._plates = {index: self._print_plate(tag) for index, tag in enumerate(robot_tags) if tag}
        self._noise = self._draw_noise()
        image = self._render_floor(arena)
        for tag in floor_tags:
            plate = self._print_plate(tag, is_round=False)
            self._draw_plate(image, plate, np.zeros((1, 3)))
        self._background = image

    def _spread_light(self) -> np.ndarray:
        options = self.options
        u, v = np.meshgrid(np.linspace(0.0, 1.0, options.width_px), np.linspace(0.0, 1.0, options.height_px))
        share = 0.7 * u + 0.3 * v
        return (1.0 - options.light_gradient * share).astype(np.float32)

    def _draw_noise(self) -> List[np.ndarray]:
        """Return fields of noise a little larger than the image; each frame takes one from another corner on."""
        if self.options.noise <= 0.0:
            return []
        shape = (self.options.height_px + 64, self.options.width_px + 64)
        return [
            np.rint(self._random.standard_normal(shape) * self.options.noise).astype(np.int16)
            for _ in range(NOISE_FIELDS)
        ]

    def _render_floor(self, arena: Arena) -> np.ndarray:
        options = self.options
        shade = np.full((options.height_px // 8 + 2, options.width_px // 8 + 2), FLOOR, np.float32)
        shade += (self._random.standard_normal(shade.shape) * 3.0).astype(np.float32)
        image = cv2.resize(cv2.GaussianBlur(shade, (0, 0), 1.5), (options.width_px, options.height_px))
        image = np.clip(image * self._light, 0.0, 255.0).astype(np.uint8)
        for x1_m, y1_m, x2_m, y2_m in arena.segments_m:
            self._draw_prism(image, np.array(((x1_m, y1_m), (x2_m, y2_m))), WALL_HEIGHT_M, WALL)
        for corners_m in arena.polygons_m:
            self._draw_prism(image, np.asarray(corners_m), WALL_HEIGHT_M, OBSTACLE)
        for x_m, y_m, radius_m in arena.circles_m:
            self._draw_prism(image, (x_m, y_m) + radius_m * CIRCLE, WALL_HEIGHT_M, OBSTACLE)
        return cv2.GaussianBlur(image, (0, 0), options.blur_px) if options.blur_px > 0.0 else image

    def _draw_prism(self, image: np.ndarray, outline_m: np.ndarray, height_m: float, shade: float) -> None:
        """Draw what is seen of a solid with a convex outline (K, 2) on the floor."""
        points_m = np.vstack([np.column_stack((outline_m, np.full(len(outline_m), z_m))) for z_m in (0.0, height_m)])
        self._fill(image, self.camera.project(points_m), shade)

    def _fill(self, image: np.ndarray, pixels: np.ndarray, shade: float) -> None:
        far = 4 * max(image.shape)
        if not (np.abs(pixels) < far).all():
            return
        hull = cv2.convexHull(pixels.astype(np.float32))
        column, row = np.clip(hull.mean(axis=(0, 1)), 0, (image.shape[1] - 1, image.shape[0] - 1)).astype(int)
        lit = shade * float(self._light[row, column])
        cv2.fillConvexPoly(image, np.rint(hull * 2**_SHIFT).astype(np.int32), lit, cv2.LINE_AA, _SHIFT)

    def _print_plate(self, tag: PrintedTag, is_round: bool = True) -> _Plate:
        """Return the image of a tag: on a robot's round top, or on a square sheet with a white margin."""
        cells = draw_tag(tag.family, tag.tag_id)
        margin_m = 2.0 * tag.size_m / len(cells)
        # On a robot the plate is the top itself, whose center is not the tag's.
        edge_m = BODY_RADIUS_M + math.hypot(tag.x_m, tag.y_m) if is_round else tag.size_m / 2.0 + margin_m
        reach_m = edge_m + 0.004
        count = 2 * math.ceil(reach_m / TEXEL_M)
        fine_m = TEXEL_M / FINE
        place_m = (np.arange(FINE * count) - (FINE * count - 1) / 2.0) * fine_m
        across_m, down_m = np.meshgrid(place_m, place_m)
        to_tag = _make_transform(tag.x_m, tag.y_m, tag.yaw_rad)
        if is_round:
            ahead_m, left_m = to_tag[:2, 2]  # of the robot's center, seen from the tag
            cover = np.hypot(across_m + left_m, down_m + ahead_m) < BODY_RADIUS_M
        else:
            cover = np.maximum(np.abs(across_m), np.abs(down_m)) < edge_m
        shade = np.full(cover.shape, TOP if is_round else PAPER)
        margin = np.maximum(np.abs(across_m), np.abs(down_m)) < tag.size_m / 2.0 + margin_m / 2.0
        shade[margin] = WHITE
        column = np.floor((across_m / tag.size_m + 0.5) * len(cells)).astype(int)
        row = np.floor((down_m / tag.size_m + 0.5) * len(cells)).astype(int)
        inside = (np.minimum(column, row) >= 0) & (np.maximum(column, row) < len(cells))
        shade[inside] = np.where(cells[row[inside], column[inside]] > 0, WHITE, BLACK)
        texture = np.dstack((shade * cover, cover)).astype(np.float32)
        pixel_m = (self.camera.position_m[2] - tag.height_m) / self.options.focal_px[0]
        width = int(np.rint(pixel_m / fine_m)) | 1
        texture = cv2.blur(texture, (width, width))
        if self.options.blur_px > 0.0:
            texture = cv2.GaussianBlur(texture, (0, 0), self.options.blur_px * pixel_m / fine_m)
        texture = cv2.resize(texture, (count, count), interpolation=cv2.INTER_AREA)
        # The print's right is the tag's -y, its down is -x. Texel centers lie at whole numbers.
        scale, center = 1.0 / TEXEL_M, (count - 1) / 2.0
        texel = np.array(((0.0, -scale, center), (-scale, 0.0, center), (0.0, 0.0, 1.0)))
        return _Plate(tag, texture, texel @ to_tag, reach_m)

    def _draw_plate(self, image: np.ndarray, plate: _Plate, poses: np.ndarray) -> None:
        """Draw a plate at its robot's poses (M, 3) during one exposure."""
        tag = plate.tag
        around = PrintedTag(tag.tag_id, 2.0 * plate.reach_m, tag.height_m, tag.x_m, tag.y_m, tag.yaw_rad)
        corners = self.camera.project(tag_corners(around, poses[[0, -1]])).reshape(-1, 2)
        height, width = image.shape
        left, top = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, (width, height))
        right, bottom = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, (width, height))
        if right <= left or bottom <= top:
            return
        rays = self._rays[top:bottom, left:right]
        plane = plane_homography(self.camera, tag.height_m)
        samples = []
        for pose in poses:
            texels = cv2.perspectiveTransform(rays, plate.to_texel @ _make_transform(*pose) @ plane)
            samples.append(cv2.remap(plate.texture, texels, None, cv2.INTER_LINEAR))
        shade, cover = cv2.split(sum(samples) * (1.0 / len(samples)))
        patch = image[top:bottom, left:right]
        patch[:] = np.rint(patch * (1.0 - cover) + shade * self._light[top:bottom, left:right])

    def render(
        self, poses: np.ndarray, speeds: Optional[np.ndarray] = None, hand_m: Optional[Tuple[float, float]] = None
    ) -> np.ndarray:
        """Return the next frame (H, W), gray, 8 bit.

        poses: true poses (N, 3) at the middle of the exposure.
        speeds: linear (m/s) and angular speed (rad/s), (N, 2); None: all stand.
        hand_m: a hand reaches into the image, over this place.
        """
        poses = np.asarray(poses, dtype=float).reshape(-1, 3)
        moving = np.zeros((len(poses), 2)) if speeds is None else np.asarray(speeds, dtype=float)
        image = self._background.copy()
        for pose in poses:
            self._draw_prism(image, pose[:2] + BODY_RADIUS_M * CIRCLE, self._body_height_m, BODY)
        for index, plate in self._plates.items():
            if index < len(poses):
                self._draw_plate(image, plate, self._list_moments(poses[index], *moving[index]))
        if hand_m is not None:
            outline_m = np.column_stack((hand_m + HAND_RADIUS_M * CIRCLE, np.full(len(CIRCLE), HAND_HEIGHT_M)))
            self._fill(image, self.camera.project(outline_m), SKIN)
        if self._noise:
            down, right = self._random.randint(0, 64, 2)
            field = self._noise[self._random.randint(NOISE_FIELDS)]
            height, width = image.shape
            image = cv2.add(image, field[down : down + height, right : right + width], dtype=cv2.CV_8U)
        return image

    def _list_moments(self, pose: np.ndarray, linear_m_s: float, angular_rad_s: float) -> np.ndarray:
        """Return the poses (M, 3) over the exposure: one for each half pixel of motion, at most eight."""
        exposure_s = self.options.exposure_s
        moved_m = (abs(linear_m_s) + 0.03 * abs(angular_rad_s)) * exposure_s
        pixel_m = self.camera.position_m[2] / self.options.focal_px[0]
        count = min(8, 1 + math.ceil(2.0 * moved_m / pixel_m - 0.1)) if moved_m > 0.0 else 1
        times_s = ((np.arange(count) + 0.5) / count - 0.5) * exposure_s
        heading = pose[2] + angular_rad_s * times_s / 2.0
        moved = linear_m_s * times_s
        return np.column_stack(
            (pose[0] + moved * np.cos(heading), pose[1] + moved * np.sin(heading), pose[2] + angular_rad_s * times_s)
        )


def _make_transform(x_m: float, y_m: float, yaw_rad: float) -> np.ndarray:
    """Return the matrix (3, 3) that transforms a point (x, y, 1; m) into the frame of a pose."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array(((cos, sin, -cos * x_m - sin * y_m), (-sin, cos, sin * x_m - cos * y_m), (0.0, 0.0, 1.0)))
