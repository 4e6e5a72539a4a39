"""Localized robots in virtual time: they reach places of the map by ground truth, and map what they see."""

import math

import numpy as np
import pytest
from stepped_localization import CameraModel, StepLocalization

from hero_client.values import FrameError
from hero_client.values.errors import GoalError
from hero_node import Pose
from hero_sim.stepped import StepSwarm
from hero_test.nonempty import nonempty


@pytest.mark.slow
def test_goals_in_map_are_reached_to_10_mm_although_odometry_drifts():
    with StepSwarm(1, seed=3, arena="empty", worlds=4) as swarm:
        StepLocalization(swarm, seed=3)
        swarm.sleep(0.5)
        for goal in ((0.3, 0.2), (-0.3, 0.2), (0.0, -0.3)):
            motions = [robot.start_go_to(*goal, frame="map") for robot in swarm.robots]
            assert [motion.exception() for motion in motions] == [None] * 4
            assert np.hypot(*(swarm.rows.world.poses[:, :2] - goal).T).max() < 0.01
        drift_m = [np.hypot(robot.pose_in("world").x_m, robot.pose_in("world").y_m + 0.3) for robot in swarm.robots]
        assert max(drift_m) > 0.012  # or this would try nothing


@pytest.mark.parametrize(
    ("measure", "reason", "farthest_m"),
    [
        (lambda now_s, true: true._replace(yaw_rad=true.yaw_rad + math.pi), "heading of its pose .* upside down", 0.18),
        (lambda now_s, true: true._replace(yaw_rad=true.yaw_rad + 2.0), r"its pose is about 11\d degrees", 0.25),
        (lambda now_s, true: true._replace(yaw_rad=true.yaw_rad - math.radians(55.0)), r"about -5\d degrees", 0.25),
        (lambda now_s, true: true._replace(x_m=true.x_m + now_s // 1.0 % 2.0), "its pose jumps, .* by 1.00 m", 0.35),
        (lambda now_s, true: true._replace(x_m=true.x_m + now_s // 0.2 % 2.0), "its pose jumps", 0.1),
        (lambda now_s, true: Pose(0.0, 0.0, 0.0), "wheels turn, but .* is the camera's image frozen", 0.35),
    ],
)
def test_a_robot_with_wrong_poses_stops_soon_and_says_what_is_wrong(measure, reason, farthest_m):
    with StepSwarm(1, seed=3, arena="empty") as swarm:
        robot = swarm[0]
        robot.localize_by(lambda: measure(swarm.now_s, robot.true_pose))
        start = robot.true_pose
        with pytest.raises(GoalError, match=reason):
            robot.go_to(0.6, 0.1, frame="map")
        swarm.sleep(1.0)
        assert math.dist(start[:2], robot.true_pose[:2]) < farthest_m
        assert robot.velocity == (0.0, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("place_sd_m", "yaw_sd_rad", "off_rad"), [(0.003, 0.05, 0.0), (0.002, 0.02, 0.5)])
def test_a_robot_with_noisy_or_somewhat_turned_poses_reaches_its_goals(place_sd_m, yaw_sd_rad, off_rad):
    rng = np.random.RandomState(3)
    with StepSwarm(1, seed=3, arena="empty") as swarm:
        robot = swarm[0]

        def measure():
            errors = rng.normal(0.0, (place_sd_m, place_sd_m, yaw_sd_rad)) + (0.0, 0.0, off_rad)
            return Pose(*np.add(robot.true_pose, errors))

        robot.localize_by(measure)
        for goal in ((0.4, 0.1), (-0.3, 0.2), (0.0, -0.3)):
            robot.go_to(*goal, frame="map", tolerance_m=0.03)
            assert math.dist(robot.true_pose[:2], goal) < 0.04


@pytest.mark.slow
def test_a_robot_moved_by_hand_once_still_reaches_its_goal():
    with StepSwarm(1, seed=3, arena="empty") as swarm:
        robot = swarm[0]
        robot.localize_by(lambda: robot.true_pose._replace(x_m=robot.true_pose.x_m - 0.3 * (swarm.now_s > 1.0)))
        robot.go_to(0.2, 0.1, frame="map")
        assert math.dist(robot.true_pose[:2], (0.5, 0.1)) < 0.015


def test_robots_are_not_localized_before_the_first_picture_has_come():
    swarm = StepSwarm(2)
    StepLocalization(swarm, CameraModel(delay_s=0.4))
    with pytest.raises(FrameError, match="row 1 has no pose in the frame map yet"):
        swarm[1].pose_in("map")
    swarm.sleep(0.6)
    poses = swarm.poses
    assert list(poses) == [0, 1]
    assert all(np.hypot(*np.subtract(poses[robot.robot_id], robot.true_pose)[:2]) < 0.006 for robot in nonempty(swarm))


def test_a_camera_without_delay_shows_robots_where_they_are():
    with StepSwarm(1) as swarm:
        StepLocalization(swarm, CameraModel(0.0, 0.0, 0.0, 1e-5, 1e-5))
        swarm.sleep(0.5)
        assert np.hypot(*np.subtract(swarm[0].pose_in("map"), swarm[0].true_pose)[:2]) < 1e-4


@pytest.mark.slow
def test_errors_of_the_camera_are_a_bias_of_each_robot_and_noise():
    assert CameraModel() == (0.1, 0.001, 0.005, 0.0005, 0.005)
    with StepSwarm(1, seed=3, arena="empty", worlds=60) as swarm:
        localization = StepLocalization(swarm, CameraModel(0.0, 0.02, 0.1, 1e-5, 1e-5), seed=2)
        swarm.sleep(0.5)
        first, later = [], []
        for errors in (first, later):
            for robot in swarm.robots:
                pose, true = localization.find_pose(robot.row), swarm.rows.world.poses[robot.row]
                errors.append(np.subtract(pose, true))
            swarm.sleep(0.3)
        np.testing.assert_allclose(first, later, atol=1e-3)
        assert np.std(first, axis=0) == pytest.approx((0.02, 0.02, 0.1), rel=0.35)


def test_poses_come_after_the_delay_25_times_a_second():
    with StepSwarm(1, seed=3, arena="empty") as swarm:
        localization, published_s = StepLocalization(swarm, CameraModel(delay_s=0.2)), []
        for _ in range(400):
            swarm.sleep(0.005)
            found = localization.published[0]
            if found is not None and (not published_s or found.stamp_s != published_s[-1][1]):
                published_s.append((swarm.now_s, found.stamp_s))
        times_s = np.array(published_s)
        assert 0.2 <= times_s[0, 0] < 0.2 + 0.034 * 3.0
        # Of readings each 34 ms, the first that is 40 ms after the last: every other one.
        assert np.diff(times_s[:, 0]).min() > 0.039 and len(times_s) == pytest.approx(1.75 / 0.068, abs=3)
