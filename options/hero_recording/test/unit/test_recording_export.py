"""Tables of an export: columns with units, correct rows, no incomplete folder."""

import csv
import math
from unittest.mock import create_autospec

import pytest
import rosbag
from synthetic_bag import DELAY_S, START_S, make_localized, write_bag

from hero_node.files import ExtraTopic, FleetFile
from hero_recording import export
from hero_recording.bags.tables import declare_tables
from hero_recording.errors import RecordingError


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "two.bag"
    write_bag(path, robot_ids=(0, 3), seconds=4.0)
    return path


def run_export(capsys, *arguments):
    export.main([str(argument) for argument in arguments])
    return capsys.readouterr().out


def read_csv(path):
    with open(str(path), encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_each_robot_has_a_folder_with_a_table_for_each_kind(bag, tmp_path, capsys):
    output = run_export(capsys, bag, "--out", tmp_path / "out")
    kinds = {"odometry", "ground_truth", "encoder", "proximity", "velocity_command", "status"}
    for name in ("hero_0", "hero_3"):
        assert {path.name for path in (tmp_path / "out" / name).iterdir()} == {kind + ".csv" for kind in kinds}
    assert "2 robots, 12 tables" in output
    written = [read_csv(path) for path in (tmp_path / "out").rglob("*.csv")]
    assert len(written) == 12 and f"12 tables, {sum(map(len, written))} rows\n" in output
    assert not (tmp_path / "out.part").exists()


def test_rows_hold_what_was_recorded_with_time_and_stamp(bag, tmp_path, capsys):
    run_export(capsys, bag, "--out", tmp_path / "out")
    rows = read_csv(tmp_path / "out" / "hero_3" / "odometry.csv")
    assert len(rows) == 117
    first, last = rows[0], rows[-1]
    assert list(first) == ["time_s", "stamp_s", "x_m", "y_m", "yaw_rad", "linear_m_s", "angular_rad_s"]
    assert float(first["stamp_s"]) == START_S
    assert float(first["time_s"]) == pytest.approx(START_S + DELAY_S, abs=1e-6)
    assert float(last["linear_m_s"]) == 0.1
    assert float(last["yaw_rad"]) == pytest.approx(0.5 * (float(last["stamp_s"]) - START_S - 1.1), abs=1e-6)
    scan = read_csv(tmp_path / "out" / "hero_3" / "proximity.csv")[0]
    assert float(scan["rear_m"]) == pytest.approx(0.1)
    assert float(scan["rear_right_m"]) == math.inf
    assert float(scan["right_m"]) == -math.inf
    assert math.isnan(float(scan["front_right_m"]))
    assert read_csv(tmp_path / "out" / "hero_3" / "status.csv")[0]["state"] == "ready"


def test_poses_by_localization_have_a_table_with_their_deviations(tmp_path, capsys):
    with rosbag.Bag(str(tmp_path / "poses.bag"), "w") as bag:
        pose = make_localized(START_S, 1.5, -0.5, 0.25)
        bag.write("/hero_3/pose", pose, pose.header.stamp)
    run_export(capsys, tmp_path / "poses.bag", "--out", tmp_path / "out")
    (row,) = read_csv(tmp_path / "out" / "hero_3" / "pose.csv")
    assert [float(row[name]) for name in ("stamp_s", "x_m", "y_m", "yaw_rad")] == [START_S, 1.5, -0.5, 0.25]
    assert float(row["x_sd_m"]) == float(row["y_sd_m"]) == pytest.approx(0.002)


def test_robots_can_be_selected(bag, tmp_path, capsys):
    run_export(capsys, bag, "--out", tmp_path / "out", "--robots", "3")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["hero_3"]
    assert (tmp_path / "out" / "hero_3" / "status.csv").is_file()


def test_a_path_that_exists_or_cannot_be_written_is_refused(bag, tmp_path, capsys):
    (tmp_path / "out").write_text("")
    with pytest.raises(RecordingError, match="out exists already"):
        run_export(capsys, bag, "--out", tmp_path / "out")
    with pytest.raises(NotADirectoryError, match="out/x.part"):
        run_export(capsys, bag, "--out", tmp_path / "out" / "x")


def test_an_interrupted_export_leaves_nothing_behind(bag, tmp_path, capsys, monkeypatch):
    def break_off(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(export, "read_rows", break_off)
    with pytest.raises(KeyboardInterrupt):
        run_export(capsys, bag, "--out", tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_each_message_is_a_row(bag, tmp_path, capsys):
    run_export(capsys, bag, "--out", tmp_path / "out")
    for robot in ("hero_0", "hero_3"):
        assert len(read_csv(tmp_path / "out" / robot / "odometry.csv")) == 117


def test_topics_of_the_fleet_are_exported_beside_the_first_bag(tmp_path, capsys, monkeypatch):
    topic = ExtraTopic("charge", "battery", "std_msgs/Float32", "data", "V")
    declare = create_autospec(declare_tables)
    monkeypatch.setattr(export, "declare_tables", declare)
    monkeypatch.setattr(export, "read_fleet_file", lambda: FleetFile(topics=(topic,)))
    monkeypatch.chdir(tmp_path)
    write_bag(tmp_path / "day.bag", robot_ids=(3,), seconds=1.0)
    assert run_export(capsys, "day.bag").startswith(f"{tmp_path / 'day'}: 1 robots, ")
    declare.assert_called_once_with((topic,))
    assert (tmp_path / "day" / "hero_3").is_dir()


def test_wrong_options_of_export_are_refused_by_name(bag, capsys):
    with pytest.raises(SystemExit) as caught:
        export.parse_options([str(bag), "--robots", "-3"])
    assert caught.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith("export: error: argument --robots: ")
