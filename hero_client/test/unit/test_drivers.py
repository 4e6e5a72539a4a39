"""Reports of several drivers become one: each robot once, stopped only if all are; only drivers are believed."""

import time

import pytest

from hero_client.ros.drivers import find_drivers, merge
from hero_client.values.robot_states import STATES, STOP_STATES, describe_stop_origin
from hero_msgs.msg import Robot, RobotArray


def make_report(port, robots, stopped=False, stamp_s=1):
    report = RobotArray(listening="10.42.0.1:%d" % port if port else "", stopped=stopped)
    report.header.stamp.secs = stamp_s
    for number, state in robots:
        namespace = "" if number is None else "/hero_%d" % number
        address = "10.42.0.%d:%d" % (number or 99, port)
        robot_id = -1 if number is None else number
        report.robots.append(Robot(id=robot_id, namespace=namespace, state=state, address=address))
    return report


def list_robots(report):
    return [(robot.namespace, robot.state) for robot in report.robots]


def test_one_report_stays_what_it_is():
    report = make_report(11411, [(2, Robot.READY), (10, Robot.AWAY), (None, Robot.JOINING)], stopped=True)
    merged = merge([report])
    assert (merged.listening, merged.stopped, merged.header.stamp.secs) == ("10.42.0.1:11411", True, 1)
    assert sorted(list_robots(merged)) == sorted(list_robots(report))


def test_robots_of_all_are_there_with_all_addresses_and_the_newest_stamp():
    first, second = make_report(2, [(100, Robot.READY)], stamp_s=7), make_report(1, [(0, Robot.READY)])
    merged = merge([first, second, make_report(0, [])])
    assert list_robots(merged) == [("/hero_0", Robot.READY), ("/hero_100", Robot.READY)]
    assert merged.listening == "10.42.0.1:1, 10.42.0.1:2"
    assert merged.header.stamp.secs == 7


def test_a_robot_that_went_to_another_driver_is_there_once_where_it_is_now():
    here, away = make_report(1, [(3, Robot.READY)]), make_report(2, [(3, Robot.AWAY)])
    for reports in ([here, away], [away, here]):
        merged = merge(reports)
        assert list_robots(merged) == [("/hero_3", Robot.READY)]
        assert merged.robots[0].address == "10.42.0.3:1"


def test_refused_and_unidentified_peers_are_no_other_robot():
    reports = [
        make_report(1, [(3, Robot.READY), (None, Robot.JOINING)]),
        make_report(2, [(3, Robot.REFUSED), (None, Robot.JOINING)]),
    ]
    assert len(merge(reports).robots) == 4


def test_robots_that_are_gone_from_one_driver_are_not_if_another_has_them():
    first, second = make_report(1, [(3, Robot.READY)]), make_report(2, [])
    second.gone = [Robot(id=number, namespace="/hero_%d" % number) for number in (9, 3)]
    first.gone = second.gone[:1]
    assert [robot.id for robot in merge([first, second]).gone] == [9]


def test_a_merged_report_names_all_who_stopped_robots():
    reports = [make_report(number, [], stopped=True) for number in range(3)]
    for report, node in zip(reports, ("/teleop", "", "/hero_monitor")):
        report.stopped_by = node
    assert merge(reports).stopped_by == "/hero_monitor, /teleop"


@pytest.mark.parametrize(
    ("by", "age_s", "text"),
    [
        ("/lab/teleop", 600, "by lab teleop since 09:03"),
        ("", 93600, "since 2023-11-13 07:13, before the driver's start"),
        ("", None, "before the driver's start"),
    ],
)
def test_a_stop_is_told_with_who_requested_it_and_since_when(monkeypatch, by, age_s, text):
    monkeypatch.setenv("TZ", "UTC+13")
    time.tzset()
    report = make_report(1, [], stopped=True, stamp_s=100000)  # a clock of its own (/clock)
    report.stopped_by, report.stopped_since.secs = by, 0 if age_s is None else 100000 - age_s
    assert describe_stop_origin(report, 1.7e9) == text
    report.stopped = False
    assert describe_stop_origin(report, 1.7e9) == ""
    monkeypatch.undo()
    time.tzset()


def test_the_fleet_is_stopped_only_if_every_driver_is():
    stopped, free = make_report(1, [], stopped=True), make_report(2, [])
    assert merge([stopped, stopped]).stopped
    assert not merge([stopped, free]).stopped


def make_system_state(publishers, services):
    return [list(map(list, publishers.items())), [], list(map(list, services.items()))]


def test_a_node_with_reports_and_a_stop_service_is_a_driver():
    state = make_system_state(
        {"/lab/driver/robots": ["/lab/driver"], "/other/robots": ["/other"]}, {"/lab/driver/stop": ["/lab/driver"]}
    )
    assert find_drivers(state, ["/lab/driver/robots", "/other/robots"]) == {"/lab/driver/robots"}


def test_reports_that_a_robot_declares_are_not_those_of_a_driver():
    state = make_system_state({"/hero_0/robots": ["/hero_driver"]}, {"/hero_0/stop": ["/hero_driver"]})
    assert find_drivers(state, ["/hero_0/robots"]) == set()


def test_the_states_of_tables_are_those_of_the_messages():
    names = ("JOINING", "READY", "AWAY", "REFUSED")
    assert {getattr(Robot, name): name for name in names} == STATES
    names = ("NOT_STOPPED", "STOPPING", "AT_REST", "MOVING", "UNCONFIRMED")
    assert [getattr(Robot, name) for name in names] == list(STOP_STATES)
