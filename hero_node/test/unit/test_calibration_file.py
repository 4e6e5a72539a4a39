"""Files of calibrations: each is read, or refused in one line that does not keep the others from being read."""

import os

import pytest

from hero_node.files import calibration_file
from hero_node.files.calibration_file import (
    RESULTS,
    SETTINGS,
    CalibrationFileError,
    list_files,
    read_calibration,
    read_calibrations,
)

GOOD = "robot: hero_7\nwheels_m: [0.049, 0.0495, 0.0641]\n"

DAMAGED = {
    "empty": b"",
    "binary": b"\xff\x00\x01",
    "no YAML": b"{",
    "cut off": b"robot: hero_3\nwheels_m: [0.049, 0.0",
    "a list": b"- 1",
    "too deep": b"[" * 1000,
    "of a future version": b"robot: hero_3\nformat: 2\nwheels_m: {left: 0.049, right: 0.0495, distance: 0.0641}\n",
    "a number beyond its limits": b"robot: hero_3\nwheels_m: [49, 49.5, 63]\n",
    "an unknown number of wheels": b"robot: hero_3\nwheels_m: [0.049, .nan, 0.06]\n",
    "an unknown dead zone": b"robot: hero_3\ndead_zones_us: [.nan, 1, 2, 3]\n",
    "another model": b"robot: hero_3\nmodel: turtle\n",
    "ticks that are none": b"robot: hero_3\nticks_per_turn: 0.9\n",
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=list(DAMAGED))
def test_a_damaged_file_is_told_of_and_the_others_are_read(tmp_path, content):
    (tmp_path / "hero_3.yaml").write_bytes(content)
    (tmp_path / "hero_7.yaml").write_text(GOOD)
    calibrations = read_calibrations(str(tmp_path))
    assert calibrations.found["hero_7"].values == {"wheels_m": [0.049, 0.0495, 0.0641]}
    assert list(calibrations.found) == ["hero_7"] and list(calibrations.problems) == ["hero_3"]
    problem = calibrations.problems["hero_3"]
    assert problem.startswith(str(tmp_path / "hero_3.yaml")) and problem.isprintable()
    assert problem.endswith("; correct the file, or move it away")


def test_what_is_no_file_or_cannot_be_opened_is_told_of(tmp_path, monkeypatch):
    (tmp_path / "hero_1.yaml").mkdir()
    os.mkfifo(str(tmp_path / "hero_2.yaml"))
    (tmp_path / "hero_3.yaml").symlink_to(tmp_path / "gone")
    (tmp_path / "hero_4.yaml").write_text("robot: hero_4\n")
    (tmp_path / "hero_7.yaml").write_text(GOOD)
    os_open = os.open

    def refuse(path, *flags):
        if path.endswith("hero_4.yaml"):
            raise PermissionError(13, "Permission denied", path)
        return os_open(path, *flags)

    monkeypatch.setattr(os, "open", refuse)
    calibrations = read_calibrations(str(tmp_path))
    assert list(calibrations.found) == ["hero_7"]
    reasons = ("Is a directory", "it is a pipe", "No such file", "Permission denied")
    for number, reason in enumerate(reasons, 1):
        assert "hero_%d.yaml: cannot be read: %s" % (number, reason) in calibrations.problems["hero_%d" % number]


def test_a_problem_belongs_to_the_robot_that_the_file_names(tmp_path):
    (tmp_path / "hero_3.yaml").write_text("robot: hero_05\nwheels_m: wide\n")
    (tmp_path / "hero_new.yaml").write_text("{")
    assert set(read_calibrations(str(tmp_path)).problems) == {"hero_5", "hero_new"}


def test_of_several_files_of_one_robot_none_is_used(tmp_path):
    for name in ("hero_3.yaml", "hero_7.yaml", "hero_7_old.yaml"):
        (tmp_path / name).write_text(GOOD.replace("hero_7", name[:6]))
    calibrations = read_calibrations(str(tmp_path))
    assert list(calibrations.found) == ["hero_3"]
    assert "hero_7_old.yaml: another file is for hero_7, too" in calibrations.problems["hero_7"]


def test_a_folder_may_be_missing_and_one_that_cannot_be_read_is_told_of(tmp_path, monkeypatch):
    assert read_calibrations("") == read_calibrations(str(tmp_path / "none")) == ({}, {})

    def refuse(folder):
        raise PermissionError(13, "Permission denied", folder)

    monkeypatch.setattr(calibration_file.os, "listdir", refuse)
    assert read_calibrations(str(tmp_path)).problems[""].startswith(f"{tmp_path} cannot be read: Permission denied; ")


def test_files_are_listed_without_those_that_newer_ones_replaced(tmp_path):
    for name in ("hero_1.yaml", "hero_0.yaml", "hero_0.previous.yaml", "notes.txt", "arena.yaml"):
        (tmp_path / name).write_text("")
    assert [os.path.basename(path) for path in list_files(str(tmp_path))] == ["hero_0.yaml", "hero_1.yaml"]
    assert list_files(str(tmp_path / "nothing")) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("motor_centers_us: [1511, 9000]", "motor_centers_us is 9000, but must be a number from 1200 to 1800;"),
        ("motor_centers_us: [1511]", "motor_centers_us is a list, but must be 2 numbers"),
        ("motor_centers_us: 2026-11-21", r"is datetime.date\(2026"),
        ("motor_centers_us: [2026-11-21, 1500]", r"is datetime.date\(2026"),
        ("motor_centers_us: [1%s, 1500]" % ("0" * 400), "is 1000"),
        ("motor_centers_us: [1%s, 1500]" % ("0" * 5000), "motor_centers_us: Exceeds|is 1000"),
        ("motor_centers_us: [true, 1500]", "is True"),
        ("motor_centers_us: [!!int '', 1500]", "motor_centers_us: "),
        ("motor_centers_us: [2026-13-45, 1500]", "motor_centers_us: month must be"),
        ("velocity_gains: [1.0e+9, 1, 1, 1, 1, 1]", r"velocity_gains is 1000000000\.0, but must be a number"),
        ("velocity_gains: [.nan, 1, 1, 1, 1, 1]", "is nan"),
        ("velocity_gains: [nan, 1, 1, 1, 1, 1]", "is 'nan'"),
        ("velocity_gains: [-.inf, 1, 1, 1, 1, 1]", "is -inf"),
        ("velocity_gains: [[1], 1, 1, 1, 1, 1]", "is a list"),
        ("infrared_counts_m2: {a: 1}", "infrared_counts_m2 is a mapping, but must be 8 numbers"),
        ("velocity_errors: &a [*a, *a]", "anchors cannot be used"),
        ("velocity_errors: [0.1, .inf]", "is inf"),
        ("model: turtle", "model is 'turtle', but must be one of: hero, hero_plus"),
        ("ticks_per_turn: 0.9", "ticks_per_turn is 0.9, but must be a number from 1 to"),
        ("color: red", "unknown key 'color'"),
        ("robot: hero_4", "'robot' appears twice"),
        ("? [a]\n: 1", "a name must be a text"),
    ],
)
def test_a_wrong_file_is_refused_with_line_key_and_value(change, words, tmp_path):
    path = tmp_path / "hero_3.yaml"
    path.write_text("robot: hero_3\n" + change + "\n")
    with pytest.raises(CalibrationFileError, match=words) as caught:
        read_calibration(str(path))
    assert str(caught.value).startswith(f"{path}, line 2: ") and str(caught.value).isprintable()


def test_numbers_at_their_limits_are_taken_and_beyond_them_refused(tmp_path):
    path = tmp_path / "hero_3.yaml"
    limits = {
        "motor_centers_us": (2, 1200, 1800),
        "velocity_gains": (6, 0, 100000),
        "infrared_counts_m2": (8, 0.001, 100),
        "wheels_m": (3, 0.01, 1),
        "dead_zones_us": (4, 0, 3000),
        "velocity_errors": (2, 0, 100),
        "range_errors_before_m": (8, -10, 10),
        "range_errors_after_m": (8, -10, 10),
    }
    assert set(limits) == {*SETTINGS, *RESULTS}
    for key, (count, low, high) in limits.items():
        for number, allowed in ((low, True), (high, True), (low - 1e-6, False), (high + 1e-6, False)):
            path.write_text("robot: hero_3\n%s: %s\n" % (key, [number] * count))
            if allowed:
                assert read_calibration(str(path)).values[key] == [number] * count
            else:
                with pytest.raises(CalibrationFileError, match=key + " is .*, but must be"):
                    read_calibration(str(path))


def test_ticks_per_turn_are_one_to_a_million_or_none(tmp_path):
    path = tmp_path / "hero_3.yaml"
    for text, ticks in (("1", 1.0), ("1000000", 1e6), ("null", None)):
        path.write_text(f"robot: hero_3\nticks_per_turn: {text}\n")
        assert read_calibration(str(path)).others == {"ticks_per_turn": ticks}
    path.write_text("robot: hero_3\nticks_per_turn: 1000000.1\n")
    with pytest.raises(CalibrationFileError, match="ticks_per_turn is 1000000.1, but must be a number from 1 to 1e"):
        read_calibration(str(path))


def test_a_date_cannot_draw_on_the_terminal(tmp_path):
    (tmp_path / "hero_3.yaml").write_text('robot: hero_3\ndate: "\\e[2J"\n')
    assert read_calibration(str(tmp_path / "hero_3.yaml")).date.isprintable()


@pytest.mark.parametrize("robot", ["wall_e", "hero_", "hero_-1", "hero_" + "9" * 5000, "[hero_3]", "hero_\u0663"])
def test_a_file_of_no_robot_is_refused(robot, tmp_path):
    (tmp_path / "x.yaml").write_text("robot: %s\n" % robot, encoding="utf-8")
    with pytest.raises(CalibrationFileError, match=r"x\.yaml, line 1: robot is .*, but must be hero_N"):
        read_calibration(str(tmp_path / "x.yaml"))


def test_a_file_that_is_no_calibration_is_refused(tmp_path):
    for content, words in (
        ("- 1\n", ": must hold names and values, such as robot: hero_3;"),
        ("", ": must hold names and values"),
        ("a\n", ": must hold names and values"),
        ("\x00", ": not YAML: "),
        ("robot: hero_3\ndate: [", ", line 2: not YAML: "),
        ("date: today\n", ", line 1: robot is missing"),
    ):
        (tmp_path / "x.yaml").write_text(content)
        with pytest.raises(CalibrationFileError, match=r"x\.yaml" + words):
            read_calibration(str(tmp_path / "x.yaml"))
    with pytest.raises(CalibrationFileError, match="No such file"):
        read_calibration(str(tmp_path / "y.yaml"))
    with pytest.raises(CalibrationFileError, match="Is a directory"):
        read_calibration(str(tmp_path))


@pytest.mark.parametrize("key", ["velocity_errors", "range_errors_before_m", "range_errors_after_m"])
def test_errors_before_and_after_may_be_unknown(tmp_path, key):
    path = tmp_path / "hero_7.yaml"
    length = RESULTS[key].length
    path.write_text(f"robot: hero_7\n{key}: [{', '.join(['.nan'] * length)}]\n")
    assert len(read_calibration(str(path)).values[key]) == length
