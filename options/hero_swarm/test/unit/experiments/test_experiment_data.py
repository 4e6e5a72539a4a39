"""Results as arrays, tables, figures and packs: the same numbers as in runs.csv, and the same bytes elsewhere."""

import csv
import io
import itertools
import tarfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hero_node import ProgramError
from hero_swarm.experiments import load, pack, report, runner, verify
from hero_swarm.experiments.computing import progress
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.reporting.figures import _choose_style
from hero_test.nonempty import nonempty

FILE = """\
behavior: lib/own.py
vary: {speed_m_s: [0.02, 0.1], robots: [2, 3]}
start: {kind: circle, gap_m: 0.1}
arena: ../field.yaml
time_s: 3
seeds: {from: 5, count: 3}
metrics: [lib/own.py:farthest, {time_until: {dispersion_ratio: 1.0}}]
until: {lib/own.py:farthest: ">= 0.25"}
record: {hz: 2}
compare: {metric: farthest, between: speed_m_s}
"""
OWN = """\
import numpy as np
from hero_swarm.behavior import Behavior

class Ahead(Behavior):
    speed_m_s = 0.1

    def step(self, sensed, memory, random):
        return self.speed_m_s + 0.1 * random.random(), 0.0, memory

def farthest(state):
    return np.hypot(state.poses[..., 0], state.poses[..., 1]).max(axis=1)
"""


@pytest.fixture(scope="module", name="folder")
def run_experiment(tmp_path_factory):
    base = tmp_path_factory.mktemp("data")
    (base / "work" / "lib").mkdir(parents=True)
    (base / "field.yaml").write_text("walls_m: [[[-2, -2], [2, -2], [2, 2], [-2, 2], [-2, -2]]]\n")
    (base / "work" / "lib" / "own.py").write_text(OWN)
    (base / "work" / "e.yaml").write_text(FILE)
    runner.run_experiment(runner.parse_options([str(base / "work" / "e.yaml"), "--jobs", "1", "--batch", "2"]))
    report.main([str(base / "work" / "e"), "--series", str(base / "series.csv")])
    return base / "work" / "e"


def read(path):
    with open(str(path), newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_arrays_hold_what_the_table_says(folder):
    results = load(str(folder))
    assert results.cells[1] == {"speed_m_s": 0.02, "robots": 3} and results.labels[1] == "speed_m_s 0.02, robots 3"
    assert results.find(robots=3) == [1, 3] and results.find(robots=3, speed_m_s=0.1) == [3] and not results.find(x=1)
    assert results.seeds.tolist() == [5, 6, 7] and list(results.metrics) == list(read(folder / "runs.csv")[0])[4:-1]
    for row in nonempty(read(folder / "runs.csv")):
        cell = results.find(robots=int(row["robots"]), speed_m_s=float(row["speed_m_s"]))[0]
        for name, values in results.metrics.items():
            assert values[cell, int(row["seed"]) - 5] == float(row[name])


@pytest.mark.slow
def test_series_and_poses_end_with_their_runs(folder):
    results = load(str(folder))
    farthest, poses = results.series["farthest"], results.read_poses()
    assert farthest.shape == (4, 3, 4) and results.times_s.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert poses.shape == (4, 3, 7, 3, 3) and results.pose_times_s[-1] == 3.0
    assert np.isnan(poses[0, :, :, 2]).all() and np.isfinite(poses[1, :, 0]).all(), "cell 1 has two robots"
    ends = np.isfinite(farthest).sum(axis=2) - 1
    assert ends.min() < 3, "some runs ended earlier, or the test shows nothing"
    for cell, seed in itertools.product(range(4), range(3)):
        last = farthest[cell, seed, ends[cell, seed]]
        assert last == pytest.approx(results.metrics["farthest"][cell, seed], rel=1e-6)
        assert np.nanmax(np.hypot(*poses[cell, seed, 0, :, :2].T)) == pytest.approx(farthest[cell, seed, 0], rel=1e-6)


@pytest.mark.slow
def test_the_index_names_the_file_and_place_of_each_run(folder):
    rows = read(folder / "series.csv")
    named = [(int(row["cell"]), int(row["seed"])) for row in rows]
    assert named == list(itertools.product(range(1, 5), (5, 6, 7)))
    results = load(str(folder))
    for row in nonempty(rows):
        own = np.load(str(folder / row["metrics"]))[:, int(row["run"]), 1]
        np.testing.assert_array_equal(own, results.series["farthest"][int(row["cell"]) - 1, int(row["seed"]) - 5])
        assert np.load(str(folder / row["poses"])).shape[1] in (1, 2)


@pytest.mark.slow
def test_the_table_over_time_has_a_row_for_each_run_and_second(folder, tmp_path, monkeypatch):
    rows = read(folder.parent.parent / "series.csv")
    assert len(rows) == 4 * 3 * 4 and list(rows[0]) == [
        "speed_m_s",
        "robots",
        "seed",
        "time_s",
        "dispersion_ratio",
        "farthest",
    ]
    assert [row["time_s"] for row in rows[:4]] == ["0.0", "1.0", "2.0", "3.0"] and rows[4]["seed"] == "6"
    mixed = load(str(folder))
    mixed.cells[0] = {**mixed.cells[0], "speed_m_s": "slow"}
    assert set(map(type, mixed.list_columns()["speed_m_s"])) == {str}, "a column of Parquet has one type"
    with pytest.raises(ExperimentError, match="a.txt: a table ends with .csv or .parquet"):
        load(str(folder)).write_table(str(tmp_path / "a.txt"))
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(ProgramError, match="pyarrow is missing"):
        load(str(folder)).write_table(str(tmp_path / "a.parquet"))


@pytest.mark.slow
def test_figures_are_files_with_the_same_bytes_in_each_report(folder, capsys):
    before = {path.name: path.read_bytes() for path in (folder / "figures").iterdir()}
    report.main([str(folder)])
    told = capsys.readouterr().out
    assert {path.name: path.read_bytes() for path in (folder / "figures").iterdir()} == before
    assert {name.split(".")[0] for name in before} >= {"farthest", "farthest_map", "farthest_over_time"}
    assert before["farthest_map.pdf"].startswith(b"%PDF") and b"<svg" in before["farthest_map.svg"]
    method = "Each of 4 combinations of speed_m_s and robots was run with the seeds 5 to 7"
    assert method in told and method in (folder / "report.html").read_text()
    assert "percentile bootstrap intervals (9999 resamples); pairs of the same seed" in told


def test_each_cell_has_its_own_color_or_line_style():
    styles = [str(_choose_style(index)) for index in range(100)]
    assert len(set(styles)) == 100


@pytest.mark.slow
def test_a_pack_is_computed_again_elsewhere_with_the_same_bytes(folder, tmp_path, capsys, monkeypatch):
    packed = tmp_path / "p.tar.gz"
    pack.main([str(folder), "--out", str(packed)])
    monkeypatch.chdir(tmp_path)
    verify.main([str(packed), "--jobs", "1"])
    assert "p.tar.gz: the same bytes in all 12 runs" in capsys.readouterr().out

    contents = pack.collect(str(folder))
    assert b"farthest" in contents["files/work/lib/own.py"] and b"walls_m" in contents["files/field.yaml"]

    def compute(command, **options):
        out = Path(command[command.index("--out") + 1])
        out.mkdir()
        (out / "runs.csv").write_bytes(contents["runs.csv"])
        return SimpleNamespace(returncode=0)

    monkeypatch.setattr(verify.subprocess, "run", compute)
    other, more = contents["runs.csv"].replace(b"simulated,", b"simulated,1", 1), contents["runs.csv"] + b"one more\n"
    for changed, words in ((other, "1 of 13 lines, first in line 2"), (more, "0 of 14 lines, first in line 14")):
        write_tar(packed, {**contents, "runs.csv": changed})
        with pytest.raises(ExperimentError, match="runs.csv differs in " + words):
            verify.main([str(packed), "--jobs", "1"])


def write_tar(path, contents):
    with tarfile.open(str(path), "w:gz") as packed:
        for name, content in contents.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            packed.addfile(member, io.BytesIO(content))


def test_what_is_no_pack_is_refused_and_writes_nowhere_else(tmp_path):
    path = tmp_path / "p.tar.gz"
    for contents, words in (
        ({"../evil": b""}, "'../evil' is no file inside of the pack"), ({"/evil": b""}, "is no file inside"),
        ({"runs.csv": b""}, "no pack of an experiment"),
    ):  # fmt: skip
        write_tar(path, contents)
        with pytest.raises(ExperimentError, match=words):
            verify.main([str(path)])
    path.write_bytes(b"no tar")
    for wrong in (path, tmp_path / "none.tar.gz"):
        with pytest.raises(ExperimentError, match="cannot be read"):
            verify.main([str(wrong)])


@pytest.mark.slow
def test_only_whole_results_of_this_code_are_packed(folder, tmp_path):
    own = folder.parent / "lib" / "own.py"
    own.write_text(OWN + "# edited\n")
    with pytest.raises(ExperimentError, match="computed by other code"):
        pack.main([str(folder), "--out", str(tmp_path / "p.tar.gz")])
    own.write_text(OWN)
    batch = sorted((folder / "batches").iterdir())[0]
    batch.rename(tmp_path / batch.name)
    with pytest.raises(ExperimentError, match=": [12] runs are missing: compute them with run"):
        pack.collect(str(folder))
    (tmp_path / batch.name).rename(batch)


def test_a_file_is_told_seldom_how_far_a_run_is(capsys):
    with progress.show_progress(16, 4, "design") as shown:
        assert shown.mininterval == progress.REPORT_S
        shown.set_postfix_str("best 3", refresh=False)
        for _ in range(6):
            shown.update(2)
    first, last = capsys.readouterr().err.strip().split("\r")
    assert first.startswith("design:  25%") and "4/16" in first
    assert last.startswith("design: 100%") and "16/16" in last and "best 3" in last


def test_a_terminal_is_told_at_once_how_far_a_run_is(monkeypatch):
    monkeypatch.setattr(progress.sys.stderr, "isatty", lambda: True)
    with progress.show_progress(2, 0) as shown:
        assert shown.mininterval < 1.0
