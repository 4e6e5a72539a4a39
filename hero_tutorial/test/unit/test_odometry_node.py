"""The simulated square of the odometry tutorial."""

import math
from pathlib import Path

import pytest

from hero_test.nonempty import nonempty
from hero_test.tutorial_runner import read_blocks

PAGE = Path(__file__).resolve().parents[3] / "docs" / "tutorial" / "ros_basics" / "07_odometry.md"
SIDE_M = 10.0
SIDE_S = SIDE_M / 0.6 + math.pi / 2 / 0.2
STEP_S = 0.01


@pytest.fixture(scope="module")
def compute_motion():
    pytest.importorskip("rospy", reason="the script imports rospy")
    (script,) = [block.text for block in read_blocks(PAGE) if block.file and block.file.endswith("/odometry_node.py")]
    names = {"__name__": "odometry_node"}
    exec(script, names)
    return names["compute_motion"]


def test_the_corners_are_ten_meters_apart_and_the_square_is_closed(compute_motion):
    corners = [compute_motion(side * SIDE_S + 1e-6, SIDE_M)[:2] for side in range(5)]
    for found, right in zip(corners, [(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)]):
        assert found == pytest.approx(right, abs=1e-5)


def test_the_robot_turns_left_by_a_quarter_at_each_corner(compute_motion):
    headings = [compute_motion((side + 1) * SIDE_S - 1e-6, SIDE_M)[2] for side in range(4)]
    assert headings == pytest.approx([math.pi / 2 * (side + 1) for side in range(4)], abs=1e-5)


def test_pose_and_velocity_are_consistent(compute_motion):
    """The pose changes at the given velocity, except in the steps in which a side or a turn ends."""
    jumps = 0
    for step in nonempty(range(int(4 * SIDE_S / STEP_S))):
        x_m, y_m, yaw_rad, linear_m_s, angular_rad_s = compute_motion(step * STEP_S, SIDE_M)
        assert (linear_m_s, angular_rad_s) in ((0.6, 0.0), (0.0, 0.2))
        next_x_m, next_y_m, next_yaw_rad = compute_motion((step + 1) * STEP_S, SIDE_M)[:3]
        off_m = math.hypot(
            next_x_m - x_m - linear_m_s * STEP_S * math.cos(yaw_rad),
            next_y_m - y_m - linear_m_s * STEP_S * math.sin(yaw_rad),
        )
        off_rad = math.remainder(next_yaw_rad - yaw_rad - angular_rad_s * STEP_S, 2 * math.pi)
        jumps += off_m > 1e-9 or abs(off_rad) > 1e-9
        assert off_m <= 0.6 * STEP_S
    assert jumps <= 8
