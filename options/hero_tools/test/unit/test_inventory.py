"""The inventory: robots of drivers and of fleet.yaml in one list, differing versions, and who has run for long."""

import csv
import io
import json

import rospy
from test_fleet_rows import make_row

from hero_msgs.msg import Robot
from hero_node.files import ExtraTopic, FleetFile, KeptCalibration, RobotNotes
from hero_tools.fleet_table import format_table, make_row_dict
from hero_tools.inventory import COLUMNS, LOW_SHARE, format_inventory, list_inventory, list_warnings

FILE = FleetFile({3: RobotNotes("Ada", "squeaks", True, "shelf 2", "Kim"), 9: RobotNotes("Grace")}, (), 2.0)
KEPT = {"hero_3": KeptCalibration(3, "2026-11-20", {"velocity_errors": [0.2, 0.05]})}
BATTERY = ExtraTopic("battery", "battery", "std_msgs/Float32", "data", "V")


def make_inventory(*rows):
    return list_inventory(rows, FILE, KEPT)


def test_robots_of_drivers_and_of_the_file_are_in_one_list():
    refused = make_row(4, state=Robot.REFUSED)
    inventory = make_inventory(make_row(3, model="hero", uptime=rospy.Duration(60)), refused, make_row(0))
    assert [(row["id"], row["state"], row["name"]) for row in inventory] == [
        (0, "READY", ""),
        (3, "READY", "Ada"),
        (9, "ABSENT", "Grace"),
    ]
    ada = inventory[1]
    assert (ada["calibrated"], ada["velocity_error"], ada["uptime_s"], ada["broken"]) == ("2026-11-20", 0.05, 60, True)
    assert set(ada) == set(COLUMNS)


def test_versions_that_differ_and_robots_that_ran_for_long_are_named():
    long_s = int(3600 * 2.0 * LOW_SHARE)
    rows = [
        make_row(0, firmware="v3.8", uptime=rospy.Duration(long_s - 1)),
        make_row(1, firmware="v3.8", uptime=rospy.Duration(long_s)),
        make_row(2, firmware="v3.7"),
    ]
    assert list_warnings(make_inventory(*rows), 2.0) == [
        "firmware differs: v3.7 (2); v3.8 (0, 1)",
        "hero_1 has run for 1.6 h of about 2 h: charge it",
    ]
    assert list_warnings(make_inventory(*rows[:2]), 0.0) == [], "the run time is not known"


def test_the_inventory_is_a_table_json_or_csv():
    inventory = make_inventory(make_row(3, firmware="v\x1b[2J"))
    table = format_inventory(inventory, "table", ["firmware differs"])
    assert table.splitlines()[0].split()[:3] == ["ID", "NAME", "STATE"] and table.endswith("firmware differs")
    assert format_inventory(make_inventory(make_row(0)), "table", []).splitlines()[1].startswith("0 ")
    assert table.replace("\n", "").isprintable()
    assert json.loads(format_inventory(inventory, "json", ["x"]))["warnings"] == ["x"]
    first, second = csv.DictReader(io.StringIO(format_inventory(inventory, "csv", [])))
    assert (first["id"], first["note"], second["state"]) == ("3", "squeaks", "ABSENT")


def test_values_of_declared_topics_are_columns_and_notes_stand_at_the_end():
    row = make_row(3)._replace(notes=FILE.robots[3], values={"battery": 3.7041})
    heading, first, second = format_table([row, make_row(0)], 300, 10, [BATTERY])
    assert "BATTERY" in heading and "3.70 V" in first and first.endswith("Ada, BROKEN, squeaks")
    assert first.index("3.70 V") == heading.index("BATTERY") == second.rindex("-")
    shown = make_row_dict(row)
    assert shown["values"] == {"battery": 3.7041} and shown["notes"]["name"] == "Ada"
