"""Encoders and odometry of one robot: ticks, the middle of an arc, and what the stock firmware loses."""

import math

import pytest

from hero_node import Pose
from hero_node.robot_constants import TICK_M
from hero_sim.robot.wheel_odometry import WheelOdometry
from hero_sim.world.kinematics import join_wheels


def test_a_turning_robot_goes_along_the_middle_of_its_arc():
    odometry = WheelOdometry(0.0, 0.0)
    odometry.set_pose(Pose(1.0, 2.0, 0.5))
    odometry.read_encoders(40000, 100.5 * TICK_M, 300.5 * TICK_M)
    odometry.integrate()
    travel_m, turn_rad = join_wheels(100 * TICK_M, 300 * TICK_M)
    middle_rad = 0.5 + turn_rad / 2.0
    expected = (1.0 + travel_m * math.cos(middle_rad), 2.0 + travel_m * math.sin(middle_rad), 0.5 + turn_rad)
    assert odometry.pose == pytest.approx(expected) and abs(turn_rad) > 0.1
    odometry.set_heading(-3.0)
    assert odometry.pose == pytest.approx((*expected[:2], -3.0))


def test_odometry_adds_the_newest_interval_only():
    odometry = WheelOdometry(0.0, 0.0)
    for now_us, ticks in ((40000, 10.5), (80000, 15.5)):
        odometry.read_encoders(now_us, ticks * TICK_M, ticks * TICK_M)
    odometry.integrate()
    assert odometry.ticks == (15, 15) and odometry.pose == pytest.approx((5 * TICK_M, 0.0, 0.0))


def test_an_encoder_message_tells_ticks_travel_period_and_speeds():
    odometry = WheelOdometry(0.25 * TICK_M, -0.25 * TICK_M)
    odometry.read_encoders(40000, 10.5 * TICK_M, -4.5 * TICK_M)
    odometry.read_encoders(60000, 14.5 * TICK_M, -6.5 * TICK_M)
    values = odometry.list_encoder_values()
    speeds_m_s = (4 * TICK_M / 0.02, -2 * TICK_M / 0.02)
    assert values[:9] == pytest.approx((14, -6, 4, -2, 4 * TICK_M, -2 * TICK_M, 0.02, *speeds_m_s))
    assert values[9] > 0.0 and values[10] < 0.0, "filtered speeds, of the left and of the right wheel"
    assert odometry.twist == pytest.approx(join_wheels(*values[9:]))


def test_counters_begin_anew_with_a_set_pose_where_the_wheels_stand():
    odometry = WheelOdometry(0.0, 0.0)
    odometry.read_encoders(40000, 10.5 * TICK_M, 20.5 * TICK_M)
    odometry.set_pose(Pose(1.0, 2.0, 0.0))
    odometry.integrate()
    assert odometry.pose == (1.0, 2.0, 0.0) and odometry.count_ticks(11.5 * TICK_M, 18.5 * TICK_M) == [1, -2]
    odometry.read_encoders(40000, 30.5 * TICK_M, 30.5 * TICK_M)
    assert odometry.ticks == (20, 10), "two readings at one time have no speeds, but counts"
