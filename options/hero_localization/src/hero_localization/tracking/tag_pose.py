"""Turns corners in an image into poses in `map`: of robots, objects and reference tags. Pure.

The corners' rays are cut with the plane in which the tag lies, whose height is known. The pose of a single tag from its
own perspective would need no height, but of a small tag seen from above it is ten times worse, and flips.
"""

import math
from collections import Counter
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np

from hero_node import Pose, find_frame, measure_distance

from ..camera.camera_model import Camera
from ..prints.tag_images import DEFAULT_SIZE_M, REFERENCE_SIZE_M

DEFAULT_HEIGHT_M = 0.076
CENTERED = Pose(0.0, 0.0, 0.0)

CORNER_PX = 0.1
"""Standard deviation of a corner's place: twice what is measured on still images."""
SYSTEMATIC_M, SYSTEMATIC_RAD = 0.0007, 0.003
"""Errors that remain after calibration: intrinsics, extrinsics, tag on the robot."""

MAX_SIZE_ERROR = 0.15
"""A tag whose size is off by a larger share is a false detection, or a print of another size."""


class TagCorners(NamedTuple):
    """A tag in an image."""

    tag_id: int
    corners: np.ndarray
    """(4, 2) px: upper left, upper right, lower right, lower left of the upright print."""

    @property
    def center(self) -> np.ndarray:
        """The crossing of the diagonals, (2,) px: the center of the print, whatever the perspective."""
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = self.corners.tolist()
        area = (cx - ax) * (dy - by) - (cy - ay) * (dx - bx)
        if abs(area) < 1e-9:
            return self.corners.mean(axis=0)
        share = ((bx - ax) * (dy - by) - (by - ay) * (dx - bx)) / area
        return np.array((ax + share * (cx - ax), ay + share * (cy - ay)))

    @property
    def side_px(self) -> float:
        """Side of a square of the same area."""
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = self.corners.tolist()
        return math.sqrt(abs((cx - ax) * (dy - by) - (cy - ay) * (dx - bx)) / 2.0)


class TagLayout(NamedTuple):
    """Meaning of each tag. An id is looked up among references, objects, robots, in this order.

    tag_robots: robots whose tag has another id, by the tag's id. All others wear the tag of their own id, so that
        each tag without another meaning is a robot's.
    mounts: poses of tags in base_link of their robot or object, by the tag's id; all others are centered.
    objects: names, by the tag's id.
    references: poses in `map` of tags on the floor, by id. Yaws are those of the print's upper edge.
    size_m, height_m: side of the black square of robots' and objects' tags, and their height above the floor.
    reference_size_m: side of the black square of reference tags.
    """

    tag_robots: Mapping[int, int] = {}
    mounts: Mapping[int, Pose] = {}
    objects: Mapping[int, str] = {}
    references: Mapping[int, Pose] = {}
    size_m: float = DEFAULT_SIZE_M
    height_m: float = DEFAULT_HEIGHT_M
    reference_size_m: float = REFERENCE_SIZE_M

    def find_robot(self, tag_id: int) -> Optional[int]:
        """Return whose tag this is; None if it is no robot's."""
        if tag_id in self.references or tag_id in self.objects:
            return None
        if tag_id in self.tag_robots:
            return self.tag_robots[tag_id]
        return None if tag_id in self.tag_robots.values() else tag_id

    def find_tags(self, robots: Iterable[int]) -> Dict[int, int]:
        """Return the tag of each of robots, by robot; those whose tag is assigned to something else have none."""
        others = {robot: tag_id for tag_id, robot in self.tag_robots.items()}
        tags = {robot: others.get(robot, robot) for robot in robots}
        return {robot: tag_id for robot, tag_id in tags.items() if self.find_robot(tag_id) == robot}

    def find_mount(self, tag_id: int) -> Pose:
        """Return the pose of a robot's or object's tag in base_link."""
        return self.mounts.get(tag_id, CENTERED)


class TagPose(NamedTuple):
    """The measured pose in `map` of a tag, or of the robot or object that wears it, and the tag's size as measured.

    position_sd_m, yaw_sd_rad: standard deviations, the first in x and y each.
    """

    tag_id: int
    pose: Pose
    size_m: float
    position_sd_m: float
    yaw_sd_rad: float


class Sightings(NamedTuple):
    """Detections in one image: of robots by number, of objects by name, of reference tags by id; and what is ignored.

    unknown, doubled: ids of tags without a meaning, and of those that appear more than once.
    misshapen: measured by printed size of tags that are too large or too small, by id.
    """

    robots: Dict[int, TagPose]
    objects: Dict[str, TagPose]
    references: Dict[int, TagPose]
    unknown: List[int]
    doubled: List[int]
    misshapen: Dict[int, float]


def fit_squares(
    camera: Camera, tags: Sequence[TagCorners], height_m: Union[float, np.ndarray], calibration_sd_m: float = 0.0
) -> List[TagPose]:
    """Return the poses of tags that lie flat at height_m, of all or of each (N,); nan for those that no ray meets.

    calibration_sd_m: standard deviation, in x and y each, of places by an error of the camera's pose.
    """
    if not tags:
        return []
    corners = np.array([tag.corners for tag in tags], dtype=float)
    points_m = camera.intersect(corners.reshape(-1, 2), np.repeat(np.broadcast_to(height_m, len(tags)), 4))
    places = (points_m[:, 0] + 1j * points_m[:, 1]).reshape(-1, 4)
    # Least squares of a square turned and scaled, in complex numbers; its upper edge looks along x.
    square = np.array((1.0 + 1.0j, 1.0 - 1.0j, -1.0 - 1.0j, -1.0 + 1.0j))
    centers, turns = places.mean(axis=1), places @ square.conj() / 8.0
    sides_px = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    sizes_m, corner_shares = 2.0 * np.abs(turns), CORNER_PX / np.maximum(sides_px, CORNER_PX)
    position_sds_m = np.sqrt((corner_shares * sizes_m) ** 2 / 4.0 + SYSTEMATIC_M**2 + calibration_sd_m**2)
    yaw_sds_rad = np.sqrt(corner_shares**2 / 2.0 + SYSTEMATIC_RAD**2)
    found = np.column_stack((centers.real, centers.imag, np.angle(turns), sizes_m, position_sds_m, yaw_sds_rad))
    return [TagPose(tag.tag_id, Pose(*numbers[:3]), *numbers[3:]) for tag, numbers in zip(tags, found.tolist())]


def find_smallest_side(camera: Camera, size_m: float, height_m: float) -> float:
    """Return the side (px) of the smallest tag of this kind that lies wholly in the image; inf if there is none."""
    width_px, height_px = camera.lens.width_px, camera.lens.height_px
    u, v = np.meshgrid(np.linspace(0.02, 0.98, 9) * width_px, np.linspace(0.03, 0.97, 7) * height_px)
    centers_m = camera.intersect(np.column_stack((u.ravel(), v.ravel())), height_m)
    corners_m = [list_corners(Pose(x_m, y_m, 0.0), size_m, height_m) for x_m, y_m in centers_m.tolist()]
    pixels = camera.project(np.concatenate(corners_m)).reshape(-1, 4, 2)
    sides_px = [TagCorners(0, corners).side_px for corners in pixels if np.isfinite(corners).all()]
    return min(sides_px, default=math.inf)


def list_corners(pose: Pose, size_m: float, height_m: float) -> np.ndarray:
    """Return the corners (4, 3) in `map` of a tag at pose, in the order of TagCorners."""
    square = size_m / 2.0 * np.array(((1, 1), (1, -1), (-1, -1), (-1, 1)))
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.column_stack((square @ np.array(((cos, sin), (-sin, cos))) + pose[:2], np.full(4, height_m)))


def locate(camera: Camera, tags: Sequence[TagCorners], layout: TagLayout, calibration_sd_m: float = 0.0) -> Sightings:
    """Return what the tags of one image say; calibration_sd_m: as for fit_squares()."""
    counts = Counter(tag.tag_id for tag in tags)
    sightings = Sightings({}, {}, {}, [], sorted(tag_id for tag_id, count in counts.items() if count > 1), {})
    single = [tag for tag in tags if counts[tag.tag_id] == 1]
    on_floor = [tag.tag_id in layout.references for tag in single]
    fits = fit_squares(camera, single, np.where(on_floor, 0.0, layout.height_m), calibration_sd_m)
    for found, is_reference in zip(fits, on_floor):
        tag_id = found.tag_id
        share = found.size_m / (layout.reference_size_m if is_reference else layout.size_m)
        robot = layout.find_robot(tag_id)
        if not is_reference and tag_id not in layout.objects and robot is None:
            sightings.unknown.append(tag_id)
        elif not abs(share - 1.0) <= MAX_SIZE_ERROR:
            sightings.misshapen[tag_id] = share
        elif is_reference:
            sightings.references[tag_id] = found
        elif robot is None:
            sightings.objects[layout.objects[tag_id]] = _find_base(found, layout.find_mount(tag_id))
        else:
            sightings.robots[robot] = _find_base(found, layout.find_mount(tag_id))
    return sightings


def _find_base(tag: TagPose, mount: Pose) -> TagPose:
    pose = find_frame(tag.pose, mount)
    # A wrong heading moves the robot's center round the tag's.
    round_tag_m = tag.yaw_sd_rad * measure_distance(tag.pose, pose)
    return tag._replace(pose=pose, position_sd_m=math.hypot(tag.position_sd_m, round_tag_m / math.sqrt(2.0)))
