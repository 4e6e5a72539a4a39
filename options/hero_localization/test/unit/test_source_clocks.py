"""Clocks of cameras and motion capture that differ from odometry's: found while robots drive, named and corrected."""

import math
import re

import numpy as np
import pytest

from hero_localization.filter.odometry_history import OdometryHistory
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.source_clocks import SourceClocks
from hero_localization.filter.swarm_localizer import SwarmLocalizer
from hero_node import Pose, find_frame

COVARIANCE = np.diag((0.0007**2, 0.0007**2, 0.003**2))
STEP_S, ARRIVES_S = 0.01, 0.07
WHEELS = 1.01
"""Odometry counts too much by this factor."""
TRACK, TRACK_2 = "/track/measured_poses (/track)", "/track/measured_poses (/track_2)"


class Drive:
    """A robot that drives by chance, or as told; odometry and poses of two cameras, each 30 times a second."""

    def __init__(self, delays_s, seed=0, motion=None, is_correcting=True):
        self.random, self.motion = np.random.RandomState(seed), motion
        self.localizer = SwarmLocalizer(is_correcting)
        self.localizer.add_robots([4])
        self.delays_s, self.lines, self.next_s = delays_s, [], 0.0
        self.speed = self.goal = np.zeros(2)
        self.true, self.counted = [np.zeros(3)], np.zeros(3)
        self.odometry_ahead_s = 0.0

    def _move(self, pose, speed):
        heading = pose[2] + speed[1] * STEP_S / 2.0
        return pose + STEP_S * np.array((speed[0] * math.cos(heading), speed[0] * math.sin(heading), speed[1]))

    @property
    def now_s(self):
        return (len(self.true) - 1) * STEP_S

    def _take(self, topic, delay_s, robot_id=4):
        index = len(self.true) - 1 - round(ARRIVES_S / STEP_S)
        if index >= 0:
            pose = self.true[index] + self.random.normal(0.0, (0.0003, 0.0003, 0.003))
            measurement = StampedPose(index * STEP_S + delay_s, Pose(*pose), COVARIANCE, topic)
            self.lines += self.localizer.add_measurement(robot_id, measurement, self.now_s)

    def run(self, duration_s):
        """Drive on; return the largest error of the estimate in the last two seconds, m."""
        errors_m = []
        for step in range(round(duration_s / STEP_S)):
            if self.motion is not None:
                self.goal = np.array(self.motion(self.now_s))
            elif self.now_s >= self.next_s:
                self.goal = np.array((self.random.choice((0.0, 0.1, 0.2)), self.random.uniform(-2.0, 2.0)))
                self.next_s = self.now_s + self.random.uniform(0.5, 2.0)
            self.speed = self.speed + np.clip(self.goal - self.speed, -20.0 * STEP_S, 20.0 * STEP_S)
            self.true.append(self._move(self.true[-1], self.speed))
            self.counted = self._move(self.counted, WHEELS * self.speed)
            if step % 3 == 0:
                stamp_s = self.now_s + self.odometry_ahead_s
                self.lines += self.localizer.add_odometry(4, stamp_s, Pose(*self.counted), self.now_s)
                self.lines += self.localizer.find_lost(self.now_s)
            for index, delay_s in enumerate(self.delays_s):
                if step % 3 == 1 + index:
                    self._take((TRACK, TRACK_2)[index], delay_s)
            (robot,) = self.localizer.list_robots(self.now_s)
            if robot.estimate is not None and step > duration_s / STEP_S - 200:
                true = self.true[min(round(robot.estimate.stamp_s / STEP_S), len(self.true) - 1)]
                errors_m.append(math.dist(robot.estimate.pose[:2], true[:2]))
        return max(errors_m)


def list_clocks(drive):
    clocks = drive.localizer.clocks.list_off()
    return [(name, text.split(" come ")[1].split(":")[0]) for name, text in clocks.items()]


@pytest.mark.slow
@pytest.mark.parametrize("delay_s", [0.1, -0.1, 0.2])
def test_a_camera_whose_clock_is_off_is_named_and_corrected(delay_s):
    drive = Drive([delay_s])
    drive.run(14.0)
    drive.motion = lambda now_s: (0.2, 1.0 if now_s % 2.0 < 1.0 else -1.0)
    assert drive.run(4.0) < 0.003
    ((name, text),) = list_clocks(drive)
    assert name == "/track" and text.endswith("which is corrected")
    side = "late" if delay_s > 0.0 else "early"
    assert side in text and abs(float(text.split()[2]) - 1e3 * abs(delay_s)) < 8.0
    named = [line for line in drive.lines if "chrony" in line]
    assert len(named) == 1 and "poses from /track come with stamps" in named[0]


@pytest.mark.slow
def test_a_clock_that_is_off_is_named_only_where_it_is_not_corrected():
    drive = Drive([0.1], is_correcting=False)
    drive.run(14.0)
    ((_, text),) = list_clocks(drive)
    assert text.endswith("ms late")
    drive.motion = lambda now_s: (0.2, 1.0)
    assert drive.run(4.0) > 0.015


@pytest.mark.slow
def test_a_camera_is_not_blamed_for_a_robots_clock_that_was_set_ahead():
    drive = Drive([0.0], motion=lambda now_s: (0.1, 2.0 if now_s % 1.0 < 0.5 else -2.0))
    drive.run(2.5)
    for ahead_s in (0.018, 0.0):
        drive.odometry_ahead_s = ahead_s
        for _ in range(5):
            drive.run(0.5)
            assert list_clocks(drive) == [], ahead_s
    assert [line for line in drive.lines if "chrony" in line] == []
    drive.odometry_ahead_s = 0.03
    drive.run(9.0)
    ((_, text),) = list_clocks(drive)
    assert "early" in text


@pytest.mark.slow
def test_clocks_that_agree_are_left_as_they_are():
    for seed in range(3):
        drive = Drive([0.0, 0.004], seed)
        assert drive.run(12.0) < 0.003
        assert list_clocks(drive) == [] and len(drive.lines) == 1, drive.lines


@pytest.mark.slow
def test_the_camera_whose_clock_is_off_is_told_from_the_other_one():
    drive = Drive([0.0, 0.03], 1)
    assert drive.run(15.0) < 0.003
    ((name, text),) = list_clocks(drive)
    assert name == "/track_2" and 25.0 < float(text.split()[2]) < 35.0


@pytest.mark.slow
def test_two_cameras_are_compared_on_a_straight_path_too():
    drive = Drive([0.0, 0.1], 2, lambda now_s: (0.2 if now_s % 6.0 < 5.0 else 0.0, 0.0))
    drive.run(16.0)
    assert [name for name, _ in list_clocks(drive)] == ["/track_2"]


@pytest.mark.slow
def test_correction_does_not_look_like_a_hand():
    drive = Drive([0.1], 3)
    drive.run(6.0)
    del drive.lines[:]
    drive.run(8.0)
    assert not [line for line in drive.lines if "by hand" in line]


@pytest.mark.slow
def test_wheels_that_slip_in_place_are_no_clock():
    drive = Drive([0.0])
    move, drive._move = drive._move, lambda pose, speed: move(pose, speed if pose is drive.counted else 0.0 * speed)
    drive.run(15.0)
    assert list_clocks(drive) == []


def test_one_clock_is_kept_for_all_topics_of_a_node():
    clocks = SourceClocks(True)
    for robot_id in range(50):
        measurement = StampedPose(1.0, Pose(0.0, 0.0, 0.0), COVARIANCE, "/hero_%d/pose (/vrpn)" % robot_id)
        clocks.correct(robot_id, measurement, OdometryHistory(), 1.0)
    assert len(clocks._sources) == 1


@pytest.mark.slow
def test_a_clock_that_is_set_right_is_found_again():
    drive = Drive([0.1])
    drive.run(12.0)
    drive.delays_s = [0.0]
    drive.run(20.0)
    assert list_clocks(drive) == [] and drive.run(3.0) < 0.003


def add_drive(clocks, begin_s, duration_s, delay_s, robots):
    """Add poses of robots that all drive to and fro alike, with stamps that are late by a delay."""
    odometry = OdometryHistory()
    for time_s in np.arange(0.0, duration_s, 0.02):
        pose = Pose(0.1 * (1.0 - math.cos(3.0 * time_s)), 0.0, 0.0)
        odometry.add(begin_s + time_s, pose)
        measurement = StampedPose(begin_s + time_s + delay_s, pose, COVARIANCE, TRACK)
        for robot_id in range(robots):
            clocks.correct(robot_id, measurement, odometry, begin_s + time_s)


@pytest.mark.parametrize(("robots", "set_clock"), [(1, lambda clocks: None), (20, SourceClocks.forget_poses)])
def test_poses_from_before_a_clock_was_set_back_are_not_waited_for(robots, set_clock):
    """One robot: the clock of the camera was set; twenty, of which some wait for their turn: that of this PC."""
    clocks = SourceClocks(True)
    add_drive(clocks, 1000.0, 2.0, 0.0, robots)
    set_clock(clocks)
    add_drive(clocks, 10.0, 12.0, 0.1, robots)
    (text,) = clocks.list_off().values()
    assert abs(int(re.search(r" stamps (\d+) ms late, which is corrected", text).group(1)) - 100) <= 2


@pytest.mark.slow
def test_poses_at_the_present_are_not_behind_the_robot():
    errors_m = {False: [], True: []}
    origins = []
    drive = Drive([0.0])
    drive.run(3.0)
    for linear_m_s, angular_rad_s in ((0.2, 0.0), (0.2, 1.5), (-0.15, 1.0), (0.0, 2.0)):
        drive.motion = lambda now_s, motion=(linear_m_s, angular_rad_s): motion
        drive.run(0.5)
        for _ in range(20):
            drive.run(0.01)
            for is_present, off_m in errors_m.items():
                (robot,) = drive.localizer.list_robots(drive.now_s + 0.03, is_present)
                pose, speed = drive.true[-1], drive.speed
                for _ in range(3):
                    pose = drive._move(pose, speed)
                off_m.append(math.dist(robot.estimate.pose[:2], pose[:2]))
                assert is_present is (robot.estimate.stamp_s == drive.now_s + 0.03)
                origins.append(find_frame(robot.estimate.pose, robot.odometry))
    behind_m, present_m = (np.sqrt(np.mean(np.square(errors_m[key]))) for key in (False, True))
    assert behind_m > 0.003 and present_m < 0.0015
    assert np.ravel(origins[::2]) == pytest.approx(np.ravel(origins[1::2])), "odometry's frame stays where it is"


def test_a_robot_that_is_silent_is_not_moved_on():
    drive = Drive([0.0], motion=lambda now_s: (0.2, 0.0))
    drive.run(3.0)
    (robot,) = drive.localizer.list_robots(drive.now_s + 0.3, True)
    assert robot.estimate.stamp_s < drive.now_s + 0.01


@pytest.mark.slow
def test_a_clock_that_is_not_known_yet_is_not_taken_for_a_hand():
    drive = Drive([0.1], motion=lambda now_s: (0.2 * (now_s % 1.0 < 0.5), 2.5 if now_s % 1.4 < 0.7 else -2.5))
    drive.run(4.0)
    assert len(drive.lines) == 1 and "found at" in drive.lines[0], drive.lines


@pytest.mark.parametrize("delay_s", [0.1, -0.1])
def test_a_delay_above_three_deviations_is_corrected_by_5_percent_of_time(delay_s):
    clocks, odometry = SourceClocks(True), OdometryHistory()
    measured = StampedPose(5.0, Pose(0.0, 0.0, 0.0), COVARIANCE, TRACK)
    assert clocks.correct(4, measured, odometry, 50.0).stamp_s == 5.0
    clocks._delays_s[0] = delay_s
    for sd_s, now_s, corrected_s in ((0.034, 50.1, 0.0), (0.033, 50.2, 0.005), (0.01, 51.2, 0.055), (0.01, 60.0, 0.1)):
        clocks._covariance[0, 0] = sd_s**2
        found = clocks.correct(4, measured, odometry, now_s)
        assert 5.0 - found.stamp_s == pytest.approx(math.copysign(corrected_s, delay_s)), now_s
