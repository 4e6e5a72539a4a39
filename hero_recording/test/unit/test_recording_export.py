"""Tables of a recording: columns with units, rows that are right, nothing half, Parquet with the real library."""

import csv
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from made_up_bag import DELAY_S, START_S, write_bag

from hero_recording import export, tables
from hero_recording.errors import RecordingError

ROOT = Path(__file__).resolve().parents[3]
OPTIONAL = ROOT / ".work" / "optional"
PYARROW = ("pyarrow==17.0.0; python_version<'3.13'", "pyarrow==18.1.0; python_version>='3.13'")
"""The newest ones for Python 3.8, and for what it does not know."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp("bags") / "two.bag"
    write_bag(path, robot_ids=(0, 3), seconds=4.0)
    return path


@pytest.fixture(scope="module")
def python_with_pyarrow():
    """An interpreter that has pyarrow on top of all that this one has; from PyPI, once."""
    python = OPTIONAL / "bin" / "python"
    if not (OPTIONAL / "ready").exists():
        subprocess.run(
            [sys.executable, "-m", "venv", "--clear", "--system-site-packages", str(OPTIONAL)], check=True
        )
        environment = dict(os.environ)
        if Path("/etc/ssl/certs/ca-certificates.crt").exists():
            environment.setdefault("PIP_CERT", "/etc/ssl/certs/ca-certificates.crt")
        subprocess.run(
            [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PYARROW],
            check=True,
            env=environment,
        )
        (OPTIONAL / "ready").write_text("")
    return python


def run_export(capsys, *arguments):
    export.run(export.parse_options([str(argument) for argument in arguments]))
    return capsys.readouterr().out


def read_csv(path):
    with open(str(path), encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_folder_for_each_robot_holds_a_table_for_each_kind(bag, tmp_path, capsys):
    output = run_export(capsys, bag, "--out", tmp_path / "out")
    kinds = {"odometry", "ground_truth", "encoder", "proximity", "velocity_command", "status"}
    for name in ("hero_0", "hero_3"):
        assert {path.name for path in (tmp_path / "out" / name).iterdir()} == {
            kind + ".csv" for kind in kinds
        }
    assert "2 robots, 12 tables" in output
    assert not (tmp_path / "out.part").exists()


def test_rows_are_what_was_recorded_with_time_and_stamp(bag, tmp_path, capsys):
    run_export(capsys, bag, "--out", tmp_path / "out")
    rows = read_csv(tmp_path / "out" / "hero_3" / "odometry.csv")
    assert len(rows) == 117
    first, last = rows[0], rows[-1]
    assert list(first) == ["time_s", "stamp_s", "x_m", "y_m", "yaw_rad", "linear_m_s", "turn_rad_s"]
    assert float(first["stamp_s"]) == START_S
    assert float(first["time_s"]) == pytest.approx(START_S + DELAY_S, abs=1e-6)
    assert float(last["linear_m_s"]) == 0.1
    assert float(last["yaw_rad"]) == pytest.approx(0.5 * (float(last["stamp_s"]) - START_S - 1.1), abs=1e-6)
    scan = read_csv(tmp_path / "out" / "hero_3" / "proximity.csv")[0]
    assert float(scan["behind_m"]) == pytest.approx(0.1)
    assert float(scan["behind_right_m"]) == math.inf
    assert float(scan["right_m"]) == -math.inf
    assert math.isnan(float(scan["ahead_right_m"]))
    assert read_csv(tmp_path / "out" / "hero_3" / "status.csv")[0]["state"] == "ready"


def test_robots_and_tables_can_be_chosen(bag, tmp_path, capsys):
    run_export(capsys, bag, "--out", tmp_path / "out", "--robots", "3", "--tables", "odometry,status")
    files = sorted(str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*.csv"))
    assert files == ["hero_3/odometry.csv", "hero_3/status.csv"]


def test_parquet_holds_the_same_rows_with_units_in_its_fields(bag, tmp_path, python_with_pyarrow):
    code = "import sys; from hero_recording.export import main; main()"
    out = tmp_path / "out"
    command = [str(python_with_pyarrow), "-c", code, str(bag), "--out", str(out), "--format", "csv,parquet"]
    subprocess.run(command, check=True)
    rows = read_csv(out / "hero_0" / "odometry.csv")
    reader = (
        "import sys, json, pyarrow.parquet as parquet\n"
        "table = parquet.read_table(sys.argv[1])\n"
        "units = {field.name: field.metadata[b'unit'].decode() for field in table.schema}\n"
        "print(json.dumps([units, table.to_pydict()]))\n"
    )
    for kind in ("odometry", "status"):
        path = out / "hero_0" / (kind + ".parquet")
        output = subprocess.run(
            [str(python_with_pyarrow), "-c", reader, str(path)], check=True, stdout=subprocess.PIPE
        ).stdout.decode()
        units, columns = json.loads(output)
        rows = read_csv(out / "hero_0" / (kind + ".csv"))
        assert units["time_s"] == "s"
        for column in tables.TABLES[kind].columns:
            assert units[column.name] == column.unit
            written = [row[column.name] for row in rows]
            if column.kind == tables.NUMBER:
                assert columns[column.name] == pytest.approx([float(value) for value in written], abs=1e-6)
            else:
                assert columns[column.name] == written


def test_parquet_without_its_library_is_refused_with_the_remedy(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(RecordingError, match="pip install pyarrow.*--format csv"):
        run_export(capsys, bag, "--out", tmp_path / "out", "--format", "parquet")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_exists_is_not_written_into(bag, tmp_path, capsys):
    (tmp_path / "out").mkdir()
    with pytest.raises(RecordingError, match="out exists already"):
        run_export(capsys, bag, "--out", tmp_path / "out")


def test_an_export_that_breaks_off_leaves_nothing_half(bag, tmp_path, capsys, monkeypatch):
    def break_off(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(tables, "read_rows", break_off)
    with pytest.raises(KeyboardInterrupt):
        run_export(capsys, bag, "--out", tmp_path / "out")
    assert not list(tmp_path.iterdir())


def test_rows_wait_in_batches_and_all_of_them_are_written(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("hero_recording.table_files.BATCH_ROWS", 10)
    run_export(capsys, bag, "--out", tmp_path / "out", "--tables", "odometry")
    assert len(read_csv(tmp_path / "out" / "hero_0" / "odometry.csv")) == 117


def test_all_columns_and_units_can_be_listed_and_names_carry_them(capsys):
    output = run_export(capsys, "--columns")
    for kind, table in tables.TABLES.items():
        assert kind in output
        for column in table.columns:
            assert column.name in output
            if column.unit in ("m", "s", "rad", "us"):
                assert column.name.endswith("_" + column.unit)


def test_wrong_options_are_named(bag, capsys):
    for arguments in (["--format", "xls"], ["--tables", "cake"], ["--robots", "-3"], ["--format", ","]):
        with pytest.raises(SystemExit) as caught:
            export.parse_options([str(bag), *arguments])
        assert caught.value.code == 2
        assert arguments[0] in capsys.readouterr().err
