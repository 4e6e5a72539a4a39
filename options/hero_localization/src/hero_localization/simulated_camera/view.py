"""The simulated lab: camera above the arena, when its images come, reference tags, and the camera file of it all.

Frame `world` as in the arena. Pixels as in OpenCV: the center of the first one is (0, 0).
"""

from typing import Iterator, List, NamedTuple, Sequence, Tuple

import cv2
import numpy as np

from hero_node import Pose, transform_pose
from hero_sim.world import Arena

from ..camera.camera_model import Camera, Intrinsics
from ..errors import SettingsError
from ..prints.tag_images import REFERENCE_SIZE_M
from ..tracking import settings as camera_file
from ..tracking.tag_pose import list_corners

_ANGLES_RAD = np.linspace(0.0, 2.0 * np.pi, 25)[:-1]
CIRCLE = np.column_stack((np.cos(_ANGLES_RAD), np.sin(_ANGLES_RAD)))
"""Points of the unit circle, (24, 2)."""

FIRST_REFERENCE_ID = 100
REFERENCE_GAP_M = 0.12
"""Distance between the arena's bounds and the centers of the reference tags beside it."""

OVERLAP_M = 0.2
"""Width of the strip beyond its part of the arena that a camera of several sees too."""

SHEET = 1.3
"""Side of a reference tag with the white margin that detectors need, in sides of the tag."""

HEIGHT_STEP_M = 0.05
MIN_SIDE_PX = 12.0
"""Smaller tags of robots are hardly ever found."""


class CameraOptions(NamedTuple):
    """The simulated camera; by default, a webcam 2.2 m above the floor that sees 3 m by 1.7 m."""

    width_px: int = 1920
    height_px: int = 1080
    focal_px: Tuple[float, float] = (1390.0, 1390.0)
    center_px: Tuple[float, float] = (948.0, 551.0)
    distortion: Tuple[float, ...] = (-0.09, 0.02, 0.0006, -0.0004, 0.0)
    """plumb_bob: k1, k2, p1, p2, k3."""
    position_m: Tuple[float, float, float] = (0.03, -0.02, 2.2)
    tilt_rad: Tuple[float, float, float] = (0.02, -0.015, 0.01)
    """Rotation vector, in the optical frame, from looking straight down with world's x axis to the right."""
    blur_px: float = 0.7
    noise: float = 3.0
    """Standard deviation, of 255."""
    light_gradient: float = 0.35
    """Share of the light that is missing at the darkest corner."""
    exposure_s: float = 0.008
    rate_hz: float = 30.0
    delay_s: float = 0.07
    """Time from the middle of the exposure to the image's arrival."""
    delay_jitter_s: float = 0.01
    """Images are late by up to this much more."""
    dropped_share: float = 0.02

    @property
    def geometry(self) -> Camera:
        """Intrinsics and extrinsics, in `world`."""
        (fx, fy), (cx, cy) = self.focal_px, self.center_px
        matrix = np.array(((fx, 0.0, cx), (0.0, fy, cy), (0.0, 0.0, 1.0)))
        rotation = cv2.Rodrigues(np.array(self.tilt_rad))[0] @ np.diag((1.0, -1.0, -1.0))
        lens = Intrinsics(self.width_px, self.height_px, matrix, np.array(self.distortion))
        return Camera(lens, rotation, np.array(self.position_m))


def list_frames(options: CameraOptions, start_s: float = 0.0, seed: int = 0) -> Iterator[Tuple[float, float]]:
    """Yield the middle of the exposure and the arrival of images from start_s on, but for those that are dropped."""
    random = np.random.RandomState(seed)
    index, arrival_s = 0, -np.inf
    while True:
        stamp_s = start_s + index / options.rate_hz
        late_s = random.random_sample() * options.delay_jitter_s
        is_dropped = random.random_sample() < options.dropped_share
        index += 1
        if not is_dropped:
            arrival_s = max(arrival_s, stamp_s + options.delay_s + late_s)
            yield stamp_s, float(arrival_s)


class PrintedTag(NamedTuple):
    """A printed tag, on a robot (place in base_link) or in the arena (place in world)."""

    tag_id: int
    size_m: float = 0.040
    """Side of the black square."""
    height_m: float = 0.076
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    """Direction of the print's upper edge as seen from its center: 0 points to the front."""
    family: str = "36h11"


def list_rays(lens: Intrinsics) -> np.ndarray:
    """Return the direction x / z, y / z of each pixel, (H, W, 2), single precision."""
    u, v = np.meshgrid(np.arange(lens.width_px, dtype=np.float32), np.arange(lens.height_px, dtype=np.float32))
    return lens.undistort(np.dstack((u, v))).reshape(lens.height_px, lens.width_px, 2).astype(np.float32)


def plane_homography(camera: Camera, height_m: float) -> np.ndarray:
    """Return what turns directions (x / z, y / z, 1) into points of the plane z = height_m, (3, 3)."""
    x_axis, y_axis, z_axis = camera.rotation.T
    x_m, y_m, z_m = camera.position_m
    return np.vstack((x_m * z_axis + (height_m - z_m) * x_axis, y_m * z_axis + (height_m - z_m) * y_axis, z_axis))


def tag_corners(tag: PrintedTag, poses: np.ndarray) -> np.ndarray:
    """Return the corners (N, 4, 3) in world of one tag mounted at each of poses (N, 3), in the order of TagCorners."""
    mount = Pose(tag.x_m, tag.y_m, tag.yaw_rad)
    tags = [transform_pose(Pose(*pose), mount) for pose in poses.tolist()]
    return np.array([list_corners(pose, tag.size_m, tag.height_m) for pose in tags])


def list_references(arena: Arena, cameras: int = 1) -> List[PrintedTag]:
    """Return the reference tags, on the floor beside the arena, where they are meant to lie: at whole millimeters.

    cameras: number of them along x; where the parts of two meet, two more tags lie for both.
    """
    x_min_m, y_min_m, x_max_m, y_max_m = arena.bounds_m.tolist()
    y_m = 0.8 * (y_max_m - y_min_m) / 2.0
    middle_m = (y_min_m + y_max_m) / 2.0
    places_m = [
        (x_m, middle_m + side * y_m)
        for x_m in (x_min_m - REFERENCE_GAP_M, x_max_m + REFERENCE_GAP_M)
        for side in (-1.0, 0.0, 1.0)
    ]
    for x_m in np.linspace(x_min_m, x_max_m, cameras + 1)[1:-1].tolist():
        places_m += [(x_m, y_min_m - REFERENCE_GAP_M), (x_m, y_max_m + REFERENCE_GAP_M)]
    return [
        PrintedTag(FIRST_REFERENCE_ID + index, REFERENCE_SIZE_M, 0.0, round(x_m, 3), round(y_m, 3))
        for index, (x_m, y_m) in enumerate(places_m)
    ]


def find_part(arena: Arena, number: int, cameras: int) -> Arena:
    """Return an arena with the bounds of what one of some cameras along x sees of it; number: from 1 on."""
    x_min_m, y_min_m, x_max_m, y_max_m = arena.bounds_m.tolist()
    edges_m = np.linspace(x_min_m, x_max_m, cameras + 1)
    low_m, high_m = max(x_min_m, edges_m[number - 1] - OVERLAP_M), min(x_max_m, edges_m[number] + OVERLAP_M)
    return arena._replace(bounds_m=np.array((low_m, y_min_m, high_m, y_max_m)))


def describe_references(references: Sequence[PrintedTag]) -> str:
    """Return the line of a camera file that holds the places of reference tags."""
    places = ["%d: [%.3f, %.3f, 0]" % (tag.tag_id, tag.x_m, tag.y_m) for tag in references]
    return "references: {%s}" % ", ".join(places)


def hang_above(
    camera: CameraOptions, arena: Arena, references: Sequence[PrintedTag], tag_size_m: float
) -> CameraOptions:
    """Return the camera moved over the middle of an arena, and so high that it sees all of it and references beside it.

    Raises: SettingsError if robots' tags would be too small from there.
    """
    x_min_m, y_min_m, x_max_m, y_max_m = arena.bounds_m.tolist()
    corners_m = [(x_m, y_m, PrintedTag(0).height_m) for x_m in (x_min_m, x_max_m) for y_m in (y_min_m, y_max_m)]
    low_m, high_m = x_min_m - 1.01 * REFERENCE_GAP_M, x_max_m + 1.01 * REFERENCE_GAP_M
    sheets = [tag._replace(size_m=SHEET * tag.size_m) for tag in references if low_m < tag.x_m < high_m]
    seen_m = np.vstack([corners_m, *(tag_corners(tag, np.zeros((1, 3)))[0] for tag in sheets)])
    off_x_m, off_y_m, height_m = camera.position_m
    middle_m = (off_x_m + (x_min_m + x_max_m) / 2.0, off_y_m + (y_min_m + y_max_m) / 2.0)
    while tag_size_m * camera.focal_px[0] > MIN_SIDE_PX * height_m:
        camera = camera._replace(position_m=(*middle_m, height_m))
        if _lies_in(camera.geometry, seen_m):
            return camera
        height_m = round(height_m + HEIGHT_STEP_M, 3)
    text = "from %.1f m above an arena of %.1f x %.1f m, tags of %.0f mm measure less than %.0f px: take a larger"
    size_m = (x_max_m - x_min_m, y_max_m - y_min_m)
    raise SettingsError((text + " --width or --tag-size") % (height_m, *size_m, 1e3 * tag_size_m, MIN_SIDE_PX))


def _lies_in(camera: Camera, points_m: np.ndarray) -> bool:
    """Return whether an image shows all of points (N, 3) in world."""
    pixels = camera.project(points_m)
    return bool(((pixels >= 0.0) & (pixels <= (camera.lens.width_px - 1.0, camera.lens.height_px - 1.0))).all())


def list_seen(camera: Camera, tags: Sequence[PrintedTag]) -> List[PrintedTag]:
    """Return those of tags on the floor that lie in the image, with their white margin."""
    sheets = [tag_corners(tag._replace(size_m=SHEET * tag.size_m), np.zeros((1, 3)))[0] for tag in tags]
    return [tag for tag, corners_m in zip(tags, sheets) if _lies_in(camera, corners_m)]


def write_camera_file(path: str, camera: Camera, tags: Sequence[PrintedTag], references: Sequence[PrintedTag]) -> None:
    """Write a camera file as calibrations without any error would. Raises: SettingsError."""
    mounts, places = ({tag.tag_id: Pose(tag.x_m, tag.y_m, tag.yaw_rad) for tag in part} for part in (tags, references))
    parts = {
        "family": tags[0].family,
        "tag_size_m": tags[0].size_m,
        "references": {tag_id: camera_file.describe_pose(pose) for tag_id, pose in places.items()},
        "mounts": {tag_id: camera_file.describe_pose(pose) for tag_id, pose in mounts.items()},
        "delay_s": 0.0,
        **camera_file.describe_camera(camera, places),
    }
    camera_file.update(path, parts)
