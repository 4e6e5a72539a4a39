"""What a script is told whose end ends its only command."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="Robot imports rospy")
from hero_client.robot import Robot
from hero_client.robots.robot_base import BaseRobot


@pytest.fixture(name="robot")
def make_robot():
    robot = Robot.__new__(Robot)  # without a ROS node
    clock = SimpleNamespace(now_s=100.0)
    link = SimpleNamespace(clock=clock, send_velocity=lambda *velocity: None, is_stopped=False)
    BaseRobot.__init__(robot, 3, link)
    return robot


@pytest.mark.parametrize(
    ("commands", "later_s", "is_said"),
    [
        ([(0.1, 0.0)], 0.0, True),
        ([(0.1, 0.0)], 5.0, False),  # driven to its end
        ([(0.1, 0.0), (0.0, 0.0)], 0.0, False),
        ([(0.1, 0.0)] * 3, 0.0, False),  # a loop that was ended
        ([], 0.0, False),
    ],
)
def test_a_single_command_that_the_end_ends_is_said(robot, capsys, commands, later_s, is_said):
    for command in commands:
        robot.drive(*command)
    robot._clock.now_s += later_s
    robot._explain_end()
    assert ("hero_3 stops, as the program ends right after drive()" in capsys.readouterr().err) == is_said
