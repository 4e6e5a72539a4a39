"""What ~robots says: every robot in a row that can be sent, and duplicates with data of their own."""

import io
from types import SimpleNamespace

import pytest
import rospy
from corrected_robot import make_corrections
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_updater import DiagnosticStatusWrapper

from hero_driver.commands.stop_progress import StopState
from hero_driver.fleet.namespaces import Identity
from hero_driver.fleet.registry import RobotRecord, RobotState
from hero_driver.reports import reporter as reporter_module
from hero_driver.reports.reporter import FleetStatus, Reporter
from hero_driver.reports.robot_status import DUPLICATES_SHOWN, describe_robot
from hero_msgs.msg import Robot, RobotArray

NOW_S = 1000.0


class Publisher:
    """Takes messages as rospy does: as bytes."""

    def __init__(self, name, message_class, queue_size, latch):
        assert (name, message_class, latch) == ("~robots", RobotArray, True) and queue_size
        self.published = []

    def publish(self, message):
        buffer = io.BytesIO()
        message.serialize(buffer)
        self.published.append(RobotArray().deserialize(buffer.getvalue()))


class Updater:
    """What diagnostic_updater's is to the reporter."""

    def __init__(self):
        self.publisher = self
        self.tasks, self.updates = {}, 0

    def setHardwareID(self, name):  # noqa: N802 - its name
        pass

    def add(self, name, task):
        self.tasks[name] = task

    def removeByName(self, name):  # noqa: N802 - its name
        del self.tasks[name]

    def get_num_connections(self):
        return 1

    def force_update(self):
        self.updates += 1


@pytest.fixture(name="reporter")
def make_reporter(monkeypatch):
    monkeypatch.setattr(rospy, "Publisher", Publisher)
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time(1795240942)))
    monkeypatch.setattr(reporter_module.diagnostic_updater, "Updater", Updater)
    return Reporter()


def make_record(**changes):
    values = {
        "identity": Identity("/hero_7", 7),
        "host": "10.0.0.1",
        "address": "10.0.0.1:4711",
        "link": None,
        "state": RobotState.READY,
        "since_s": NOW_S,
        "last_heard_s": NOW_S,
        "joined_s": NOW_S,
    }
    return RobotRecord(**{**values, **changes})


def publish(reporter, *records):
    """Return the rows of a report about robots."""
    stops = {"10.0.0.2:1": StopState.MOVING}
    robots = [describe_robot(record, None, None, StopState.NOT_STOPPED, stops, NOW_S) for record in records]
    reporter.publish(FleetStatus(NOW_S, RobotArray(), robots, 0, 0, ""))
    return reporter._publisher.published[-1].robots


def test_a_duplicate_has_a_row_with_its_own_address_and_nothing_else(reporter):
    refused = {"10.0.0.2:1": "two robots call themselves /hero_7, says a text in any words"}
    rows = publish(reporter, make_record(firmware="v3.8", refused=refused))
    assert [(row.address, row.state, row.firmware) for row in rows] == [
        ("10.0.0.1:4711", Robot.READY, "v3.8"),
        ("10.0.0.2:1", Robot.REFUSED, ""),
    ]
    assert rows[1].last_error == refused["10.0.0.2:1"]
    assert [row.stop_state for row in rows] == [Robot.NOT_STOPPED, Robot.MOVING]


def test_hundreds_of_duplicates_of_one_robot_do_not_fill_the_report(reporter):
    refused = {"10.0.0.2:%d" % port: "refused" for port in range(500)}
    assert len(publish(reporter, make_record(refused=refused))) == 1 + DUPLICATES_SHOWN == 9


def test_robots_that_leave_together_leave_the_diagnostics(reporter):
    publish(reporter, *(make_record(identity=Identity("/hero_%d" % number, number)) for number in (2, 5, 7)))
    reporter.diagnose()
    assert list(reporter._updater.tasks) == ["driver", "hero_2", "hero_5", "hero_7"]
    publish(reporter, make_record(identity=Identity("/hero_5", 5)))
    reporter.diagnose()
    assert list(reporter._updater.tasks) == ["driver", "hero_5"] and reporter._updater.updates == 2


def test_what_a_robot_says_of_itself_keeps_no_other_out_of_the_report(reporter):
    odd = make_record(
        since_s=-1e9,
        firmware="\ud7ff\U0010ffff" * 16,
        booted_s=NOW_S - 9999999.999,
        last_error="x" * 5000,
        dropped_messages=2**63,
        bad_packets=2**63,
        reconnects=2**31,
    )
    other = make_record(identity=Identity("/hero_8", 8))
    assert [row.id for row in publish(reporter, odd, other)] == [7, 8]


def test_a_robot_of_which_nothing_came_has_zeros_in_its_report(reporter):
    status = describe_robot(make_record(), None, None, StopState.NOT_STOPPED, {}, NOW_S)
    row = status.message
    assert (status.packets, status.received_length, status.duplicates, status.text) == (0, 0, [], "ready")
    assert (row.clock_offset, row.uptime.to_sec(), row.dropped_messages, row.model) == (0.0, 0.0, 0, "")
    (row,) = publish(reporter, make_record())
    assert (row.packets_per_s, row.bytes_per_s) == (0.0, 0.0)


def test_rates_are_what_came_since_the_last_report_by_the_time_between(reporter):
    def measure(now_s, *records):
        robots = [describe_robot(record, None, None, StopState.NOT_STOPPED, {}, now_s) for record in records]
        status = FleetStatus(now_s, RobotArray(), robots, 0, 0, "")
        reporter.measure_rates(status)
        reporter.publish(status)
        return [(row.packets_per_s, row.bytes_per_s) for row in reporter._publisher.published[-1].robots]

    assert measure(NOW_S, make_record(packets=100, received_length=1000)) == [(0.0, 0.0)]
    assert measure(NOW_S + 2.0, make_record(packets=500, received_length=9000)) == [(200.0, 4000.0)]
    assert measure(NOW_S + 3.0) == []
    assert measure(NOW_S + 4.0, make_record(packets=950, received_length=9000)) == [(0.0, 0.0)], "it was gone"


def test_a_report_says_since_when_each_robot_is_in_its_state(reporter):
    assert publish(reporter, make_record(since_s=NOW_S - 12.0))[0].since.to_sec() == 1795240942 - 12
    assert publish(reporter, make_record(since_s=NOW_S - 2e9))[0].since.to_sec() == 0


def test_a_report_names_gone_robots_in_diagnostics_too(reporter):
    gone = [describe_robot(make_record(), None, None, StopState.NOT_STOPPED, {}, NOW_S).message]
    reporter.publish(FleetStatus(NOW_S, RobotArray(gone=gone, stopped=True), [], 0, 0, ""))
    assert [robot.id for robot in reporter._publisher.published[-1].gone] == [7]
    stat = reporter._updater.tasks["driver"](DiagnosticStatusWrapper())
    text = "0 of 1 robots connected; gone: hero_7; all robots are stopped (~stop)"
    assert (stat.level, stat.message) == (stat.WARN, text)


def test_a_damaged_calibration_is_reported_beside_all_else(reporter):
    commands = SimpleNamespace(refused=0, queue=SimpleNamespace(dropped=0), tunes=lambda now_s: False)

    def describe(problems, **changes):
        corrections = make_corrections("/hero_7", [], calibration_problems=problems)
        bridge = SimpleNamespace(endpoints=SimpleNamespace(last_error=""), commands=commands, corrections=corrections)
        status = describe_robot(make_record(**changes), bridge, None, StopState.NOT_STOPPED, {}, NOW_S)
        return status.message.last_error, (status.level, status.text)

    text = "not calibrated: hero_7.yaml: broken; correct it, then restart the driver"
    problems = {"hero_7": "hero_7.yaml: broken; correct it"}
    assert describe({"hero_70": "broken"}) == ("", (DiagnosticStatus.OK, "ready"))
    assert describe(problems) == (text, (DiagnosticStatus.WARN, text))
    last_error, (level, _) = describe(problems, state=RobotState.AWAY, last_error="silent for 6 s")
    assert (last_error, level) == ("silent for 6 s; " + text, DiagnosticStatus.ERROR)


def test_diagnostics_have_a_part_for_each_robot_that_is_known(reporter):
    updater = reporter._updater
    for updates, numbers in enumerate(((7,), (7, 8), (8,)), 1):
        records = [make_record(identity=Identity("/hero_%d" % number, number)) for number in numbers]
        publish(reporter, *records)
        reporter.diagnose()
        assert sorted(updater.tasks) == ["driver", *("hero_%d" % number for number in numbers)]
        assert updater.updates == updates
    stat = DiagnosticStatusWrapper()
    updater.tasks["hero_8"](stat)
    values = {pair.key: pair.value for pair in stat.values}
    assert (values["address"], values["state"], values["stop_state"]) == ("10.0.0.1:4711", "READY", "NOT_STOPPED")
    stat = updater.tasks["driver"](DiagnosticStatusWrapper())
    assert (stat.level, stat.message) == (stat.OK, "1 of 1 robots connected")
