"""What contradicts a robot's model: each said once with a remedy, and odometry goes on."""

import math

import pytest
from corrected_robot import CorrectedRobot
from robot_messages import MS, NOW_NS

from hero_node.files import KeptCalibration
from hero_node.ros_messages import PLUS_ENCODER_MD5

STOCK_ENCODER_MD5 = "b5586cdbae9b740afc6a1f403a2d7dde"


def drive(robot):
    """Let both wheels count 20 ticks; return how far that is by odometry."""
    before_m = robot.corrections.odometry.ticks.x_m
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    robot.receive_burst(NOW_NS + 34 * MS, (20.0, 20.0))
    return robot.corrections.odometry.ticks.x_m - before_m


@pytest.mark.parametrize("md5sum", [STOCK_ENCODER_MD5, PLUS_ENCODER_MD5])
def test_of_a_robot_that_looks_like_its_model_nothing_is_said(md5sum):
    assert CorrectedRobot().corrections.note_encoder(md5sum) == ""


def test_an_id_whose_model_changes_is_told_of_and_goes_on_from_where_it_is():
    robot = CorrectedRobot()
    assert robot.corrections.note_encoder(STOCK_ENCODER_MD5) == ""
    assert drive(robot) == pytest.approx(20 * math.pi * 0.0492 / 288)
    robot.reconnect(rebooted=True)
    conflict = robot.corrections.note_encoder(PLUS_ENCODER_MD5)
    assert "it was a hero and is a hero_plus now" in conflict and "two ids" in conflict
    assert drive(robot) == pytest.approx(20 * math.pi * 0.050 / 96)
    robot.reconnect(rebooted=True)
    assert robot.corrections.note_encoder(PLUS_ENCODER_MD5) == ""


@pytest.mark.parametrize(
    "md5sum, rim_m, separation_m",
    [(STOCK_ENCODER_MD5, math.pi * 0.0492 / 288, 0.063), (PLUS_ENCODER_MD5, math.pi * 0.050 / 96, 0.065)],
)
def test_a_robot_turns_by_the_wheels_of_its_model(md5sum, rim_m, separation_m):
    robot = CorrectedRobot()
    robot.corrections.note_encoder(md5sum)
    robot.receive_burst(NOW_NS, (0.0, 0.0))
    robot.receive_burst(NOW_NS + 34 * MS, (-20.0, 20.0))
    assert robot.corrections.odometry.ticks.yaw_rad == pytest.approx(40 * rim_m / separation_m)


@pytest.mark.parametrize("model, diameter_m", [("hero", 0.050), ("hero_plus", 0.048), ("", 0.048)])
def test_calibrated_wheels_of_another_model_are_told_of_and_not_used(model, diameter_m):
    robot = CorrectedRobot(
        own_wheels={"hero_0": KeptCalibration(0, "", {"wheels_m": [0.048, 0.048, 0.06]}, {"model": model})}
    )
    conflict = robot.corrections.note_encoder(PLUS_ENCODER_MD5)
    assert ("it is a hero_plus, but its calibration file says hero" in conflict) == (model == "hero")
    assert bool(conflict) == (model == "hero")
    assert drive(robot) == pytest.approx(20 * math.pi * diameter_m / 96)
