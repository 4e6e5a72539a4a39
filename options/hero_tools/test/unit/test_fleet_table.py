"""The fleet as lines that fit the terminal, and as valid JSON."""

import json
import math
import time

import pytest
import rospy
from test_fleet_rows import make_row

from hero_client.values import Obstacle
from hero_msgs.msg import Robot, RobotArray
from hero_node import Pose
from hero_test.nonempty import nonempty
from hero_tools.fleet_table import format_json, format_nearest, format_table, format_title

NOW_S = 1700000140
"""A time of day of 12:15 in any zone: tests set TZ."""


@pytest.fixture(autouse=True)
def set_time_zone(monkeypatch):
    monkeypatch.setenv("TZ", "UTC+10")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


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
    for line in nonempty(lines):
        assert line.index("READY") == heading.index("STATE")
        assert line.index("10.42") == heading.index("ADDRESS")


def test_texts_of_robots_cannot_draw_on_the_terminal():
    row = make_row(0, namespace="/he\x1b[2Jro", address="a\rb", last_error="bell \x07 \x9b31m")
    text = "".join(format_table([row], 200, 10) + format_title(RobotArray(listening="x\x1b[2J"), NOW_S))
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
    assert format_nearest(True, False, Obstacle(0.0, bearing_rad)) == "touch " + where


def test_free_is_shown_apart_from_no_scan_yet():
    assert format_nearest(True, True, None) == "free" and format_nearest(True, False, None) == "not calibrated"
    assert format_nearest(False, False, None) == "-"


def test_the_title_counts_ready_robots_and_shows_a_stop():
    states = (Robot.READY, Robot.READY, Robot.AWAY, Robot.JOINING, Robot.REFUSED)
    report = RobotArray(robots=[make_row(0, state=state).robot for state in states], listening="0.0.0.0:11411")
    assert format_title(report, NOW_S) == ["2 of 4 robots ready, 1 joining, 1 lost, driver listens on 0.0.0.0:11411"]
    report.stopped, report.stopped_by, report.listening = True, "/lab/teleop", ""
    assert format_title(report, NOW_S) == [
        "0 of 4 robots ready, 1 joining, 2 stopped, 1 lost, ALL STOPPED by lab teleop"
    ]


def test_robots_that_are_gone_stay_in_the_title_and_in_json():
    gone = [
        Robot(id=number, namespace="/hero_%d" % number, since=rospy.Time(NOW_S - age_s))
        for number, age_s in ((7, 101), (3, 110), (5, 7200))
    ]
    report = RobotArray(robots=[make_row(0).robot], gone=gone)
    report.header.stamp = rospy.Time(NOW_S)
    assert format_title(report, NOW_S) == [
        "1 of 4 robots ready, 3 lost",
        "5 gone since 10:15; 3, 7 gone since 12:13 (d: list them no longer)",
    ]
    assert [robot["id"] for robot in json.loads(format_json([], report))["gone"]] == [7, 3, 5]


def test_json_has_no_infinity():
    row = make_row(0, nearest=Obstacle(math.inf, 0.0), pose=Pose(math.nan, 1.0, 0.0), clock_offset=math.inf)
    (robot,) = json.loads(format_json([row], RobotArray()))["robots"]
    assert robot["nearest"] == {"range_m": None, "bearing_rad": 0.0}
    assert robot["pose"] == {"x_m": None, "y_m": 1.0, "yaw_rad": 0.0}
    assert robot["clock_offset_s"] is None
    assert robot["id"] == 0


def test_rates_are_rounded_in_json():
    row = make_row(0, bytes_per_s=44051.2345, packets_per_s=99.876)._replace(odom_hz=29.3456)
    (robot,) = json.loads(format_json([row], RobotArray()))["robots"]
    assert (robot["odom_hz"], robot["packets_per_s"], robot["bytes_per_s"]) == (29.35, 99.88, 44051.2)


def test_the_state_of_a_stop_stands_beside_the_robots_state():
    row = make_row(3, stop_state=Robot.MOVING)
    assert "READY, MOVING " in format_table([row], 200, 10)[1]
    assert json.loads(format_json([row], RobotArray(stopped=True)))["robots"][0]["stop_state"] == "MOVING"


def test_the_title_names_drivers_that_do_not_answer():
    (title,) = format_title(RobotArray(), NOW_S, ["/hero_driver_b", "/lab/driver"])
    assert "driver hero_driver_b does not answer, driver lab/driver does not answer" in title
