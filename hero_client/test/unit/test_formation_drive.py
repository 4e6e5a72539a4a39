"""Robots as one rigid body: where it begins, how each place moves, how fast, and when it waits. Planes are complex."""

import cmath
import math
import random

import pytest

from hero_client.controllers.formation_drive import FormationDrive
from hero_node import STOP, Pose, Velocity
from hero_test.nonempty import nonempty

AHEAD_M, PERIOD_S = 0.04, 0.1
FORWARD = Velocity(0.1, 0.0)


def find_point(pose):
    return complex(*pose[:2]) + cmath.rect(AHEAD_M, pose.yaw_rad)


def find_speed(pose, command):
    """Return the velocity of the point ahead of the axle."""
    return complex(command.linear_m_s, AHEAD_M * command.angular_rad_s) * cmath.rect(1.0, pose.yaw_rad)


def draw_poses(rng, count=4):
    return [Pose(*(rng.uniform(-0.3, 0.3) for _ in range(2)), rng.uniform(-math.pi, math.pi)) for _ in range(count)]


def push(pose, shift):
    return pose._replace(x_m=pose.x_m + shift.real, y_m=pose.y_m + shift.imag)


def test_a_body_begins_amid_the_points_with_the_mean_heading():
    for headings_rad, mean_rad in (((3.0, -3.0), math.pi), ((0.5, -0.1), 0.2), ((1.0,), 1.0)):
        poses = [Pose(2.0 + index, -1.0, yaw_rad) for index, yaw_rad in enumerate(headings_rad)]
        body = FormationDrive(poses).pose
        assert complex(*body[:2]) == pytest.approx(sum(map(find_point, poses)) / len(poses))
        assert abs(math.remainder(body.yaw_rad - mean_rad, math.tau)) < 1e-9
        assert FormationDrive(poses).step(poses, STOP, PERIOD_S) == [pytest.approx((0.0, 0.0), abs=1e-12)] * len(poses)


def test_each_place_moves_with_the_body_however_its_robot_is_turned():
    rng = random.Random(1)
    for command in (Velocity(0.05, 0.0), Velocity(-0.03, 0.04), Velocity(0.0, -0.1)):
        poses = draw_poses(rng)
        drive = FormationDrive(poses)
        middle, heading = complex(*drive.pose[:2]), cmath.rect(1.0, drive.pose.yaw_rad)
        for pose, each in nonempty(zip(poses, drive.step(poses, command, PERIOD_S))):
            turning = 1j * command.angular_rad_s * (find_point(pose) - middle)
            assert find_speed(pose, each) == pytest.approx(command.linear_m_s * heading + turning)
        moved = complex(*drive.pose[:2]) - middle
        assert moved == pytest.approx(command.linear_m_s * heading * PERIOD_S)
        assert cmath.rect(1.0, drive.pose.yaw_rad) / heading == pytest.approx(
            cmath.rect(1.0, command.angular_rad_s * PERIOD_S)
        )


def test_the_outermost_place_is_never_faster_than_a_robot_can_be():
    poses = [Pose(-AHEAD_M, y_m, 0.0) for y_m in (0.5, 0.1, -0.6)]  # their middle is at 0, 0
    for command, share in (
        (Velocity(0.1, 0.0), 1.0),
        (Velocity(-0.2, 0.0), 0.5),
        (Velocity(0.0, -1.0), 0.1 / 0.6),
        (Velocity(0.1, 0.5), 0.25),
    ):
        drive = FormationDrive(poses)
        commands = drive.step(poses, command, PERIOD_S)
        assert drive.pose == pytest.approx(
            (command.linear_m_s * share * PERIOD_S, 0.0, command.angular_rad_s * share * PERIOD_S)
        )
        fastest_m_s = max(abs(find_speed(pose, each)) for pose, each in zip(poses, commands))
        assert fastest_m_s <= 0.1 + 1e-9


def test_the_body_waits_for_its_last_robot_which_catches_up():
    poses = [Pose(0.0, 0.2, 0.3), Pose(0.0, -0.2, -2.0)]
    for lag_m, share in ((0.0, 1.0), (0.03, 1.0), (0.075, 0.5), (0.12, 0.0), (0.5, 0.0)):
        for shift in (lag_m, -1j * lag_m):
            drive = FormationDrive(poses)
            middle, heading = complex(*drive.pose[:2]), cmath.rect(1.0, drive.pose.yaw_rad)
            seen = [poses[0], push(poses[1], shift)]
            commands = drive.step(seen, FORWARD, PERIOD_S)
            assert complex(*drive.pose[:2]) - middle == pytest.approx(0.1 * share * heading * PERIOD_S, abs=1e-12)
            assert find_speed(poses[0], commands[0]) == pytest.approx(0.1 * share * heading, abs=1e-12)
            # 1.5 of the lag per second, within 0.15 m/s and 2.5 rad/s.
            back = (0.1 * share * heading - 1.5 * shift) / cmath.rect(1.0, poses[1].yaw_rad)
            assert commands[1] == pytest.approx(
                (max(-0.15, min(0.15, back.real)), max(-2.5, min(2.5, back.imag / AHEAD_M))), abs=1e-9
            )


def test_robots_with_any_headings_keep_their_places_on_a_curve():
    rng = random.Random(2)
    poses = draw_poses(rng)
    before = [find_point(pose) for pose in poses]
    drive = FormationDrive(poses)
    begin = drive.pose
    for _ in range(100):
        commands = drive.step(poses, Velocity(0.05, 0.1), PERIOD_S)
        poses = [
            push(pose, cmath.rect(each.linear_m_s * PERIOD_S, pose.yaw_rad))._replace(
                yaw_rad=pose.yaw_rad + each.angular_rad_s * PERIOD_S
            )
            for pose, each in zip(poses, commands)
        ]
    turn = cmath.rect(1.0, drive.pose.yaw_rad - begin.yaw_rad)
    assert drive.pose.yaw_rad - begin.yaw_rad > 0.9
    for pose, point in nonempty(zip(poses, before)):
        place = complex(*drive.pose[:2]) + turn * (point - complex(*begin[:2]))
        assert abs(find_point(pose) - place) < 0.02
