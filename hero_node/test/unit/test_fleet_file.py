"""fleet.yaml: notes on robots and topics to show, with file, line and remedy for each mistake."""

import math

import pytest

from hero_node.files import (
    EntryError,
    ExtraTopic,
    FleetFile,
    RobotNotes,
    name_fleet_file,
    read_entries,
    read_fleet_file,
)

TEXT = """\
robots:
  - {id: 3, name: Ada, note: squeaks, broken: true, place: shelf 2, owner: Kim}
  - {id: 10}
topics:
  - {name: battery, topic: battery, type: std_msgs/Float32, field: data, unit: V}
run_time_h: 2.5
"""


def write(tmp_path, text):
    path = tmp_path / "fleet.yaml"
    path.write_text(text)
    return str(path)


def test_a_file_tells_of_robots_topics_and_run_time(tmp_path):
    ada = RobotNotes("Ada", "squeaks", True, "shelf 2", "Kim")
    battery = ExtraTopic("battery", "battery", "std_msgs/Float32", "data", "V")
    assert read_fleet_file(write(tmp_path, TEXT)) == FleetFile({3: ada, 10: RobotNotes()}, (battery,), 2.5)
    assert ada.text == "Ada, BROKEN, squeaks" and RobotNotes().text == ""


def test_an_error_cannot_draw_on_the_terminal():
    assert str(EntryError("a.yaml, line 1: name is \x1b[2J\ntwo lines")).isprintable()


def test_robots_are_known_by_any_number_that_a_robot_can_have(tmp_path):
    assert list(read_fleet_file(write(tmp_path, "robots: [{id: 0}, {id: 1000000000}]")).robots) == [0, 10**9]
    with pytest.raises(EntryError, match="id is 1000000001, but must be a whole number from 0 to 1000000000"):
        read_fleet_file(write(tmp_path, "robots: [{id: 1000000001}]"))


def test_a_battery_lasts_up_to_a_thousand_hours(tmp_path):
    assert [read_fleet_file(write(tmp_path, f"run_time_h: {hours}")).run_time_h for hours in (0, 1000)] == [0.0, 1000.0]
    with pytest.raises(EntryError, match="run_time_h is 1000.1, but must be a number from 0 to 1000 h"):
        read_fleet_file(write(tmp_path, "run_time_h: 1000.1"))


def test_without_a_file_or_with_an_empty_one_there_are_no_notes(tmp_path, monkeypatch):
    assert read_fleet_file(str(tmp_path / "none.yaml")) == read_fleet_file(write(tmp_path, "")) == FleetFile()
    monkeypatch.setenv("ROS_HOME", str(tmp_path))
    assert name_fleet_file() == str(tmp_path / "fleet.yaml")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("robots: [{name: Ada}]", "id"),
        ("robots: [{id: -1}]", "id"),
        ("robots:\n- id: 3\n  broken: perhaps", "fleet.yaml:3|line 3"),
        ("robots: [{id: 3, colour: red}]", "colour"),
        ("topics: [{name: battery}]", "topic"),
        ("run_time_h: -1", "run_time_h"),
        ("robot: []", "robot"),
        ("- 3", "must hold names and values"),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path, text, words):
    with pytest.raises(EntryError, match=words):
        read_fleet_file(write(tmp_path, text))


def test_lists_hold_what_they_must_and_may_be_many():
    text = "none: []\ntext: abc\npair: [1, 2.5]\nrows: [%s]\n" % ", ".join(["[1]"] * 100)
    content = read_entries(text, "a.yaml", "pair: [1, 2]").mapping()
    assert content["pair"].numbers(2, 0.0, 3.0, "two numbers") == [1.0, 2.5] and len(content["rows"].entries()) == 100
    for line, name in enumerate(("none", "text"), 1):
        with pytest.raises(EntryError, match=f"a.yaml, line {line}: .*not an empty one"):
            content[name].entries()
        with pytest.raises(EntryError, match=f"a.yaml, line {line}: .*two numbers"):
            content[name].numbers(2, 0.0, 3.0, "two numbers")


def test_numbers_may_be_written_with_an_exponent_as_yaml_takes_for_text():
    entries = read_entries("{far: 1e3, near: soon, wide: 2e3}", "a.yaml", "").value
    assert entries["far"].number(0.0, 1000.0, "m") == 1000.0
    for name, shown in (("near", "'soon'"), ("wide", "'2e3'")):
        with pytest.raises(
            EntryError, match=f"a.yaml, line 1: {name} is {shown}, but must be a number from 0 to 1000 m"
        ):
            entries[name].number(0.0, 1000.0, "m")
    unknown = read_entries("far: .nan", "a.yaml", "").value["far"]
    assert math.isnan(unknown.number(0.0, 1.0, "m", may_be_nan=True))
    with pytest.raises(EntryError, match="far is nan, but must be a number from 0 to 1 m"):
        unknown.number(0.0, 1.0, "m")


def test_a_text_may_be_as_long_and_as_deep_as_can_be_read_and_no_more():
    for text, longer, words in (
        ("a: " + "[" * 19 + "]" * 19, "a: " + "[" * 20 + "]" * 20, "a.yaml, line 1: more than 20 levels"),
        ("a: 1 #".ljust(500_000, "x"), "a: 1 #".ljust(500_001, "x"), "a.yaml: longer than 500000 characters"),
    ):
        assert list(read_entries(text, "a.yaml", "").value) == ["a"]
        with pytest.raises(EntryError, match=words):
            read_entries(longer, "a.yaml", "")


def test_what_is_no_mapping_is_refused_with_an_example():
    entries = read_entries("{plain: 3, list: [1]}", "a.yaml", "").value
    for name, shown in (("plain", "3"), ("list", "a list")):
        with pytest.raises(EntryError, match=f"{name} is {shown}, but must be a mapping such as {{x: ...}}"):
            entries[name].mapping(("x", "y"))


@pytest.mark.parametrize(("value", "shown"), [("5", "5"), ("''", "''"), ("[a]", "a list")])
def test_what_is_no_text_is_refused(value, shown):
    with pytest.raises(EntryError, match=f"a.yaml, line 1: name is {shown}, but must be a text"):
        read_entries("{name: %s}" % value, "a.yaml", "").value["name"].text()
