"""Data of a robot right after its Robot was made: waited for by those who read them, not by those who look."""

import math

import numpy as np
import pytest

from hero_client.robots.group import check_robot_id
from hero_client.robots.robot_base import BaseRobot
from hero_client.values.errors import StaleDataError
from hero_node import Clock, Pose


class FakeClock(Clock):
    now_s = 100.0

    def sleep(self, duration_s):
        self.now_s += duration_s
        return True


class LateLink:
    """A robot whose first messages come after a while."""

    is_stopped = False

    def __init__(self, first_s):
        self.clock = FakeClock()
        self._first_s = self.clock.now_s + first_s

    def missing(self):
        return None

    def age_s(self, topic):
        return 0.0 if self.clock.now_s >= self._first_s else math.inf

    def wait_for_next(self, topic, timeout_s):
        self.clock.sleep(min(timeout_s, self._first_s - self.clock.now_s))
        if self.age_s(topic) == math.inf:
            raise StaleDataError("late")

    def read_pose(self):
        return Pose(1.0, 2.0, 3.0)

    def read_ranges(self):
        return [0.1] * 8


def test_the_first_data_are_waited_for():
    link = LateLink(0.7)
    robot = BaseRobot(0, link)
    assert robot.pose == (1.0, 2.0, 3.0) and robot.proximity == [0.1] * 8
    assert link.clock.now_s == 100.7


@pytest.mark.parametrize("number", [np.int64(3), np.arange(4)[3]])
def test_a_number_of_numpy_names_a_robot(number):
    assert check_robot_id(number) == 3 and type(check_robot_id(number)) is int


def test_the_first_robot_has_the_number_0():
    assert check_robot_id(0) == 0


@pytest.mark.parametrize("wrong", ["hero_0", -1, 1.0, True, None, [0]])
def test_what_names_no_robot_is_refused(wrong):
    with pytest.raises(ValueError, match="a robot is named by its number, 0 or more, not by"):
        check_robot_id(wrong)


def test_data_that_never_come_are_waited_for_once():
    link = LateLink(math.inf)
    robot = BaseRobot(0, link)
    for _ in range(3):
        with pytest.raises(StaleDataError, match="no message on /hero_0/odom yet: is the robot on"):
            assert robot.pose
    assert link.clock.now_s == 102.0


def test_requests_for_known_values_do_not_wait():
    link = LateLink(0.7)
    robot = BaseRobot(0, link)
    assert robot.fresh_pose() is None and all(map(math.isnan, robot.fresh_proximity()))
    assert repr(robot) == "<hero_0: ready>"
    assert link.clock.now_s == 100.0
