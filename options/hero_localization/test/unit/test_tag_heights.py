"""Heights of robots' tags by two cameras: a wrong one is named, and nothing else is taken for one."""

import math

import numpy as np
import pytest

from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import SwarmLocalizer
from hero_localization.filter.tag_heights import TagHeights
from hero_node import Pose, transform_pose

CAMERAS_M = {"/track": np.array((-0.7, 0.1, 2.1)), "/track_2": np.array((0.7, -0.1, 2.2))}
"""Places of cameras: x, y, and height above the tags."""
COVARIANCE = np.diag((0.0008**2, 0.0008**2, 0.003**2))
FRAME_S = 1.0 / 30.0
START = Pose(0.1, -0.1, 0.4)


def see(place_m, camera_m, too_high_m):
    """Return the place (2,) at which a camera sees a tag that is too high by this much."""
    return camera_m[:2] + camera_m[2] / (camera_m[2] - too_high_m) * (place_m - camera_m[:2])


class TwoCameras:
    """Robots that drive circles, and two cameras that see them alternately."""

    def __init__(self, too_high_m, cameras_m=None, late_s=0.0, speed_m_s=0.1):
        """too_high_m: of the tag of each robot, by number."""
        self.localizer, self.lines, self.now_s, self.too_high_m = SwarmLocalizer(), [], 0.0, too_high_m
        self.localizer.add_robots(too_high_m)
        self.localizer.heights.cameras_m.update(CAMERAS_M if cameras_m is None else cameras_m)
        self.late_s, self.speed_m_s = late_s, speed_m_s

    def drive(self, time_s):
        """Return the pose by odometry at a time: on a circle, to and fro."""
        angle_rad = math.sin(2.0 * time_s)
        radius_m = max(self.speed_m_s, 1e-9) / 2.0
        return Pose(radius_m * math.sin(angle_rad), radius_m * (1.0 - math.cos(angle_rad)), angle_rad)

    def run(self, duration_s, shift_m=(0.0, 0.0)):
        """shift_m: of what the second camera sees."""
        for index in range(round(duration_s / FRAME_S)):
            self.now_s += FRAME_S
            for robot_id, too_high_m in self.too_high_m.items():
                counted = self.drive(self.now_s)
                self.lines += self.localizer.add_odometry(robot_id, self.now_s, counted, self.now_s)
                is_second = index % 2 == 1
                name = list(CAMERAS_M)[is_second]
                true = transform_pose(START, self.drive(self.now_s - self.late_s * is_second))
                x_m, y_m = see(np.array(true[:2]), CAMERAS_M[name], too_high_m) + np.array(shift_m) * is_second
                source = "/track/measured_poses (%s)" % name
                measured = StampedPose(self.now_s, true._replace(x_m=x_m, y_m=y_m), COVARIANCE, source, True)
                self.lines += self.localizer.add_measurement(robot_id, measured, self.now_s)
            self.lines += self.localizer.find_lost(self.now_s)
        return self

    @property
    def problem(self):
        return self.localizer.list_source_problems().get("tag heights", "")


@pytest.mark.parametrize(
    ("too_high_m", "text"), [(0.005, "5 mm higher"), (-0.005, "5 mm lower"), (0.015, "15 mm high")]
)
def test_a_height_that_is_wrong_for_all_robots_is_named_once(too_high_m, text):
    cameras = TwoCameras({0: too_high_m, 3: too_high_m})
    cameras.run(7.8)
    assert cameras.problem == ""
    cameras.run(2.2)
    assert cameras.problem.startswith("two cameras see tags of robots " + text), cameras.problem
    assert [line for line in cameras.lines if "found at" not in line] == [cameras.problem], "and no conflict of sources"


def test_one_robots_tag_at_another_height_is_named():
    cameras = TwoCameras({0: 0.0, 3: 0.015, 5: 0.0}).run(10.0)
    assert cameras.problem.startswith("two cameras see tags of hero_3 15 mm higher"), cameras.problem


@pytest.mark.parametrize("too_high_m", [0.0, 0.002, -0.002])
def test_a_height_that_is_right_within_the_cameras_errors_is_not_named(too_high_m):
    assert TwoCameras({0: too_high_m}).run(10.0).problem == ""


def test_a_right_height_is_not_blamed_for_frames_that_are_off_across():
    baseline_m = (CAMERAS_M["/track_2"] - CAMERAS_M["/track"])[:2]
    across_m = 0.004 * np.array((-baseline_m[1], baseline_m[0])) / np.linalg.norm(baseline_m)
    assert TwoCameras({0: 0.0}).run(10.0, across_m).problem == ""


@pytest.mark.parametrize(
    "cameras_m", [{}, {"/track": CAMERAS_M["/track"]}, {"/track": np.zeros(3), "/vrpn": np.ones(3)}]
)
def test_heights_are_not_judged_without_the_places_of_both_cameras(cameras_m):
    assert TwoCameras({0: 0.015}, cameras_m).run(10.0).problem == ""


@pytest.mark.parametrize("apart_m", [0.0, 0.2])
def test_cameras_side_by_side_tell_no_heights(apart_m, monkeypatch):
    monkeypatch.setitem(CAMERAS_M, "/track_2", CAMERAS_M["/track"] + (apart_m, 0.0, 0.0))
    assert TwoCameras({0: 0.015}).run(10.0).problem == ""


def test_a_clock_that_is_off_is_not_taken_for_a_wrong_height():
    cameras = TwoCameras({0: 0.0}, late_s=0.1, speed_m_s=0.3).run(20.0)
    named = [line for line in cameras.lines if "found at" not in line]
    assert cameras.problem == "" and len(named) == 1 and "ms late, which is corrected" in named[0], named


@pytest.mark.parametrize(("step_s", "is_told"), [(0.1, True), (0.2, True), (0.3, False)])
def test_only_poses_a_moment_apart_are_compared(step_s, is_told):
    heights = TagHeights()
    heights.cameras_m.update(CAMERAS_M)
    for index in range(100):
        name = list(CAMERAS_M)[index % 2]
        x_m, y_m = see(np.array(START[:2]), CAMERAS_M[name], 0.015)
        pose = START._replace(x_m=x_m, y_m=y_m)
        heights.add(0, StampedPose(round(index * step_s, 6), pose, COVARIANCE, f"/t ({name})"), Pose(0.0, 0.0, 0.0))
    assert bool(heights.describe()) is is_told
