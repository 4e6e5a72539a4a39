"""Robots over ROS: the topics that they subscribe to, and what a script is told whose end ends its only command."""

import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

pytest.importorskip("rospy", reason="Robot imports rospy")
from hero_client import robot as robot_module
from hero_client.robot import Robot
from hero_client.robots.robot_base import BaseRobot
from hero_client.ros.ros_link import RosLink
from hero_client.values.errors import StaleDataError


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


def test_a_robot_subscribes_to_what_its_program_needs(monkeypatch):
    started, links, at_exit = [], [], []

    def make_link(robot_id):
        assert started, "a link needs a node"
        links.append(create_autospec(RosLink, instance=True, clock=SimpleNamespace(now_s=100.0, sleep=None)))
        return links[-1]

    monkeypatch.setattr(robot_module, "start_node", lambda: started.append(True))
    monkeypatch.setattr(robot_module, "RosLink", make_link)
    monkeypatch.setattr(robot_module.atexit, "register", at_exit.append)
    for options, topics in (
        ({}, ["odom", "proximity"]),
        ({"odom": False}, ["proximity"]),
        ({"proximity": False}, ["odom"]),
    ):
        robot = Robot(7, **options)
        assert [call[0][0] for call in links[-1].subscribe.call_args_list] == topics
        assert at_exit[-1] == robot._explain_end
    with pytest.raises(ValueError, match="-1"):
        Robot(-1)
    assert len(started) == len(links) == 3
    link = links[-1]
    link.read.side_effect, link.age_s.return_value = str.upper, 0.1
    assert (robot.odometry, robot.encoder, robot.imu) == ("ODOM", "ENCODER", "IMU")
    assert robot.read("battery") is link.read_extra.return_value
    link.read_extra.assert_called_once_with("battery", 5.0)
    link.age_s.return_value = 1.1
    for name, words in (
        ("odometry", "odom"),
        ("encoder", "encoder"),
        ("imu", "only robots with the IMU hat publish it"),
    ):
        with pytest.raises(StaleDataError, match=words):
            getattr(robot, name)
    link.age_s.return_value, link.wait_for_next.side_effect = math.inf, StaleDataError("no message on /hero_7/imu")
    with pytest.raises(StaleDataError, match="no message on /hero_7/imu: only robots with the IMU hat publish it"):
        assert robot.imu
