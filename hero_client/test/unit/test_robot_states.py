"""States of robots in the words of all programs: counted, named, and since when."""

import datetime

import pytest

pytest.importorskip("hero_msgs.msg", reason="needs ROS")
import rospy

from hero_client.values import robot_states
from hero_client.values.robot_states import describe_counts, describe_gone, describe_stop_origin, name_state
from hero_msgs.msg import Robot, RobotArray

NOON = datetime.datetime(2026, 11, 28, 12, 0, 0)
NOW_S = NOON.timestamp()
REPORT_S = 500000
"""Stamp of the report in simulated time (s): not this PC's clock."""


def make_report(*states, **others):
    report = RobotArray(robots=[Robot(id=number, state=state) for number, state in enumerate(states)], **others)
    report.header.stamp = rospy.Time(REPORT_S)
    return report


def ago(minutes):
    return rospy.Time(REPORT_S - 60 * minutes)


def test_the_names_of_states_are_those_of_the_messages():
    for number, name in robot_states.STATES.items():
        assert getattr(Robot, name) == number
    assert len(robot_states.STATES) == 4


@pytest.mark.parametrize(
    ("state", "stopped", "name"),
    [
        (Robot.READY, False, "READY"),
        (Robot.READY, True, "STOPPED"),
        (Robot.AWAY, True, "AWAY"),
        (Robot.JOINING, True, "JOINING"),
        (77, False, "77"),
    ],
)
def test_a_robot_that_could_be_driven_is_stopped_with_all(state, stopped, name):
    assert name_state(Robot(state=state), stopped) == name


def test_robots_are_counted_by_what_they_can_do():
    states = [Robot.READY, Robot.READY, Robot.AWAY, Robot.JOINING, Robot.REFUSED]
    assert describe_counts(make_report()) == "0 of 0 robots ready"
    assert describe_counts(make_report(*states)) == "2 of 4 robots ready, 1 joining, 1 lost"
    gone = [Robot(id=8), Robot(id=9)]
    assert describe_counts(make_report(*states, gone=gone)) == "2 of 6 robots ready, 1 joining, 3 lost"
    assert describe_counts(make_report(*states, stopped=True)) == "0 of 4 robots ready, 1 joining, 2 stopped, 1 lost"


def test_robots_that_are_gone_are_named_by_the_time_since_when():
    gone = [
        Robot(id=7, since=ago(60 + 17)),
        Robot(id=3, since=ago(60 + 17)),
        Robot(id=-1, namespace="/ada", since=ago(13 * 60)),
        Robot(id=5),
    ]
    text = "5 gone; ada gone since 2026-11-27 23:00; 3, 7 gone since 10:43"
    assert describe_gone(make_report(gone=gone), NOW_S) == text
    assert describe_gone(make_report(), NOW_S) == ""


def test_who_stopped_the_robots_is_told_with_the_time():
    for stopped_by, since, text in (
        ("/teleop", ago(5), "by teleop since 11:55"),
        ("/lab/teleop", rospy.Time(0), "by lab teleop"),
        ("", ago(5), "since 11:55, before the driver's start"),
        ("", rospy.Time(0), "before the driver's start"),
    ):
        report = make_report(stopped=True, stopped_by=stopped_by, stopped_since=since)
        assert describe_stop_origin(report, NOW_S) == text
        report.stopped = False
        assert describe_stop_origin(report, NOW_S) == ""
