"""Whole experiments: the same table however they are computed, resumed and killed, and errors that name their place."""

import csv
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import load_arena
from hero_swarm import metrics, show
from hero_swarm.experiments import report, results_folder, runner
from hero_swarm.experiments.computing import set_up
from hero_swarm.experiments.computing.starts import place_all
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import Start
from hero_swarm.experiments.results_folder import METRICS_ENDING, POSES_ENDING, Run, read_results
from hero_swarm.trial import OPEN
from hero_test.nonempty import nonempty

FILE = """\
behavior: aggregation
vary: {robots: [3, 5], errors: [perfect, default]}
start: {kind: uniform, cover: 0.05}
time_s: 3
seeds: {from: 11, count: 5}
metrics: [dispersion, {mean_of_last_s: {nearest_neighbor: 2}}, {time_until: {dispersion_ratio: 1.0}}]
record: {hz: 2}
compare: {metric: dispersion, between: errors}
"""


def write(folder, text=FILE):
    path = folder / "e.yaml"
    path.write_text(text)
    return path


def run(path, *options):
    runner.run_experiment(runner.parse_options([str(path), "--jobs", "1", *options]))
    return path.with_suffix("")


def read_table(folder):
    with open(str(folder / "runs.csv")) as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return run(write(tmp_path_factory.mktemp("finished")))


@pytest.mark.slow
@pytest.mark.usefixtures("workers")
def test_the_table_has_the_same_bytes_for_all_batches_and_jobs(finished, tmp_path):
    folder = run(write(tmp_path), "--batch", "2", "--jobs", "2")
    assert (folder / "runs.csv").read_bytes() == (finished / "runs.csv").read_bytes()


@pytest.mark.slow
def test_parts_together_give_the_same_bytes(finished, tmp_path):
    path = write(tmp_path)
    for part in ("2/2", "1/2"):
        assert not (path.with_suffix("") / "runs.csv").exists()
        folder = run(path, "--part", part)
    assert (folder / "runs.csv").read_bytes() == (finished / "runs.csv").read_bytes()


@pytest.mark.slow
def test_killed_anywhere_a_resumed_experiment_gives_the_same_bytes(finished, tmp_path):
    path = write(tmp_path)
    command = [sys.executable, "-m", "hero_swarm", "run", str(path), "--jobs", "1", "--batch", "1"]
    batches = path.with_suffix("") / "batches"
    for kept in (0, 5):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None:
            if batches.is_dir() and sum(name.endswith(".jsonl") for name in os.listdir(str(batches))) >= kept:
                process.send_signal(signal.SIGKILL)
                break
            time.sleep(0.001)  # a core for the program
        process.wait()
    folder = run(path)
    assert (folder / "runs.csv").read_bytes() == (finished / "runs.csv").read_bytes()


@pytest.mark.slow
def test_all_runs_differ_and_start_alike_for_the_same_seed_in_paired_cells(finished):
    rows = read_table(finished)
    assert len(rows) == 20 and len({row["dispersion"] for row in rows}) == 20
    starts = place_all(Start("uniform", 0.05, 0.0, None), OPEN, 5, [11, 12])
    assert not np.array_equal(starts[0], starts[1])
    assert np.array_equal(starts[1:], place_all(Start("uniform", 0.05, 0.0, None), OPEN, 5, [12]))


def test_what_is_recorded_over_time_agrees_with_the_table(finished):
    samples = [np.load(str(path)) for path in (finished / "series").glob("*" + METRICS_ENDING)]
    assert {array.shape for array in samples} == {(4, 5, 3)}  # t = 0 to 3 s, runs, metrics
    ends = sorted(value for array in samples for value in array[-1, :, 0].tolist())
    assert ends == pytest.approx(sorted(float(row["dispersion"]) for row in read_table(finished)), rel=1e-6)
    poses = [np.load(str(path)) for path in (finished / "series").glob("*" + POSES_ENDING)]
    assert sorted(array.shape for array in poses) == [(7, 5, 3, 3)] * 2 + [(7, 5, 5, 3)] * 2
    assert all(np.isfinite(array).all() for array in nonempty(poses))


@pytest.mark.slow
def test_a_run_ends_when_its_condition_holds_and_others_go_on(tmp_path):
    text = FILE.replace("time_s: 3", "time_s: 3\nuntil: {dispersion_ratio: 2.5}").replace("hz: 2", "hz: 1")
    folder = run(write(tmp_path, text))
    for path in nonempty((folder / "series").glob("*" + METRICS_ENDING)):
        samples = np.load(str(path))[:, :, 1]  # of dispersion_ratio
        for values in samples.T:
            values = values[~np.isnan(values)]
            assert (values[:-1] > 2.5).all() and (len(values) == 4 or values[-1] <= 2.5)
    lengths = {
        int(np.isfinite(np.load(str(path))[:, k, 0]).sum())
        for path in (folder / "series").glob("*.metrics.npy")
        for k in range(5)
    }
    assert len(lengths) > 1, "the condition was met at different times, or the test shows nothing"


def test_a_bound_that_is_never_reached_is_infinite(finished):
    assert {row["time_until_dispersion_ratio_1_s"] for row in read_table(finished)} == {"inf"}


def test_the_report_stands_alone_and_names_every_cell_and_remark(finished):
    report.write_report(str(finished))
    page = (finished / "report.html").read_text()
    for words in (
        "robots 3, errors perfect",
        "robots 5, errors default",
        "5 seeds",
        "not reached in",
        "Cliff",
    ):
        assert words in page
    assert "http://" not in page.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
        "http://creativecommons.org", ""
    )
    with open(str(finished / "summary.csv")) as file:
        summary = list(csv.DictReader(file))
    assert len(summary) == 12
    values = [
        float(row["dispersion"]) for row in read_table(finished) if (row["robots"], row["errors"]) == ("3", "perfect")
    ]
    (own,) = [row for row in summary if (row["robots"], row["errors"], row["metric"]) == ("3", "perfect", "dispersion")]
    assert float(own["median"]) == np.median(values)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("aggregation", "agregation", "voter, wall_following, wheel_genome; did you mean aggregation?"),
        ("aggregation", "nowhere.py:A", "nowhere.py"),
        ("errors: [perfect, default]", "sees: [1, 2]", "no parameter 'sees'; there are rate_hz, v0_m_s"),
        ("aggregation", "box_pushing", "line 1: box_pushing pushes objects"),
        ("errors: [perfect, default]", "speed_m_s: [1, 2]", "no parameter 'speed_m_s'"),
        ("cover: 0.05", "cover: 0.5, gap_m: 1", "find no place"),
        (
            "start: {kind: uniform, cover: 0.05}",
            "start: {kind: file, file: none.csv}",
            "line 3: file {folder}/none.csv cannot be read: no such file; paths are relative to the experiment's file",
        ),
        ("start: {kind: uniform, cover: 0.05}", "arena: no.yaml", "line 3: arena {folder}/no.yaml cannot be read"),
        ("[perfect, default]", "[perfect, no.errors]", "line 2: errors {folder}/no.errors cannot be read"),
    ],
)
def test_what_cannot_run_is_refused_before_anything_runs(old, new, words, tmp_path):
    text = FILE.replace(old, new).replace("compare: {metric: dispersion, between: errors}\n", "")
    with pytest.raises(ExperimentError) as caught:
        run(write(tmp_path, text))
    assert words.format(folder=tmp_path) in str(caught.value) and "\n" not in str(caught.value)
    assert os.listdir(str(tmp_path)) == ["e.yaml"]


@pytest.mark.slow
def test_an_error_of_the_behavior_names_its_line_and_the_runs(tmp_path):
    own = tmp_path / "own.py"
    own.write_text(
        "from hero_swarm.behavior import Behavior\n\n"
        "class Own(Behavior):\n"
        "    def step(self, sensed, memory, random):\n"
        "        return [1, 2][5], 0.0, None\n"
    )
    text = FILE.replace("behavior: aggregation", "behavior: %s" % own)
    with pytest.raises(
        ExperimentError,
        match=r"robots 3, errors perfect: IndexError: .*\(own.py, line 5\)",
    ):
        run(write(tmp_path, text))


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("'fast'", r"gives linear_m_s 'fast': it must be a number, or one for each of 6 robots \(6,\)"),
        ("[1.0] * 4", r"gives linear_m_s of shape \(4,\): it must be a number"),
        ("float('nan')", r"robot rows \[0, 1, 2, 3, 4, 5\] must be finite; sensors give nan for what is not known"),
    ],
)
def test_commands_that_are_no_speeds_are_refused_with_the_behavior(command, words, tmp_path):
    (tmp_path / "own.py").write_text(
        "from hero_swarm.behavior import Behavior\n\n"
        "class Own(Behavior):\n"
        "    def step(self, sensed, memory, random):\n"
        f"        return {command}, 0.0, None\n"
    )
    with pytest.raises(ExperimentError, match=r"^own.py:Own, robots 3, errors perfect: ValueError: .*" + words):
        run(write(tmp_path, FILE.replace("behavior: aggregation", "behavior: own.py:Own")))


@pytest.mark.slow
def test_changed_code_of_the_behavior_is_noticed(tmp_path):
    own = tmp_path / "own.py"
    source = (
        "from hero_swarm.behavior import Behavior\n\n"
        "class Own(Behavior):\n"
        "    def step(self, sensed, memory, random):\n"
        "        return 0.1, 0.0, None\n"
    )
    own.write_text(source)
    path = write(tmp_path, FILE.replace("behavior: aggregation", "behavior: %s" % own))
    run(path)
    own.write_text(source.replace("0.1", "0.05"))
    with pytest.raises(ExperimentError, match="computed by other code"):
        run(path)
    lock = str(tmp_path / "e" / "simulated.lock")
    with results_folder.hold_file(lock), pytest.raises(ExperimentError, match="another"):
        run(path, "--fresh")
    assert list((tmp_path / "e" / "batches").iterdir()), "another run may be adding to it"
    run(path, "--fresh")


@pytest.mark.slow
def test_paths_are_relative_to_the_file_wherever_programs_run(tmp_path, monkeypatch, capsys):
    home, elsewhere = tmp_path / "home", tmp_path / "elsewhere"
    for folder in (home, elsewhere):
        folder.mkdir()
    (home / "own.py").write_text(
        "from hero_swarm.behavior import Behavior\n\n"
        "class Own(Behavior):\n"
        "    def step(self, sensed, memory, random):\n"
        "        return 0.1, 0.0, None\n"
    )
    (home / "own.yaml").write_text("bounds_m: [-1, -1, 1, 1]\n")
    (home / "own.errors").write_text("slip=0.01\n")
    (home / "own.csv").write_text("0,0,0\n0,0.5,0\n")
    path = write(
        home,
        "behavior: own.py:Own\nrobots: 2\narena: own.yaml\nerrors: own.errors\nstart: {kind: file, file: own.csv}\n"
        "time_s: 1\nseeds: {count: 1}\nmetrics: [dispersion]\n",
    )
    monkeypatch.chdir(str(elsewhere))
    absolute = run(path)
    for out in (home / "e", elsewhere / "results"):
        run(path, "--fresh", "--out", str(out))
        report.write_report(str(out))
    monkeypatch.chdir(str(home))
    assert run(Path("e.yaml"), "--fresh") == Path("e"), "a file without a folder is in the working directory"
    monkeypatch.chdir(str(elsewhere))
    home.rename(tmp_path / "moved")
    moved = tmp_path / "moved" / "e"
    replay(moved, "--video", tmp_path / "run.gif")
    assert capsys.readouterr().err.count("may differ") == 0 and absolute == home / "e"


OWN_FILES = {
    "own.py": "import helper\nfrom hero_swarm.behavior import Behavior\n\n\nclass Own(Behavior):\n"
    "    def step(self, sensed, memory, random):\n        return helper.V_M_S, 0.0, None\n",
    "helper.py": "V_M_S = 0.1\n",
    "own.yaml": "bounds_m: [-2, -2, 2, 2]\nareas: [{name: floor, rectangle_m: [-1, -1, 1, 1], picture: own.png}]\n",
    "own.errors": "left_gain=0.9\n",
    "own.csv": "0,0,0\n0,0.5,1\n",
    "e.yaml": "behavior: own.py\nrobots: 2\narena: own.yaml\nerrors: own.errors\nstart: {kind: file, file: own.csv}\n"
    "time_s: 1\nseeds: {count: 3}\nmetrics: [dispersion]\n",
}


def write_own(folder):
    folder.mkdir()
    for name, text in OWN_FILES.items():
        (folder / name).write_text(text)
    Image.new("L", (40, 40), 255).save(str(folder / "own.png"))
    return folder / "e.yaml"


@pytest.mark.slow
@pytest.mark.usefixtures("workers")
def test_files_that_are_edited_during_a_run_change_none_of_its_rows(tmp_path, monkeypatch):
    undisturbed, path = run(write_own(tmp_path / "a")), write_own(tmp_path / "b")
    write_batch = runner.ResultsFolder.write_batch

    def edit_and_write(folder, runs):
        for name in {*OWN_FILES, "own.png"} - {"e.yaml"}:
            (path.parent / name).write_text("edited")
        write_batch(folder, runs)

    monkeypatch.setattr(runner.ResultsFolder, "write_batch", edit_and_write)
    edited = run(path, "--batch", "1")
    assert (edited / "runs.csv").read_bytes() == (undisturbed / "runs.csv").read_bytes()


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("helper.py", "0.1", "0.2", "computed by other code"),
        ("own.errors", "0.9", "0.8", "other parameters"),
        ("own.csv", "0.5", "0.6", "other parameters"),
        ("own.yaml", "-1, -1", "-1, -2", "other parameters"),
        ("own.png", "", "", "computed by other code"),
    ],
)
def test_each_file_that_a_run_reads_counts_as_its_code_or_parameters(name, old, new, words, tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "_run_missing", lambda options, experiment, folder, runs: folder.write_batch(
        [Run(0, 1, (1.0,))]
    ))  # fmt: skip
    path = write_own(tmp_path / "a")
    run(path)
    if old:
        (path.parent / name).write_text(OWN_FILES[name].replace(old, new))
    else:
        Image.new("L", (41, 40), 255).save(str(path.parent / name))
    with pytest.raises(ExperimentError, match=words):
        run(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("robots: 2", "robots: 2\nparameters: {rate_hz: 3000}", "e.yaml, line 3: Own: rate_hz is 3000.0, but must be"),
        ("own.errors", "/dev/zero", "line 4: errors /dev/zero cannot be read: it is a pipe, device or socket"),
        ("own.yaml", "/dev/zero", "line 3: arena /dev/zero: cannot be read: it is a pipe, device or socket"),
        ("own.csv", "/dev/zero", "/dev/zero cannot be read: it is a pipe, device or socket"),
        ("own.py", "no.py", "line 1: no.py, line 1: SyntaxError"),
    ],
)
def test_files_and_rates_that_cannot_be_used_are_one_line(old, new, words, tmp_path):
    path = write_own(tmp_path / "a")
    path.write_text(OWN_FILES["e.yaml"].replace(old, new, 1))
    (path.parent / "no.py").write_text("x = (\n")
    with pytest.raises(ExperimentError) as caught:
        run(path)
    assert re.search(words, str(caught.value).replace(str(path.parent) + "/", "")), str(caught.value)
    assert "\n" not in str(caught.value) and not path.with_suffix("").exists()


def test_a_name_with_a_nul_character_is_refused(tmp_path):
    with pytest.raises(ExperimentError, match="--out .*: a name cannot hold a NUL character"):
        run(write_own(tmp_path / "a"), "--out", "a\0b")


@pytest.mark.parametrize(
    ("start", "check"),
    [
        (Start("grid", 0.0, 0.02, None), lambda gaps_m: gaps_m.min() == pytest.approx(0.02)),
        (Start("circle", 0.0, 0.02, None), lambda gaps_m: gaps_m.min() == pytest.approx(0.02)),
        (Start("uniform", 0.1, 0.01, None), lambda gaps_m: gaps_m.min() >= 0.01),
    ],
)
def test_starts_keep_their_gap_and_their_center(start, check):
    (poses,) = place_all(start, OPEN, 9, [3])
    apart_m = np.hypot(*(poses[:, None, :2] - poses[:, :2]).T)[~np.eye(9, dtype=bool)]
    assert check(apart_m - 2.0 * BODY_RADIUS_M)
    assert np.hypot(*poses[:, :2].mean(axis=0)) < 0.2
    assert (np.abs(poses[:, 2]) <= math.pi).all()


def test_starts_of_a_file_are_its_first_poses(tmp_path):
    path = tmp_path / "starts.csv"
    path.write_text("# x, y, yaw\n0, 0.5, 1\n\n-1,2,-3.0\n5,5,5\n")
    poses = place_all(Start("file", 0.0, 0.0, str(path)), OPEN, 2, [1, 2])
    assert poses.tolist() == [[[0.0, 0.5, 1.0], [-1.0, 2.0, -3.0]]] * 2


def test_starts_of_a_file_may_touch_as_robots_at_the_end_of_a_run(tmp_path):
    path = tmp_path / "starts.csv"
    path.write_text("0,0,0\n%.4f,0,0\n" % (2.0 * BODY_RADIUS_M - 0.0012))
    assert place_all(Start("file", 0.0, 0.0, str(path)), OPEN, 2, [1]).shape == (1, 2, 3)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("0,0,0\n", "has 1 poses for 2 robots"),
        ("0,0\n", "line 1"),
        ("0,0,0\n0,x,0\n", "line 2"),
        ("0,0,inf\n", "line 1"),
        ("0,0,0,0\n", "line 1: '0,0,0,0' must be x m, y m, yaw rad"),
        ("0,0,0\n1e308,0,0\n", "line 2: '1e308,0,0' must be x m, y m, yaw rad, within 1000 m"),
        ("#\n0,0,0\n0,0,1\n", "lines 2 and 3 overlap: 0 mm between centers; bodies are 74 mm wide"),
        ("0,0,0\n0.07,0,0\n", "lines 1 and 2 overlap: 70 mm"),
        ("#\n\n0,0,0\n\nx\n", "line 5"),
    ],
)
def test_a_wrong_file_of_starts_is_refused_with_its_line(content, words, tmp_path):
    path = Path(str(tmp_path)) / "starts.csv"
    path.write_text(content)
    with pytest.raises(ExperimentError) as caught:
        place_all(Start("file", 0.0, 0.0, str(path)), OPEN, 2, [1])
    assert words in str(caught.value) and "starts.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("arena", "place", "words"),
    [
        ("empty", "0.97,0", "the robot of line 3 at (0.97, 0) is in a wall or an object of arena empty"),
        ("empty", "3,0", "the robot of line 3 at (3, 0)"),
        ("box", "-0.95,0.1", "the robot of line 3 at (-0.95, 0.1) is in a wall or an object of arena box"),
    ],
)
def test_a_start_in_a_wall_or_object_or_outside_is_refused(arena, place, words, tmp_path):
    path = tmp_path / "starts.csv"
    path.write_text(f"#\n-0.4,0.4,0\n{place},0\n")
    with pytest.raises(ExperimentError) as caught:
        place_all(Start("file", 0.0, 0.0, str(path)), load_arena(arena), 2, [1])
    assert words in str(caught.value) and "starts.csv" in str(caught.value)


@pytest.mark.parametrize("kind", ["grid", "circle"])
def test_rows_and_circles_that_do_not_fit_into_the_arena_are_refused(kind):
    assert place_all(Start(kind, 0.0, 0.01, None), load_arena("empty"), 9, [1]).shape == (1, 9, 3)
    with pytest.raises(ExperimentError, match=f"start: robot [0-9]+ of the {kind} at .* is in a wall"):
        place_all(Start(kind, 0.0, 0.5, None), load_arena("empty"), 30, [1])


@pytest.mark.parametrize("arguments", [["--part", "4/3"], ["--part", "x"], ["--jobs", "0"], ["--executor", "slurm"]])
def test_a_wrong_option_is_refused_by_name(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        runner.parse_options(["e.yaml", *arguments])
    assert caught.value.code == 2
    assert arguments[0] in capsys.readouterr().err


def replay(*arguments):
    show.main(list(map(str, arguments)))


@pytest.mark.slow
def test_a_run_is_replayed_as_a_video_that_ends_as_the_run_did(finished, tmp_path, capsys):
    replay(finished, "--seed", 13, "--cell", 4, "--video", tmp_path / "run.gif")
    assert "robots 5, errors default, seed 13" in capsys.readouterr().out
    assert Image.open(str(tmp_path / "run.gif")).n_frames == 30
    _, experiment, _ = read_results(str(finished))
    trial = set_up(experiment, experiment.cells[3]).build_trial([13])
    for _ in trial.run(3.0):
        pass
    rows = {(row["robots"], row["errors"], row["seed"]): row for row in read_table(finished)}
    assert metrics.dispersion(trial.rows.world.poses[None, :, :2])[0] == float(rows["5", "default", "13"]["dispersion"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--seed", 10], "--seed 10: there are seeds 11 to 15"),
        (["--cell", 5], "--cell 5: must be one of 1: robots 3, errors perfect; 2:"),
        (["--video", "/nowhere/run.gif"], "cannot be written"),
    ],
)
def test_what_cannot_be_shown_is_refused_in_one_line(options, words, finished):
    with pytest.raises(ExperimentError) as caught:
        replay(finished, *options)
    assert words in str(caught.value)


def test_a_run_is_shown_at_speeds_that_its_options_name(capsys):
    assert [show.parse_options(["x", "--speed", text]).speed for text in ("0.01", "100")] == [0.01, 100.0]
    with pytest.raises(SystemExit):
        show.parse_options(["x", "--speed", "0"])
    assert "--speed: 0 must be a number from 0.01 to 100" in capsys.readouterr().err


def test_a_run_of_one_of_several_behaviors_is_shown_without_a_note(tmp_path, monkeypatch, capsys, ahead):
    for name in ("first.py", "second.py"):
        (tmp_path / name).write_text(ahead)
    (tmp_path / "own.py").write_text("def zero(state):\n    return 0.0 * state.poses[:, 0, 0]\n")
    path = tmp_path / "two.yaml"
    metrics_of_both = "robots: 2\ntime_s: 1\nseeds: {count: 1}\nmetrics: [own.py:zero]\n"
    path.write_text("vary: {behavior: [first.py, second.py]}\n" + metrics_of_both)
    folder = run(path)
    monkeypatch.setattr("hero_swarm.video.write_video", lambda *arguments: None)
    for cell in (1, 2):
        replay(folder, "--cell", cell, "--video", tmp_path / "run.gif")
    assert "may differ" not in capsys.readouterr().err


def test_a_run_of_other_code_is_shown_with_a_note(finished, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(show, "load_checked", lambda experiment: "0ther")
    monkeypatch.setattr("hero_swarm.video.write_video", lambda *arguments: None)
    replay(finished, "--video", tmp_path / "run.gif")
    assert "may differ" in capsys.readouterr().err
