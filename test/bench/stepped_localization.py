"""Localization of robots that are stepped in process: the filter of localize on a model of a camera. Pure.

with StepSwarm(count=10, seed=1) as swarm:
    StepLocalization(swarm)
    swarm[3].go_to(0.2, 0.1, frame="map")
"""

from collections import deque
from functools import partial
from typing import Deque, List, NamedTuple, Optional, Tuple

import numpy as np

from hero_client.values import FrameError
from hero_localization.filter.pose_filter import PoseFilter, make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import PUBLISH_RATE_HZ
from hero_node import Pose
from hero_sim.stepped import StepSwarm


class CameraModel(NamedTuple):
    """Errors and timing of a simulated camera; it takes an image with each reading of odometry, 29 in a second."""

    delay_s: float = 0.1
    """Time from the image to the measured pose."""
    bias_sd_m: float = 0.001
    bias_sd_rad: float = 0.005
    """Error that is always the same for one robot: calibration, and how its tag sits. In x and y each."""
    noise_sd_m: float = 0.0005
    noise_sd_rad: float = 0.005
    """Error drawn anew for each image."""


CAMERA = CameraModel()


class StepLocalization:
    """Localizes all robots of a swarm from now on: they then take it for the frame map; published: estimates by row."""

    def __init__(self, swarm: StepSwarm, camera: CameraModel = CAMERA, seed: int = 0) -> None:
        """seed: of the camera's errors."""
        self._rows = swarm.rows
        self._camera = camera
        self._random = np.random.RandomState(seed)
        count = len(swarm.robots)
        biases_sd = (camera.bias_sd_m, camera.bias_sd_m, camera.bias_sd_rad)
        self._biases = self._random.normal(0.0, biases_sd, (count, 3))
        self._noise_sd = (camera.noise_sd_m, camera.noise_sd_m, camera.noise_sd_rad)
        self._covariance = make_covariance(camera.noise_sd_m, camera.noise_sd_rad)
        self._filters = [PoseFilter() for _ in swarm.robots]
        self._images: List[Deque[Tuple[float, Pose]]] = [deque() for _ in swarm.robots]
        self.published: List[Optional[StampedPose]] = [None] * count
        self._published_s = [0.0] * count
        for robot in swarm.robots:
            robot.localize_by(partial(self.find_pose, robot.row))
        swarm.rows.on_cycle.append(self._receive)

    def find_pose(self, row: int) -> Pose:
        """Return where the robot at row is in map. Raises: FrameError before the first image has come."""
        estimate = self.published[row]
        if estimate is None:
            raise FrameError("the robot at row %d has no pose in the frame map yet" % row)
        return estimate.pose

    def _receive(self, rows: np.ndarray) -> None:
        now_s = self._rows.now_ms / 1e3
        noise = self._random.normal(0.0, self._noise_sd, (len(rows), 3))
        seen = self._rows.world.poses[rows] + self._biases[rows] + noise
        for row, pose in zip(rows.tolist(), seen.tolist()):
            images, pose_filter = self._images[row], self._filters[row]
            pose_filter.add_odometry(now_s, Pose(*self._rows.odometry[row].tolist()))
            images.append((now_s, Pose(*pose)))
            while images and images[0][0] <= now_s - self._camera.delay_s:
                taken_s, measured = images.popleft()
                pose_filter.add_measurement(StampedPose(taken_s, measured, self._covariance))
            if now_s >= self._published_s[row] + 1.0 / PUBLISH_RATE_HZ:
                self._published_s[row], self.published[row] = now_s, pose_filter.estimate()
