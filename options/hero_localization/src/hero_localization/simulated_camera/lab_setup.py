"""The simulated lab: its reference tags, the camera above its arena, and the camera file that describes both."""

from typing import List, Sequence

import numpy as np

from hero_node import Pose
from hero_sim.world import Arena

from ..camera.camera_model import Camera
from ..errors import SettingsError
from ..prints.tag_images import FAMILIES, REFERENCE_SIZE_M
from ..tracking import settings as camera_file
from .view import CameraOptions, PrintedTag, tag_corners

REFERENCES = 6
FIRST_REFERENCE_ID = 100
"""First reference tag of families that have this many tags; otherwise the last ones are reference tags."""

REFERENCE_GAP_M = 0.12
"""Distance between the arena's bounds and the centers of the reference tags beside it."""

TAG_HEIGHT_M = PrintedTag(0).height_m

SHEET = 1.3
"""Side of a reference tag with the white margin that detectors need, in sides of the tag."""

HEIGHT_STEP_M = 0.05
MIN_SIDE_PX = 12.0
"""Smaller tags of robots are hardly ever found."""


def find_first_reference(family: str) -> int:
    """Return the id of the first reference tag."""
    return min(FIRST_REFERENCE_ID, FAMILIES[family].size - REFERENCES)


def list_references(arena: Arena, family: str) -> List[PrintedTag]:
    """Return the reference tags, on the floor beside the arena, where they are meant to lie: at whole millimeters."""
    x_min_m, y_min_m, x_max_m, y_max_m = arena.bounds_m.tolist()
    y_m = 0.8 * (y_max_m - y_min_m) / 2.0
    middle_m = (y_min_m + y_max_m) / 2.0
    places_m = [
        (round(x_m, 3), round(middle_m + side * y_m, 3))
        for x_m in (x_min_m - REFERENCE_GAP_M, x_max_m + REFERENCE_GAP_M)
        for side in (-1.0, 0.0, 1.0)
    ]
    return [
        PrintedTag(find_first_reference(family) + index, REFERENCE_SIZE_M, 0.0, *place_m, family=family)
        for index, place_m in enumerate(places_m)
    ]


def describe_references(references: Sequence[PrintedTag]) -> str:
    """Return the line of a camera file that holds the places of reference tags."""
    places = ["%d: [%.3f, %.3f, 0]" % (tag.tag_id, tag.x_m, tag.y_m) for tag in references]
    return "references: {%s}" % ", ".join(places)


def hang_above(
    camera: CameraOptions, arena: Arena, references: Sequence[PrintedTag], tag_size_m: float
) -> CameraOptions:
    """Return the camera moved over the middle of an arena, and so high that it sees all of it and the references.

    Raises: SettingsError if robots' tags would be too small from there.
    """
    x_min_m, y_min_m, x_max_m, y_max_m = arena.bounds_m.tolist()
    corners_m = [(x_m, y_m, TAG_HEIGHT_M) for x_m in (x_min_m, x_max_m) for y_m in (y_min_m, y_max_m)]
    sheets = [tag._replace(size_m=SHEET * tag.size_m) for tag in references]
    seen_m = np.vstack([corners_m, *(tag_corners(tag, np.zeros((1, 3)))[0] for tag in sheets)])
    off_x_m, off_y_m, height_m = camera.position_m
    middle_m = (off_x_m + (x_min_m + x_max_m) / 2.0, off_y_m + (y_min_m + y_max_m) / 2.0)
    limits_px = np.array((camera.width_px - 1.0, camera.height_px - 1.0))
    while tag_size_m * camera.focal_px[0] > MIN_SIDE_PX * height_m:
        camera = camera._replace(position_m=(*middle_m, height_m))
        pixels = camera.geometry.project(seen_m)
        if ((pixels >= 0.0) & (pixels <= limits_px)).all():
            return camera
        height_m = round(height_m + HEIGHT_STEP_M, 3)
    text = "from %.1f m above an arena of %.1f x %.1f m, tags of %.0f mm measure less than %.0f px: take a larger"
    size_m = (x_max_m - x_min_m, y_max_m - y_min_m)
    raise SettingsError((text + " --width or --tag-size") % (height_m, *size_m, 1e3 * tag_size_m, MIN_SIDE_PX))


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
