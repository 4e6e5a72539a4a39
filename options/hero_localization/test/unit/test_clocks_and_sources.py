"""Measured poses of several sources and clocks: what contradicts, or is of the future, is named and not trusted."""

import math

import pytest
from test_swarm_localizer import COVARIANCE, PERIOD_S, Swarm

from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import RobotState
from hero_localization.nodes.outputs import describe_robot
from hero_node import Pose

HOME = (1.0, 2.0, 0.0)
FAR = (1.0, 2.5, 0.0)
TRACK, MOCAP = "/track/measured_poses (/track)", "/hero_0/measured_pose (/vrpn)"


def measure(swarm, place, ahead_s=0.0, source=TRACK, robot_id=0):
    measurement = StampedPose(swarm.now_s + ahead_s, Pose(*place), COVARIANCE, source)
    lines = swarm.localizer.add_measurement(robot_id, measurement, swarm.now_s)
    swarm.lines += lines
    return lines


def read_sd_m(robot):
    return describe_robot(robot).position_sd


def see_with_both(swarm, duration_s, offset):
    for _ in range(round(duration_s / PERIOD_S)):
        swarm.run(PERIOD_S)
        measure(swarm, HOME)
        measure(swarm, [sum(pair) for pair in zip(HOME, offset)], -0.01, MOCAP)


def test_two_sources_that_contradict_each_other_are_named_once():
    swarm = Swarm(0).run(1.0)
    see_with_both(swarm, 9.0, (0.0, 0.5, 0.1))
    text = "its poses from %s are 500 mm and 6 degrees off those from %s: calibrate both in one frame, or end one"
    assert swarm.lines[1:] == ["hero_0: " + text % (MOCAP, TRACK)]
    assert swarm[0].problem == text % (MOCAP, TRACK)
    assert swarm[0].state is RobotState.LOST and read_sd_m(swarm[0]) > 0.3
    assert swarm[0].estimate.pose == pytest.approx(HOME, abs=1e-3)
    for _ in range(25):  # one source has ended
        swarm.run(PERIOD_S)
        measure(swarm, HOME)
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == "" and read_sd_m(swarm[0]) < 0.002


def test_no_remedy_is_told_for_a_contradiction_that_clocks_may_explain():
    swarm = Swarm(0).run(1.0)
    see_with_both(swarm, 7.5, (0.0, 0.5, 0.1))
    assert len(swarm.lines) == 1 and swarm[0].state is RobotState.LOST
    assert "500 mm" in swarm[0].problem and "calibrate" not in swarm[0].problem


def test_a_source_that_wins_while_another_is_occluded_is_no_hand():
    swarm = Swarm(0).run(1.0)
    see_with_both(swarm, 9.0, (0.0, 0.5, 0.0))
    for _ in range(10):
        swarm.run(PERIOD_S)
        measure(swarm, FAR, source=MOCAP)
    see_with_both(swarm, 2.0, (0.0, 0.5, 0.0))
    assert len(swarm.lines) == 2, swarm.lines
    assert swarm[0].state is RobotState.LOST and read_sd_m(swarm[0]) > 0.3


def test_two_sources_that_agree_are_one():
    swarm = Swarm(0).run(1.0)
    see_with_both(swarm, 2.0, (0.001, -0.001, 0.002))
    assert len(swarm.lines) == 1 and swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""


def test_a_robot_moved_by_hand_before_two_cameras_is_no_conflict():
    swarm = Swarm(0).run(1.0)
    see_with_both(swarm, 2.0, (0.0, 0.0, 0.0))
    for _ in range(20):
        swarm.run(PERIOD_S)
        measure(swarm, FAR)
        measure(swarm, FAR, -0.03, MOCAP)
    assert len(swarm.lines) == 2 and swarm.lines[1].startswith("hero_0 was moved by hand: pose reset by 500 mm")
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""


@pytest.mark.parametrize("rate_hz", [10.0, 30.0, 60.0, 240.0])
def test_a_robot_that_is_measured_elsewhere_is_as_uncertain_as_that(rate_hz):
    swarm = Swarm(0).run(1.0, {0: HOME})
    end_s, sds_m = swarm.now_s + 0.8, []
    while swarm.now_s < end_s:
        swarm.now_s += 1.0 / rate_hz
        swarm.localizer.add_odometry(0, swarm.now_s, Pose(0.0, 0.0, 0.0), swarm.now_s)
        measure(swarm, FAR)
        robot = swarm[0]
        off_m = math.hypot(robot.estimate.pose.x_m - FAR[0], robot.estimate.pose.y_m - FAR[1])
        sds_m.append((swarm.now_s - end_s + 0.8, read_sd_m(robot), robot.state))
        if off_m > 0.05 and swarm.now_s > end_s - 0.8 + max(0.1, 2.0 / rate_hz) + 1e-6:
            assert robot.state is RobotState.LOST and read_sd_m(robot) > 0.3
    assert off_m < 0.002 and sds_m[-1][1] < 0.002 and sds_m[-1][2] is RobotState.TRACKED


def test_one_contradiction_makes_a_robot_uncertain_that_one_pose_found():
    swarm = Swarm(0).run(PERIOD_S, {0: FAR}).run(PERIOD_S, {0: HOME})
    assert swarm[0].state is RobotState.LOST and read_sd_m(swarm[0]) > 0.3
    swarm.run(0.5, {0: HOME})
    assert swarm.lines == ["hero_0 found at (1.000, 2.500) m, 0 degrees", "hero_0 found at (1.000, 2.000) m, 0 degrees"]
    assert swarm[0].state is RobotState.TRACKED and swarm[0].estimate.pose == pytest.approx(HOME, abs=1e-3)


def test_poses_of_a_robot_whose_odometry_is_silent_are_not_ahead():
    swarm = Swarm(0).run(1.0, {0: HOME})
    swarm.now_s += 1.0
    assert measure(swarm, HOME, 0.1) == [] and swarm[0].problem == ""


@pytest.mark.parametrize("ahead_s", [0.21, 0.5, 0.9, 1.1, 3600.0, 1e9])
def test_an_image_stamped_ahead_is_named_once_and_freezes_no_robot(ahead_s):
    swarm = Swarm(0, 1).run(1.0, {0: HOME, 1: FAR}, robots=(0, 1))
    swarm.lines.clear()
    for _ in range(3):
        measure(swarm, HOME, ahead_s)
        measure(swarm, FAR, ahead_s, robot_id=1)
    text = "poses from %s come with stamps %.1f s ahead, and are not used: do the clocks agree?"
    assert swarm.lines == [text % (TRACK, ahead_s)]
    assert swarm[1].problem == "measured poses come with stamps %.1f s ahead: do the clocks agree?" % ahead_s
    swarm.lines.clear()
    for index in range(1, 41):  # drives on, and is seen
        x_m = 0.01 * index
        swarm.run(PERIOD_S, {0: (1.0 + x_m, 2.0, 0.0), 1: (1.0 + x_m, 2.5, 0.0)}, (x_m, 0.0, 0.0), robots=(0, 1))
        for robot, y_m in ((swarm[0], 2.0), (swarm[1], 2.5)):
            assert robot.estimate.pose == pytest.approx((1.0 + x_m, y_m, 0.0), abs=2e-3)
            assert robot.estimate.stamp_s == swarm.now_s
            assert robot.state is RobotState.TRACKED and robot.problem == ""
    assert swarm.lines == []


@pytest.mark.slow
def test_stamps_ahead_are_named_again_after_a_while_without():
    swarm = Swarm(0).run(1.0, {0: HOME})
    counts = []
    for pause_s in (1.0, 20.0, 20.0, 40.0):
        counts.append(len(measure(swarm, HOME, 60.0)))
        swarm.run(pause_s, {0: HOME})
    counts.append(len(measure(swarm, HOME, 60.0)))
    assert counts == [1, 0, 0, 0, 1]


def test_odometry_and_camera_with_another_clock_than_localize_are_used():
    swarm = Swarm(0)
    for _ in range(40):
        swarm.now_s += PERIOD_S
        swarm.localizer.add_odometry(0, swarm.now_s + 0.6, Pose(0.0, 0.0, 0.0), swarm.now_s)
        measure(swarm, HOME, 0.5)
    assert swarm[0].state is RobotState.TRACKED
    assert swarm[0].problem == "measured poses come with stamps 0.5 s ahead: do the clocks agree?"


def test_odometry_stamped_ahead_is_named_once_and_freezes_nothing():
    swarm = Swarm(0).run(1.0, {0: HOME})
    swarm.lines.clear()
    for _ in range(2):
        swarm.lines += swarm.localizer.add_odometry(0, swarm.now_s + 3600.0, Pose(9.0, 0.0, 0.0), swarm.now_s)
    text = "hero_0: its odometry comes with stamps 3600.0 s ahead, and is not used: do the clocks agree?"
    assert swarm.lines == [text]
    swarm.run(0.5, {0: HOME}).run(PERIOD_S, {0: (1.01, 2.0, 0.0)}, (0.01, 0.0, 0.0))
    assert swarm[0].estimate.pose == pytest.approx((1.01, 2.0, 0.0), abs=1e-3)
    assert swarm.lines == [text] and swarm[0].problem == ""


def test_odometry_of_a_clock_that_was_set_back_is_followed_again():
    swarm = Swarm(0).run(1.0, {0: HOME})
    for _ in range(60):
        swarm.now_s += PERIOD_S
        swarm.lines += swarm.localizer.add_odometry(0, swarm.now_s - 100.0, Pose(0.0, 0.0, 0.0), swarm.now_s)
    assert swarm.lines[1:] == ["hero_0: the clock of its driver was set back by 99.0 s: it is localized again"]
    assert swarm[0].problem == "its odometry comes with stamps 100.0 s old: do the clocks agree?"
    swarm.run(0.2, {0: FAR})
    assert swarm[0].estimate.pose == pytest.approx(FAR, abs=1e-3) and swarm[0].problem == ""


@pytest.mark.parametrize("back_s", [0.15, 0.3, 0.9, 1.5, 3600.0])
def test_a_clock_of_all_that_is_set_back_freezes_no_robot(back_s):
    """All stamps and the time of localize go back while the robot drives."""
    swarm, x_m = Swarm(0), 0.0
    for index in range(120):
        x_m += 0.01
        if index == 40:
            swarm.now_s -= back_s
        swarm.run(PERIOD_S, {0: (1.0 + x_m, 2.0, 0.0)}, (x_m, 0.0, 0.0))
        if index > 42:
            off_m = abs(swarm[0].estimate.pose.x_m - 1.0 - x_m)
            assert off_m < 0.01 or read_sd_m(swarm[0]) > 0.3 * off_m, (index, off_m)
    assert off_m < 0.003 and swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""


def test_distrust_of_an_image_stamped_ahead_passes():
    swarm = Swarm(0).run(1.0, {0: HOME})
    swarm.localizer.distrust(swarm.now_s + 3600.0, [0], swarm.now_s)
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""


@pytest.mark.parametrize(("off_m", "state"), [(0.008, RobotState.TRACKED), (0.012, RobotState.LOST)])
def test_sources_a_few_millimeters_apart_lose_no_robot(off_m, state):
    swarm = Swarm(0).run(1.0)
    see_with_both(swarm, 2.0, (off_m, 0.0, 0.0))
    assert swarm[0].state is state and " mm and 0 degrees off those from " in swarm[0].problem
    assert read_sd_m(swarm[0]) == pytest.approx(off_m / math.sqrt(2.0), rel=0.1)
