"""From corners in an image to poses in `map`: of robots, objects and reference tags. Pure.

The corners' rays are cut with the plane in which the tag lies, whose height is known. The pose of a single tag from its
own perspective would need no height, but of a small tag seen from above it is ten times worse, and flips.
"""

import math
from typing import Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence

import numpy as np

from hero_node.geometry import Pose, invert_pose, transform_pose, wrap_angle

from ..camera.camera_model import Camera
from ..prints.tag_images import DEFAULT_SIZE_M, REFERENCE_SIZE_M
from .tag_corners import TagCorners

DEFAULT_HEIGHT_M = 0.076

CORNER_PX = 0.1
"""Standard deviation of a corner's place: twice what is measured on still images."""
SYSTEMATIC_M, SYSTEMATIC_RAD = 0.0007, 0.003
"""Errors that remain after calibration: intrinsics, extrinsics, tag on the robot."""

MAX_SIZE_ERROR = 0.15
"""A tag that measures more than this share more or less than its print is none, or a print of another size."""


class MountedTag(NamedTuple):
    """Pose of a tag on its robot or object: position in base_link, yaw of the print's upper edge."""

    size_m: float = DEFAULT_SIZE_M
    height_m: float = DEFAULT_HEIGHT_M
    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0


class ReferenceTag(NamedTuple):
    """A tag of known place in `map`."""

    pose: Pose
    """Of its center; yaw of the print's upper edge."""
    size_m: float = REFERENCE_SIZE_M
    height_m: float = 0.0


class TagLayout(NamedTuple):
    """Meaning of each tag. An id is looked up among references, objects, robots, in this order.

    Attributes:
        tag_robots: robots whose tag has another id, by the tag's id. All others wear the tag of their own id, so that
            each tag without another meaning is a robot's.
        mounts: how tags sit, by the tag's id; for all others default_mount.
        objects: names, by the tag's id.
        references: by the tag's id.
    """

    tag_robots: Mapping[int, int] = {}
    mounts: Mapping[int, MountedTag] = {}
    default_mount: MountedTag = MountedTag()
    objects: Mapping[int, str] = {}
    references: Mapping[int, ReferenceTag] = {}

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

    def find_mount(self, tag_id: int) -> MountedTag:
        """Return how a robot's or object's tag sits."""
        return self.mounts.get(tag_id, self.default_mount)


class TagPose(NamedTuple):
    """A square that was fitted to four corners.

    Attributes:
        pose: of the tag's center in `map`; yaw of the print's upper edge.
        size_m: as measured.
        covariance: of x, y and yaw, (3, 3), m and rad.
    """

    tag_id: int
    pose: Pose
    size_m: float
    covariance: np.ndarray


class Sighting(NamedTuple):
    """The measured pose of a robot, an object or a reference tag.

    Attributes:
        pose: of base_link (robots, objects) or of the tag itself (references), in `map`.
        covariance: of x, y and yaw, (3, 3), m and rad.
        size_share: measured size of the tag by that of the print.
    """

    tag_id: int
    pose: Pose
    covariance: np.ndarray
    size_share: float


class Sightings(NamedTuple):
    """Detections in one image.

    Attributes:
        robots: by number.
        objects: by name.
        references: by tag id.
        unknown: ids of tags that stand for nothing.
        doubled: ids of tags that are there more than once, and that count nowhere.
        misshapen: measured by printed size of those that are too large or too small, by id; they count nowhere.
    """

    robots: Dict[int, Sighting]
    objects: Dict[str, Sighting]
    references: Dict[int, Sighting]
    unknown: List[int]
    doubled: List[int]
    misshapen: Dict[int, float]


def fit_squares(
    camera: Camera, tags: Sequence[TagCorners], sizes_m: Sequence[float], heights_m: Sequence[float]
) -> List[TagPose]:
    """Return the poses of tags that lie flat at heights_m; nan for those that no ray meets."""
    if not tags:
        return []
    corners = np.array([tag.corners for tag in tags], dtype=float)
    points_m = camera.intersect(corners.reshape(-1, 2), np.repeat(np.asarray(heights_m, dtype=float), 4))
    places = (points_m[:, 0] + 1j * points_m[:, 1]).reshape(-1, 4)
    # Least squares of a square turned and scaled, in complex numbers; its upper edge looks along x.
    square = np.array((1.0 + 1.0j, 1.0 - 1.0j, -1.0 - 1.0j, -1.0 + 1.0j))
    centers, turns = places.mean(axis=1), places @ square.conj() / 8.0
    sides_px = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    poses = []
    for tag, center, turn, size_m, side_px in zip(tags, centers, turns, sizes_m, sides_px):
        pose = Pose(float(center.real), float(center.imag), math.atan2(turn.imag, turn.real))
        corner_m = CORNER_PX * size_m / max(float(side_px), CORNER_PX)
        place_m2 = corner_m**2 / 4.0 + SYSTEMATIC_M**2
        yaw_rad2 = (corner_m / size_m) ** 2 / 2.0 + SYSTEMATIC_RAD**2
        covariance = np.diag((place_m2, place_m2, yaw_rad2))
        poses.append(TagPose(tag.tag_id, pose, 2.0 * float(abs(turn)), covariance))
    return poses


def find_smallest_side(camera: Camera, mount: MountedTag) -> float:
    """Return the side (px) of the smallest tag of its kind that lies wholly in the image; inf if there is none."""
    width_px, height_px = camera.lens.width_px, camera.lens.height_px
    u, v = np.meshgrid(np.linspace(0.02, 0.98, 9) * width_px, np.linspace(0.03, 0.97, 7) * height_px)
    centers_m = camera.intersect(np.column_stack((u.ravel(), v.ravel())), mount.height_m)
    half_m = mount.size_m / 2.0
    square_m = np.array(((half_m, half_m), (half_m, -half_m), (-half_m, -half_m), (-half_m, half_m)))
    points_m = (centers_m[:, None] + square_m).reshape(-1, 2)
    pixels = camera.project(np.column_stack((points_m, np.full(len(points_m), mount.height_m)))).reshape(-1, 4, 2)
    sides_px = [TagCorners(0, corners).side_px for corners in pixels if np.isfinite(corners).all()]
    return min(sides_px, default=math.inf)


def locate(camera: Camera, tags: Sequence[TagCorners], layout: TagLayout) -> Sightings:
    """Return what the tags of one image say."""
    sightings = Sightings({}, {}, {}, [], [], {})
    counts: Dict[int, int] = {}
    for tag in tags:
        counts[tag.tag_id] = counts.get(tag.tag_id, 0) + 1
    sightings.doubled.extend(sorted(tag_id for tag_id, count in counts.items() if count > 1))
    single = [tag for tag in tags if counts[tag.tag_id] == 1]
    prints = [layout.references.get(tag.tag_id) or layout.find_mount(tag.tag_id) for tag in single]
    sizes_m = [known.size_m for known in prints]
    for found, size_m in zip(
        fit_squares(camera, single, sizes_m, [known.height_m for known in prints]), sizes_m
    ):
        tag_id, share = found.tag_id, found.size_m / size_m
        robot = layout.find_robot(tag_id)
        if tag_id not in layout.references and tag_id not in layout.objects and robot is None:
            sightings.unknown.append(tag_id)
        elif not abs(share - 1.0) <= MAX_SIZE_ERROR:
            sightings.misshapen[tag_id] = share
        elif tag_id in layout.references:
            sightings.references[tag_id] = Sighting(tag_id, found.pose, found.covariance, share)
        else:
            seen = _find_base(found, layout.find_mount(tag_id), share)
            if robot is None:
                sightings.objects[layout.objects[tag_id]] = seen
            else:
                sightings.robots[robot] = seen
    return sightings


def _find_base(tag: TagPose, mount: MountedTag, size_share: float) -> Sighting:
    pose = transform_pose(tag.pose, invert_pose(Pose(mount.x_m, mount.y_m, mount.yaw_rad)))
    # A wrong heading moves the robot's center round the tag's.
    jacobian = np.eye(3)
    jacobian[0, 2], jacobian[1, 2] = tag.pose.y_m - pose.y_m, pose.x_m - tag.pose.x_m
    pose = pose._replace(yaw_rad=wrap_angle(pose.yaw_rad))
    return Sighting(tag.tag_id, pose, jacobian @ tag.covariance @ jacobian.T, size_share)
