"""Images as seen from straight above, to scale, so that they lie under a map. Knows images, not ROS."""

from typing import Collection, Sequence, Tuple

import cv2
import numpy as np

from ..camera.camera_model import EQUIDISTANT, Camera
from ..errors import SettingsError
from .tag_pose import TagCorners

MAX_SIDE_PX = 1280

MAX_REACH = 3.0
"""Reach of the view to each side of the camera, in heights of the camera: a tilted camera sees to the horizon."""

_BORDER_POINTS = 17

_FOUND_BGR, _UNUSABLE_BGR = (0, 200, 0), (0, 0, 255)


class FloorView:
    """A window onto the plane at one height: the tags' height, so that robots lie where their poses are.

    box_m: x min, y min, x max, y max of the view in map.
    """

    def __init__(self, camera: Camera, height_m: float) -> None:
        """camera: looks down; height_m: of the plane. Raises: SettingsError if the camera does not see the plane."""
        self.camera = camera
        self._height_m = height_m
        self.box_m = self._find_box()
        left_m, low_m, right_m, high_m = self.box_m
        self._px_per_m = MAX_SIDE_PX / max(right_m - left_m, high_m - low_m)
        width_px = round((right_m - left_m) * self._px_per_m)
        height_px = round((high_m - low_m) * self._px_per_m)
        lens, (x_m, y_m, z_m), scale_m = camera.lens, camera.position_m, 1.0 / self._px_per_m
        corner_m = (left_m + scale_m / 2.0 - x_m, high_m - scale_m / 2.0 - y_m, height_m - z_m)
        to_ray = camera.rotation @ np.column_stack(((scale_m, 0.0, 0.0), (0.0, -scale_m, 0.0), corner_m))
        module = cv2.fisheye if lens.model == EQUIDISTANT else cv2
        self._maps = module.initUndistortRectifyMap(
            lens.matrix, lens.distortion, np.eye(3), np.linalg.inv(to_ray), (width_px, height_px), cv2.CV_16SC2
        )

    def _find_box(self) -> Tuple[float, float, float, float]:
        lens = self.camera.lens
        u, v = (np.linspace(0.0, side_px - 1.0, _BORDER_POINTS) for side_px in (lens.width_px, lens.height_px))
        border = [np.column_stack((u, np.full(len(u), edge))) for edge in (v[0], v[-1])]
        border += [np.column_stack((np.full(len(v), edge), v)) for edge in (u[0], u[-1])]
        points_m = self.camera.intersect(np.concatenate(border), self._height_m)
        points_m = points_m[np.isfinite(points_m).all(axis=1)]
        if not len(points_m):
            raise SettingsError("the camera does not look at the floor: calibrate the arena again")
        center_m, reach_m = self.camera.position_m[:2], MAX_REACH * abs(self.camera.position_m[2])
        low = np.maximum(points_m.min(axis=0), center_m - reach_m)
        high = np.minimum(points_m.max(axis=0), center_m + reach_m)
        if not (low < high).all():
            raise SettingsError("the camera does not look at the floor below it: calibrate the arena again")
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def rectify(self, gray: np.ndarray) -> np.ndarray:
        """Return a camera's image (H, W) as seen from above: x right, y up, black where it saw nothing."""
        return cv2.remap(gray, *self._maps, cv2.INTER_LINEAR)

    def find_pixels(self, pixels: np.ndarray) -> np.ndarray:
        """Return where pixels (N, 2) of the camera's image are in the view."""
        points_m = self.camera.intersect(pixels, self._height_m)
        left_m, _, _, high_m = self.box_m
        return np.column_stack((points_m[:, 0] - left_m, high_m - points_m[:, 1])) * self._px_per_m - 0.5

    def draw(self, gray: np.ndarray, tags: Sequence[TagCorners], unusable: Collection[int]) -> np.ndarray:
        """Return a camera's image from above in color (H, W, 3), with the tags in it; unusable: ids drawn in red."""
        drawn = cv2.cvtColor(self.rectify(gray), cv2.COLOR_GRAY2BGR)
        for tag in tags:
            corners = self.find_pixels(tag.corners)
            if not np.isfinite(corners).all():
                continue
            color = _UNUSABLE_BGR if tag.tag_id in unusable else _FOUND_BGR
            center, front = (tuple(np.rint(part.mean(axis=0)).astype(int).tolist()) for part in (corners, corners[:2]))
            cv2.polylines(drawn, [np.rint(corners).astype(np.int32)], True, color, 2)
            cv2.line(drawn, center, front, color, 2)
            place = (center[0] + 12, center[1] - 12)
            cv2.putText(drawn, str(tag.tag_id), place, cv2.FONT_HERSHEY_SIMPLEX, 0.7, color, 2)
        return drawn
