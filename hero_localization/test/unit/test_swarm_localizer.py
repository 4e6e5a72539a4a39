"""All robots together: what is known of each, and what people are told."""

import numpy as np
import pytest

from hero_localization.filter.pose_filter import Measurement
from hero_localization.filter.swarm_localizer import RobotState, SwarmLocalizer
from hero_msgs.msg import RobotPose
from hero_node.geometry import Pose

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
                self.lines += self.localizer.add_odometry(robot_id, self.now_s, pose)
            for robot_id, place in (measured or {}).items():
                measurement = Measurement(self.now_s, Pose(*place), COVARIANCE)
                self.lines += self.localizer.add_measurement(robot_id, measurement)
            self.lines += self.localizer.find_lost(self.now_s)
        return self

    def __getitem__(self, robot_id):
        return {robot.robot_id: robot for robot in self.localizer.list_robots(self.now_s)}[robot_id]


def test_a_lost_robot_is_not_found_by_poses_that_come_a_second_late():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}).run(2.0)
    for late_s, state, count in ((1.1, RobotState.LOST, 2), (0.9, RobotState.TRACKED, 3)):
        for _ in range(10):
            swarm.run(0.1)
            measurement = Measurement(swarm.now_s - late_s, Pose(1.0, 2.0, 0.0), COVARIANCE)
            swarm.lines += swarm.localizer.add_measurement(0, measurement)
        assert swarm[0].state is state and len(swarm.lines) == count, swarm.lines


def test_robots_are_found_once_and_then_tracked_silently():
    swarm = Swarm(0, 1).run(1.0, {0: (1.0, 2.0, 0.0)}, robots=(0, 1))
    assert swarm.lines == ["hero_0 found at (1.000, 2.000) m, 0 degrees"]
    assert swarm[0].state is RobotState.TRACKED and swarm[0].problem == ""
    assert swarm[0].odom_origin == pytest.approx((1.0, 2.0, 0.0))
    assert swarm[1].state is RobotState.UNKNOWN and swarm[1].estimate is None
    assert "tag" in swarm[1].problem


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


def test_single_outliers_are_a_problem_until_a_pose_fits_again():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)}).run(0.1, {0: (1.3, 2.4, 0.0)})
    assert "2 measured poses in a row disagree" in swarm[0].problem
    assert swarm.run(0.1, {0: (1.0, 2.0, 0.0)})[0].problem == ""


def test_a_robot_moved_by_hand_in_view_is_not_tracked_after_0_15_seconds():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    for index in range(3):
        swarm.run(PERIOD_S, {0: (1.1 + 0.1 * index, 2.0 + 0.2 * index, 0.5 * index)})
    assert swarm[0].state is RobotState.LOST
    assert "3 measured poses in a row disagree" in swarm[0].problem
    assert swarm.run(0.1, {0: (1.0, 2.0, 0.0)})[0].state is RobotState.TRACKED


def test_robots_of_a_moved_camera_are_lost_without_a_line():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 0.0)})
    swarm.localizer.distrust(swarm.now_s + 0.03, [0])
    assert swarm[0].state is RobotState.TRACKED, "another camera sees it"
    swarm.localizer.distrust(swarm.now_s + 0.2, [0, 7])
    assert swarm[0].state is RobotState.LOST and "calibrate_camera arena" in swarm[0].problem
    for _ in range(6):
        swarm.run(0.5)
        swarm.localizer.distrust(swarm.now_s, [0])
    assert len(swarm.lines) == 1
    assert "is its tag occluded" in swarm.run(2.0)[0].problem, "no images come any more"
    assert swarm.run(0.1, {0: (1.0, 2.0, 0.0)})[0].state is RobotState.TRACKED


def test_poses_that_wait_for_odometry_are_told_of_when_it_comes():
    swarm = Swarm(0).run(0.1)
    measurement = Measurement(swarm.now_s + 0.02, Pose(1.0, 2.0, 0.0), COVARIANCE)
    assert swarm.localizer.add_measurement(0, measurement) == []
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
    assert swarm[0].odom_origin == pytest.approx((1.0, 2.0, 0.0))
    assert swarm.lines[1:] == ["hero_0: its odometry was set or it restarted; its place in the map stays"]


def test_a_robot_that_is_off_or_falls_silent_is_named():
    swarm = Swarm(0)
    assert "is the robot on" in swarm[0].problem
    swarm.run(1.0, {0: (1.0, 2.0, 0.0)})
    swarm.now_s += 5.0
    assert swarm[0].problem == "no odometry for 5 s: is the robot on and in reach?"


def test_stamps_of_another_clock_are_named():
    swarm = Swarm(0).run(2.0)
    old = Measurement(swarm.now_s - 30.0, Pose(0.0, 0.0, 0.0), COVARIANCE)
    assert swarm.localizer.add_measurement(0, old) == []
    assert swarm[0].problem == "measured poses come with stamps 30.0 s old: do the clocks agree?"
    ahead = old._replace(stamp_s=swarm.now_s + 5.0)
    assert swarm.localizer.add_measurement(0, ahead) == ["hero_0 found at (0.000, 0.000) m, 0 degrees"]
    assert swarm[0].problem == "measured poses come with stamps 5.0 s ahead: do the clocks agree?"


def test_robots_are_localized_again_after_a_jump_back_in_time():
    swarm = Swarm(0, 1).run(1.0, {0: (1.0, 2.0, 0.0)})
    swarm.now_s -= 50.0
    swarm.run(1.0, {0: (1.5, 2.0, 0.0)})
    assert swarm.lines[1:] == [
        "time jumped back by 50.0 s: all robots are localized again",
        "hero_0 found at (1.500, 2.000) m, 0 degrees",
    ]
    assert swarm[0].problem == "" and swarm[0].estimate.pose == pytest.approx((1.5, 2.0, 0.0))
    assert swarm[1].state is RobotState.UNKNOWN


def test_a_pose_of_a_robot_that_is_not_expected_is_refused():
    with pytest.raises(KeyError):
        Swarm(0).localizer.add_measurement(7, Measurement(0.0, Pose(0.0, 0.0, 0.0), COVARIANCE))


def test_many_robots_lost_and_found_make_one_line_in_ten_seconds():
    robots = range(8)
    places = {robot_id: (0.1 * robot_id, 0.0, 0.0) for robot_id in robots}
    swarm = Swarm(*robots).run(1.0, places, robots=robots)
    swarm.lines.clear()
    for _ in range(12):
        swarm.run(1.5, robots=robots).run(1.0, places, robots=robots)
    singles = [line for line in swarm.lines if " more lines " not in line]
    assert len(singles) == 4 and all("lost: " in line for line in singles)
    summaries = [line for line in swarm.lines if " more lines " in line]
    assert len(summaries) == 2
    assert summaries[1].startswith("64 more lines on robots lost or found again in 10 s: 8 robots (hero_0, ")


def test_after_a_quiet_while_each_lost_robot_has_a_line_again():
    robots = range(8)
    places = {robot_id: (0.1 * robot_id, 0.0, 0.0) for robot_id in robots}
    swarm = Swarm(*robots).run(1.0, places, robots=robots).run(1.5, robots=robots).run(25.0, places, robots=robots)
    swarm.lines.clear()
    others = {robot_id: place for robot_id, place in places.items() if robot_id}
    assert swarm.run(1.5, others, robots=robots).lines == ["hero_0 lost: its pose follows its odometry"]


def test_states_are_those_of_the_message():
    for state in RobotState:
        assert getattr(RobotPose, state.name) == state
    assert len(RobotState) == 3


def test_steps_are_told_by_distance_and_by_the_shorter_turn():
    swarm = Swarm(0).run(1.0, {0: (1.0, 2.0, 3.1)}).run(2.0).run(0.3, {0: (1.0, 2.0, -3.12)})
    assert swarm.lines[-1].endswith("0 mm and 4 degrees off its odometry"), swarm.lines
