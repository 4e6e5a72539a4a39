"""All robots together: what is known of each, and what people are told."""

from unittest import mock

import numpy as np
import pytest

from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import LOOK_PERIOD_S, LOST_S, NAMED_S, RobotState, SwarmLocalizer
from hero_msgs.msg import RobotPose
from hero_node import Pose, find_frame
from hero_test.nonempty import nonempty

COVARIANCE = np.diag((1e-6, 1e-6, 1e-4))
PERIOD_S = 0.05


class Swarm:
    """Robots at rest, odometry and measured poses every 50 ms; `lines` collects what people are told."""

    def __init__(self, *robot_ids):
        self.localizer = SwarmLocalizer()
        self.localizer.add_robots(robot_ids)
        self.now_s = 100.0
        self.lines = []

    def run(self, duration_s, measured=None, odometry=(), robots=(0,)):
        """measured: robot -> pose in map; odometry: pose of all robots by their odometry."""
        pose = Pose(*(odometry or (0.0, 0.0, 0.0)))
        for _ in range(round(duration_s / PERIOD_S)):
            self.now_s += PERIOD_S
            for robot_id in robots:
                self.lines += self.localizer.add_odometry(robot_id, self.now_s, pose, self.now_s)
            for robot_id, place in (measured or {}).items():
                measurement = StampedPose(self.now_s, Pose(*place), COVARIANCE)
                self.lines += self.localizer.add_measurement(robot_id, measurement, self.now_s)
            self.lines += self.localizer.find_lost(self.now_s)
        return self

    def __getitem__(self, robot_id):
        return {robot.robot_id: robot for robot in self.localizer.list_robots(self.now_s)}[robot_id]


def find_origin(robot):
    return find_frame(robot.estimate.pose, robot.odometry)


def test_robots_are_looked_for_ten_times_a_second_whatever_the_rate(monkeypatch):
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    look = mock.create_autospec(swarm.localizer.list_source_problems, return_value={})
    monkeypatch.setattr(swarm.localizer, "list_source_problems", look)
    measured_s = swarm.now_s
    lines = {index: swarm.localizer.find_lost(measured_s + 0.005 * index) for index in range(1, 260)}
    (lost_s,) = (0.005 * index for index, said in lines.items() if said)
    assert LOST_S < lost_s <= LOST_S + LOOK_PERIOD_S
    assert look.call_count in (13, 14)
    assert swarm.localizer.find_lost(measured_s) and look.call_count in (14, 15), "time went back"


def test_a_lost_robot_is_not_found_by_poses_that_come_a_second_late():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}).run(2.0)
    for late_s, state, count in ((1.1, RobotState.LOST, 2), (0.9, RobotState.TRACKED, 3)):
        for _ in range(10):
            swarm.run(0.1)
            measurement = StampedPose(swarm.now_s - late_s, Pose(1.0, 2.0, 0.0), COVARIANCE)
            swarm.lines += swarm.localizer.add_measurement(0, measurement, swarm.now_s)
        assert swarm[0].state is state and len(swarm.lines) == count, swarm.lines


def test_robots_are_found_once_and_then_tracked_silently():
    swarm = Swarm(0, 1).run(1.0, {0: (1.0, 2.0, 0.0)}, robots=(0, 1))
    assert swarm.lines == ["hero_0 found at (1.000, 2.000) m, 0 degrees"]
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""
    assert find_origin(swarm[0]) == pytest.approx((1.0, 2.0, 0.0))
    assert swarm[1].state is RobotState.UNKNOWN and swarm[1].estimate is None
    assert swarm[1].problem == "its pose was never measured: is its tag in view?"


def test_a_robot_out_of_view_is_lost_and_found_again():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}).run(1.96)
    assert swarm[0].state is RobotState.LOST and "not measured" in swarm[0].problem
    assert swarm[0].estimate.pose == pytest.approx((1.0, 2.0, 0.0))
    swarm.run(0.1, {0: (1.0, 2.0, 0.0)})
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""
    assert swarm.lines[1:] == [
        "hero_0 lost: its pose follows its odometry",
        "hero_0 found again after 2.0 s, 0 mm and 0 degrees off its odometry",
    ]


def test_the_pose_of_a_robot_moved_by_hand_is_reset_and_reported():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}).run(0.5, {0: (1.3, 2.4, 0.0)})
    assert swarm[0].estimate.pose == pytest.approx((1.3, 2.4, 0.0), abs=1e-3)
    step = "500 mm and 0 degrees to (1.300, 2.400) m, 0 degrees"
    assert swarm.lines[1:] == ["hero_0 was moved by hand: pose reset by " + step]


def test_a_robot_moved_by_hand_in_view_is_not_tracked_after_0_15_seconds():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    for index in range(3):
        swarm.run(PERIOD_S, {0: (1.1 + 0.1 * index, 2.0 + 0.2 * index, 0.5 * index)})
    assert swarm[0].state is RobotState.LOST
    assert "3 measured poses in a row disagree" in swarm[0].problem
    assert swarm.run(0.1, {0: (1.0, 2.0, 0.0)})[0].state is RobotState.TRACKED


def test_robots_of_a_moved_camera_are_lost_without_a_line():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    swarm.localizer.distrust(swarm.now_s + 0.03, [0], swarm.now_s)
    assert swarm[0].state is RobotState.TRACKED, "another camera sees it"
    swarm.localizer.distrust(swarm.now_s + 0.2, [7, 0], swarm.now_s)
    assert swarm[0].state is RobotState.LOST and "calibrate_camera arena" in swarm[0].problem
    for _ in range(6):
        swarm.run(0.5)
        swarm.localizer.distrust(swarm.now_s, [0], swarm.now_s)
    assert len(swarm.lines) == 1
    assert "is its tag occluded" in swarm.run(2.0)[0].problem, "no images come any more"
    assert swarm.run(0.1, {0: (1.0, 2.0, 0.0)})[0].state is RobotState.TRACKED


def test_poses_that_wait_for_odometry_are_told_of_when_it_comes():
    swarm = Swarm(0).run(0.1)
    measurement = StampedPose(swarm.now_s + 0.02, Pose(1.0, 2.0, 0.0), COVARIANCE)
    assert swarm.localizer.add_measurement(0, measurement, swarm.now_s) == []
    assert swarm.run(PERIOD_S).lines == ["hero_0 found at (1.000, 2.000) m, 0 degrees"]


def test_a_tag_that_is_on_upside_down_is_named_once_the_robot_drives():
    swarm = Swarm(0)
    for index in range(80):
        forward_m = 0.004 * index
        swarm.run(PERIOD_S, {0: (1.0 - forward_m, 2.0, 0.0)}, (forward_m, 0.0, 0.0))
    assert "180 degrees off its direction of travel: is its tag on upside down" in swarm[0].problem


def test_a_restart_is_said_and_does_not_move_the_robot():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}, (0.5, 0.0, 0.0)).run(0.2, None, (0.0, 0.0, 0.0))
    assert swarm[0].estimate.pose == pytest.approx((1.0, 2.0, 0.0))
    assert find_origin(swarm[0]) == pytest.approx((1.0, 2.0, 0.0))
    assert swarm.lines[1:] == ["hero_0: its odometry was set or it restarted; its place in the map stays"]


@pytest.mark.parametrize("driven_m", [0.0, 0.3])
def test_a_robot_back_from_a_pause_is_found_where_it_drove_to(driven_m):
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}, (0.5, 0.0, 0.0))
    swarm.now_s += 5.0
    swarm.run(0.2, None, (0.5 + driven_m, 0.0, 0.0))
    assert swarm[0].estimate.pose == pytest.approx((1.0 + driven_m, 2.0, 0.0))
    swarm.run(PERIOD_S, {0: (1.0 + 0.99 * driven_m, 2.0, 0.0)}, (0.5 + driven_m, 0.0, 0.0))
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""
    assert swarm.lines[1:] == [
        "hero_0 lost: its pose follows its odometry",
        "hero_0 found again after 5.2 s, %.0f mm and 0 degrees off its odometry" % (10.0 * driven_m),
    ]


def test_a_robot_moved_by_hand_in_a_pause_of_odometry_is_reported():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}, (0.5, 0.0, 0.0))
    swarm.now_s += 5.0
    swarm.run(0.5, {0: (1.3, 2.4, 0.0)}, (0.5, 0.0, 0.0))
    assert swarm.lines[-1].startswith("hero_0 was moved by hand: pose reset by 500 mm")


def test_a_robot_that_restarts_in_a_pause_was_moved_by_no_hand():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}, (0.5, 0.0, 0.0))
    swarm.now_s += 5.0
    swarm.run(0.2).run(PERIOD_S, {0: (1.1, 2.0, 0.5)})
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""
    assert swarm[0].estimate.pose == pytest.approx((1.1, 2.0, 0.5), abs=1e-3)
    assert len(swarm.lines) == 4 and not any("by hand" in line for line in swarm.lines), swarm.lines


def test_a_robot_that_is_off_or_falls_silent_is_named():
    swarm = Swarm(0)
    assert swarm[0].problem == "no odometry: is the robot on?"
    swarm.run(1.0, {0: (1.0, 2.0, 0.0)})
    swarm.now_s += 5.0
    assert swarm[0].problem == "no odometry for 5 s: is the robot on and in reach?"


def test_stamps_of_another_clock_are_named():
    swarm = Swarm(0).run(2.0)
    old = StampedPose(swarm.now_s - 30.0, Pose(0.0, 0.0, 0.0), COVARIANCE)
    assert swarm.localizer.add_measurement(0, old, swarm.now_s) == []
    assert swarm[0].problem == "measured poses come with stamps 30.0 s old: do the clocks agree?"
    ahead = old._replace(stamp_s=swarm.now_s + 5.0)
    assert len(swarm.localizer.add_measurement(0, ahead, swarm.now_s)) == 1 and swarm[0].state is RobotState.UNKNOWN
    assert swarm[0].problem == "measured poses come with stamps 5.0 s ahead: do the clocks agree?"


def test_robots_are_localized_again_after_a_jump_back_in_time():
    swarm = Swarm(0, 1).run(1.0, {0: (1.0, 2.0, 0.0)})
    clocks = swarm.localizer.clocks
    clocks._due_s[0, 0] = swarm.now_s + 1.0  # when the next pose is compared
    swarm.now_s -= 50.0
    swarm.run(1.0, {0: (1.5, 2.0, 0.0)})
    assert max(clocks._due_s.values(), default=0.0) <= swarm.now_s + 1.0, "no clock waits for the time before"
    assert all(pose.stamp_s <= swarm.now_s for poses in nonempty(clocks._poses.values()) for pose in poses)
    assert swarm.lines[1:] == [
        "time jumped back by 50.0 s: all robots are localized again",
        "hero_0 found at (1.500, 2.000) m, 0 degrees",
    ]
    assert swarm[0].problem == "" and swarm[0].estimate.pose == pytest.approx((1.5, 2.0, 0.0))
    assert swarm[1].state is RobotState.UNKNOWN


def test_a_pose_of_a_robot_that_is_not_expected_is_refused():
    with pytest.raises(KeyError):
        Swarm(0).localizer.add_measurement(7, StampedPose(0.0, Pose(0.0, 0.0, 0.0), COVARIANCE), 0.0)


def test_a_jump_back_in_time_gives_lost_robots_their_lines_again():
    robots = range(3, 7)  # as many as there are lines at once
    places = {robot_id: (0.1 * robot_id, 0.0, 0.0) for robot_id in robots}
    swarm = Swarm(*robots).run(1.0, places, robots=robots).run(1.5, robots=robots)
    swarm.now_s -= 50.0
    swarm.run(1.0, places, robots=robots).lines.clear()
    swarm.run(1.5, robots=robots)
    assert swarm.lines == ["hero_3, hero_4, hero_5, hero_6 lost: their poses follow their odometry"]


def test_states_are_those_of_the_message():
    for state in RobotState:
        assert getattr(RobotPose, state.name) == state
    assert len(RobotState) == 3


def test_steps_are_told_by_distance_and_by_the_shorter_turn():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 3.1)}).run(2.0).run(0.3, {0: (1.0, 2.0, -3.12)})
    assert swarm.lines[-1].endswith("0 mm and 4 degrees off its odometry"), swarm.lines


LOOSE = np.diag((4e-2, 4e-2, 4.0))


@pytest.mark.parametrize(("x_m", "lines"), [(0.019, 1), (0.022, 2)])
def test_corrections_of_more_than_two_centimeters_are_said(x_m, lines):
    swarm = Swarm(0).run(PERIOD_S)
    first = StampedPose(swarm.now_s, Pose(0.0, 0.0, 0.0), LOOSE)
    swarm.lines += swarm.localizer.add_measurement(0, first, swarm.now_s)
    swarm.run(PERIOD_S, {0: (x_m, 0.0, 0.5)})
    assert len(swarm.lines) == lines and swarm[0].estimate.pose.x_m == pytest.approx(x_m, abs=1e-4)
    assert lines == 1 or swarm.lines[1] == "hero_0 corrected by 22 mm and 29 degrees"


@pytest.mark.parametrize(("times_s", "state"), [
    ((0.06, 0.105), RobotState.LOST), ((0.05, 0.095), RobotState.TRACKED), ((0.105,), RobotState.TRACKED),
])  # fmt: skip
def test_two_outliers_in_a_row_over_a_tenth_of_a_second_lose_a_robot(times_s, state):
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    for time_s in times_s:
        swarm.localizer.add_odometry(0, swarm.now_s + time_s, Pose(0.0, 0.0, 0.0), swarm.now_s)
        far = StampedPose(swarm.now_s + time_s, Pose(1.5, 2.0, 0.0), COVARIANCE)
        assert swarm.localizer.add_measurement(0, far, swarm.now_s + time_s) == []
    assert swarm[0].state is state


def test_problems_of_time_begin_at_their_limits():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    end_s = swarm.now_s
    for later_s, text in ((0.95, ""), (1.05, "no odometry for 1 s: is the robot on and in reach?")):
        swarm.now_s = end_s + later_s
        assert swarm[0].problem == text
    for ahead_s, named in ((0.19, False), (0.21, True)):
        swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
        measurement = StampedPose(swarm.now_s + ahead_s, Pose(1.0, 2.0, 0.0), COVARIANCE)
        swarm.localizer.add_measurement(0, measurement, swarm.now_s)
        swarm.localizer.add_odometry(0, swarm.now_s + ahead_s, Pose(0.0, 0.0, 0.0), swarm.now_s)
        assert ("0.2 s ahead: do the clocks agree?" in swarm[0].problem) == named
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    for later_s, state in ((0.96, RobotState.TRACKED), (0.04, RobotState.TRACKED), (0.06, RobotState.LOST)):
        swarm.now_s += later_s
        swarm.localizer.add_odometry(0, swarm.now_s, Pose(0.0, 0.0, 0.0), swarm.now_s)
        swarm.localizer.find_lost(swarm.now_s)
        assert swarm[0].state is state, later_s
    assert swarm.run(2.0)[0].problem == "not measured for 3 s: is its tag occluded or out of view?"


def test_time_that_goes_back_by_a_tenth_of_a_second_begins_anew():
    for back_s, count in ((0.09, 1), (0.11, 2)):
        swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
        swarm.lines += swarm.localizer.find_lost(swarm.now_s - back_s)
        assert len(swarm.lines) == count, back_s


@pytest.mark.parametrize(("off_rad", "text"), [
    (0.33, ""), (-0.33, ""), (0.37, "21 degrees off its direction of travel: is its tag on turned?"),
    (-0.37, "-21 degrees off its direction of travel: is its tag on turned?"),
])  # fmt: skip
def test_a_tag_that_is_on_turned_is_named_from_a_third_of_a_radian_on(off_rad, text):
    swarm = Swarm(0)
    for index in range(80):
        swarm.run(PERIOD_S, {0: (1.0 + 0.004 * index, 2.0, off_rad)}, (0.004 * index, 0.0, 0.0))
    assert (text in swarm[0].problem) if text else (swarm[0].problem == "")


def test_robots_are_listed_by_id_each_with_the_origin_of_its_odometry():
    swarm = Swarm(9, 2, 5).run(0.5, {2: (1.0, 2.0, 0.5)}, (0.3, 0.1, 0.2), robots=(2, 5, 9))
    robots = swarm.localizer.list_robots(swarm.now_s)
    assert [robot.robot_id for robot in robots] == [2, 5, 9]
    cos, sin = np.cos(0.3), np.sin(0.3)
    expected = (1.0 - 0.3 * cos + 0.1 * sin, 2.0 - 0.3 * sin - 0.1 * cos, 0.3)
    assert find_origin(robots[0]) == pytest.approx(expected) and robots[1].estimate is None
    swarm.localizer.add_robots([2])
    assert swarm[2].state is RobotState.TRACKED, "one that is expected already goes on"


@pytest.mark.slow
def test_robots_that_are_lost_together_have_one_line_and_at_times_only():
    robots = range(16)
    places = {robot_id: (0.1 * robot_id, 0.0, 0.0) for robot_id in robots}
    swarm = Swarm(*robots).run(1.0, places, robots=robots)
    swarm.lines.clear()
    swarm.run(2.0, robots=robots)
    names = ", ".join("hero_%d" % robot_id for robot_id in range(10))
    assert swarm.lines == [names + " and 6 more lost: their poses follow their odometry"]
    swarm.run(1.0, places, robots=robots)
    assert len([line for line in swarm.lines[1:] if "found again after" in line]) == 16
    for _ in range(3):
        swarm.run(2.0, robots=robots).run(1.0, places, robots=robots)
    assert len(swarm.lines) == 17, "while that goes on"
    swarm.run(NAMED_S, places, robots=robots).run(2.0, robots=robots)
    assert swarm.lines[17:] == swarm.lines[:1]
