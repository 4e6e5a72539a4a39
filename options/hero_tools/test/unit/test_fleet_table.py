"""The fleet as lines that fit the terminal, and as valid JSON."""

import json
import math

import pytest
from test_fleet_rows import make_row

from hero_client.values import Obstacle
from hero_msgs.msg import Robot
from hero_node import Pose
from hero_tools.fleet_table import format_json, format_nearest, format_table, format_title


@pytest.mark.parametrize("width", [1, 20, 79, 200])
@pytest.mark.parametrize("height", [2, 3, 10, 100])
def test_the_table_fits_the_terminal(width, height):
    rows = [make_row(robot_id, last_error="x" * 300) for robot_id in range(50)]
    lines = format_table(rows, width, height)
    assert len(lines) <= height
    assert max(map(len, lines)) <= width


def test_rows_that_do_not_fit_are_counted():
    lines = format_table([make_row(robot_id) for robot_id in range(50)], 200, 10)
    assert "42 more" in lines[-1]
    assert lines[-2].startswith("hero_7 ")
    rows = [make_row(robot_id) for robot_id in range(9)]
    assert len(format_table(rows, 200, 10)) == 10 and "3 more" in format_table(rows, 200, 8)[-1]


def test_columns_are_aligned_with_their_headings():
    heading, *lines = format_table([make_row(0), make_row(100, pose=Pose(-12.0, 3.0, math.pi))], 200, 10)
    for line in lines:
        assert line.index("READY") == heading.index("STATE")
        assert line.index("10.42") == heading.index("ADDRESS")


def test_texts_of_robots_cannot_draw_on_the_terminal():
    row = make_row(0, namespace="/he\x1b[2Jro", address="a\rb", last_error="bell \x07 \x9b31m")
    text = "".join(format_table([row], 200, 10)) + format_title([row], "x\x1b[2J", False)
    assert text.isprintable()


@pytest.mark.parametrize(
    ("bearing_rad", "where"),
    [
        (0.0, "front"),
        (math.pi / 2, "left"),
        (-math.pi / 2, "right"),
        (math.pi, "rear"),
        (-math.pi, "rear"),
    ],
)
def test_the_nearest_obstacle_has_a_direction_in_words(bearing_rad, where):
    assert format_nearest(True, False, Obstacle(0.123, bearing_rad)) == "0.12 m " + where
    assert format_nearest(True, False, Obstacle(-math.inf, bearing_rad)) == "touch " + where


def test_free_is_shown_apart_from_no_scan_yet():
    assert format_nearest(True, True, None) == "free" and format_nearest(True, False, None) == "not calibrated"
    assert format_nearest(False, False, None) == "-"


def test_the_title_counts_ready_robots_and_shows_a_stop():
    title = format_title([make_row(0), make_row(1, state=Robot.AWAY)], "0.0.0.0:11411", True)
    assert "1 of 2 robots ready" in title
    assert "0.0.0.0:11411" in title
    assert "STOPPED" in title


def test_json_has_no_infinity():
    row = make_row(0, nearest=Obstacle(-math.inf, 0.0), pose=Pose(math.nan, 1.0, 0.0), clock_offset=math.inf)
    (robot,) = json.loads(format_json([row], "", False))["robots"]
    assert robot["nearest"] == {"range_m": None, "bearing_rad": 0.0}
    assert robot["pose"] == {"x_m": None, "y_m": 1.0, "yaw_rad": 0.0}
    assert robot["clock_offset_s"] is None
    assert robot["id"] == 0


def test_rates_are_rounded_in_json():
    row = make_row(0, bytes_per_s=44051.2345, packets_per_s=99.876)._replace(odom_hz=29.3456)
    (robot,) = json.loads(format_json([row], "", False))["robots"]
    assert (robot["odom_hz"], robot["packets_per_s"], robot["bytes_per_s"]) == (29.35, 99.88, 44051.2)


def test_the_state_of_a_stop_stands_beside_the_robots_state():
    row = make_row(3, stop_state=Robot.MOVING)
    assert "READY, MOVING " in format_table([row], 200, 10)[1]
    assert json.loads(format_json([row], "", True))["robots"][0]["stop_state"] == "MOVING"


def test_the_title_names_drivers_that_do_not_answer():
    title = format_title([], "", False, ["/hero_driver_b", "/lab/driver"])
    assert "driver hero_driver_b does not answer, driver lab/driver does not answer" in title
