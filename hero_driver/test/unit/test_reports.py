"""What ~robots says: every robot in a row that can be sent, and duplicates with data of their own."""

import io

import pytest
import rospy

from hero_driver import reports
from hero_driver.commands.stop_progress import StopState
from hero_driver.fleet.namespaces import Identity
from hero_driver.fleet.registry import RobotRecord, RobotState
from hero_driver.reports import FleetStatus, Reporter
from hero_driver.robot_status import DUPLICATES_SHOWN, describe_robot
from hero_msgs.msg import Robot, RobotArray

NOW_S = 1000.0


class Publisher:
    """Takes messages as rospy does: as bytes."""

    def __init__(self, *_, **__):
        self.published = []

    def publish(self, message):
        buffer = io.BytesIO()
        message.serialize(buffer)
        self.published.append(RobotArray().deserialize(buffer.getvalue()))


class Updater:
    """What diagnostic_updater's is to the reporter."""

    def __init__(self):
        self.publisher = self

    def setHardwareID(self, name):  # noqa: N802 - its name
        pass

    def add(self, name, task):
        pass


@pytest.fixture(name="reporter")
def make_reporter(monkeypatch):
    monkeypatch.setattr(rospy, "Publisher", Publisher)
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time(1795240942)))
    monkeypatch.setattr(reports.diagnostic_updater, "Updater", Updater)
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
    reporter.publish(FleetStatus(NOW_S, "", False, 0, 0, "", robots))
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
    assert len(publish(reporter, make_record(refused=refused))) == 1 + DUPLICATES_SHOWN


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
