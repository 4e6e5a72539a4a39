"""What contradicts a robot's model: each said once with a remedy, and odometry goes on."""

import math
import re

import pytest
from corrected_robot import CorrectedRobot
from robot_messages import MS, NOW_NS

from hero_node import PLUS_ENCODER_MD5
from hero_node.files import KeptCalibration

STOCK_ENCODER_MD5 = "b5586cdbae9b740afc6a1f403a2d7dde"


def declare(robot, md5sum, *topics):
    """Let the robot declare topics and, between them, its encoder; return the conflicts that are found."""
    found = [robot.corrections.models.find_conflict("/hero_0" + topic) for topic in topics]
    robot.corrections.note_encoder(md5sum)
    found += [robot.corrections.models.find_conflict("/hero_0" + topic) for topic in ("/encoder", "/odom")]
    return sorted(set(found) - {""})


def drive(robot):
    """Let both wheels count 20 ticks; return how far that is by odometry."""
    before_m = robot.corrections.odometry.ticks.x_m
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    robot.receive_burst(NOW_NS + 34 * MS, (20.0, 20.0))
    return robot.corrections.odometry.ticks.x_m - before_m


@pytest.mark.parametrize("md5sum, topic", [(STOCK_ENCODER_MD5, "/imu"), (PLUS_ENCODER_MD5, "/distance")])
def test_of_a_robot_that_looks_like_its_model_nothing_is_said(md5sum, topic):
    assert declare(CorrectedRobot(), md5sum, topic) == []


def test_a_distance_sensor_with_the_encoder_of_stock_robots_is_told_of():
    robot = CorrectedRobot()
    (found,) = declare(robot, STOCK_ENCODER_MD5, "/distance")
    assert re.search("the distance sensor of HeRo.* flash the firmware of HeRo", found)
    robot.reconnect(rebooted=True)
    assert declare(robot, STOCK_ENCODER_MD5) == [], "a new connection declares anew"


def test_an_id_whose_model_changes_is_told_of_and_goes_on_from_where_it_is():
    robot = CorrectedRobot()
    assert declare(robot, STOCK_ENCODER_MD5, "/imu") == []
    assert drive(robot) == pytest.approx(20 * math.pi * 0.0492 / 288)
    robot.reconnect(rebooted=True)
    (conflict,) = declare(robot, PLUS_ENCODER_MD5, "/distance")
    assert "it was a hero and is a hero_plus now" in conflict and "two ids" in conflict
    assert drive(robot) == pytest.approx(20 * math.pi * 0.050 / 96)
    robot.reconnect(rebooted=True)
    assert declare(robot, PLUS_ENCODER_MD5, "/distance") == []


@pytest.mark.parametrize("model, diameter_m", [("hero", 0.050), ("hero_plus", 0.048), ("", 0.048)])
def test_calibrated_wheels_of_another_model_are_told_of_and_not_used(model, diameter_m):
    robot = CorrectedRobot(
        own_wheels={"hero_0": KeptCalibration(0, "", {"wheels_m": [0.048, 0.048, 0.06]}, {"model": model})}
    )
    conflicts = declare(robot, PLUS_ENCODER_MD5)
    assert bool(conflicts) == (model == "hero")
    assert all("it is a hero_plus, but its calibration file says hero" in text for text in conflicts)
    assert drive(robot) == pytest.approx(20 * math.pi * diameter_m / 96)
