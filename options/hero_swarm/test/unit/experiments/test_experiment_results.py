"""The folder of results: what is damaged, stale or of other code never counts, and order changes nothing."""

import json
import math
import os
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hero_swarm.experiments import report, runner
from hero_swarm.experiments.computing import code_version
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.experiments.reporting.statistics import correct_by_holm
from hero_swarm.experiments.reporting.summary import build_report
from hero_swarm.experiments.results import load
from hero_swarm.experiments.results_folder import (
    EXPERIMENT,
    METRICS_ENDING,
    REAL,
    SIMULATED,
    ResultsFolder,
    Run,
    read_results,
)

FILE = """\
behavior: a.B
vary: {robots: [2, 3]}
time_s: 10
seeds: {from: 5, count: 4}
metrics: [dispersion, {time_until: {dispersion: 1.0}}]
"""


def parse(text=FILE):
    return parse_experiment(text, "e.yaml")


def make_run(cell, seed):
    return Run(cell, seed, (0.1 * seed + cell, math.inf if seed % 2 else 1.0 / 3.0))


RUNS = [make_run(cell, seed) for cell in (0, 1) for seed in range(5, 9)]


def open_folder(path, text=FILE, code="c0de", fresh=False):
    folder = ResultsFolder(str(path), parse(text), code)
    if fresh:
        folder.clear(SIMULATED)
    return folder, folder.begin(text, {"numpy": "1"})


def batches_of(path):
    return sorted((path / "batches").iterdir())


@pytest.mark.parametrize("batches", [[[0], [1], [2], [3]], [[0, 1, 2, 3]], [[3, 1], [0, 2]]])
def test_the_table_does_not_depend_on_batches_or_their_order(batches, tmp_path):
    folder, _ = open_folder(tmp_path)
    for batch in batches:
        for cell in (1, 0):
            folder.write_batch([RUNS[4 * cell + index] for index in batch])
    assert folder.read_runs() == RUNS
    with open(folder.write_table(folder.read_runs())) as file:
        lines = file.read().splitlines()
    assert lines[0] == "robots,seed,kind,dispersion,time_until_dispersion_1_s,remark"
    assert lines[1] == "2,5,simulated,0.5,inf,"
    assert len(lines) == 9


def test_a_folder_without_an_experiment_is_none_of_run(tmp_path):
    open_folder(tmp_path)
    assert read_results(str(tmp_path))[2]["numpy"] == "1"
    (tmp_path / EXPERIMENT).unlink()
    with pytest.raises(ExperimentError, match=f"no {EXPERIMENT} in it, so not a folder of run"):
        read_results(str(tmp_path))


def test_a_run_reads_no_file_that_it_did_not_need_when_it_began(tmp_path):
    (tmp_path / "e.yaml").write_text(FILE.replace("a.B", "dispersion"))
    options, words = runner.parse_options([str(tmp_path / "e.yaml")]), "needed now, but was not when the run began"
    with runner.open_folder(options) as (experiment, _, _), pytest.raises(OSError, match=words):
        experiment.sources.read(__file__)


@pytest.mark.parametrize("aside", ["", "e/aside"])
def test_what_fresh_sets_aside_is_told(tmp_path, monkeypatch, capsys, aside):
    (tmp_path / "e.yaml").write_text(FILE.replace("a.B", "dispersion"))
    monkeypatch.setattr(ResultsFolder, "clear", lambda folder, kind: aside)
    with runner.open_folder(runner.parse_options([str(tmp_path / "e.yaml"), "--fresh"])):
        told = capsys.readouterr().err
    assert told.startswith(aside + ": set aside: damaged batches") if aside else not told


def test_a_resumed_experiment_lacks_only_what_is_missing(tmp_path):
    folder, runs = open_folder(tmp_path)
    assert runs == [] and len(folder.list_missing(runs)) == 8
    folder.write_batch(RUNS[:3])
    again, runs = open_folder(tmp_path)
    assert runs == RUNS[:3]
    assert again.list_missing(runs) == [(0, 8), (1, 5), (1, 6), (1, 7), (1, 8)]


def test_more_seeds_keep_the_runs_that_are_there(tmp_path):
    folder, _ = open_folder(tmp_path)
    folder.write_batch(RUNS[:4])
    _, runs = open_folder(tmp_path, FILE.replace("count: 4", "count: 6"))
    assert runs == RUNS[:4]
    _, runs = open_folder(tmp_path, FILE.replace("count: 4", "count: 2"))
    assert runs == RUNS[:2]


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[: len(text) // 2],
        lambda text: text[: text.rindex('{"seed"')],
        lambda text: "",
        lambda text: text.replace('"seeds": [5, 6, 7]', '"seeds": [5, 6, 8]').replace('"seed": 7', '"seed": 8'),
        lambda text: text.replace('{"seed": 6', '{"sleep": 6'),
    ],
    ids=["cut", "a line less", "empty", "other seeds", "other names"],
)
def test_a_damaged_batch_is_computed_again(damage, tmp_path):
    folder, _ = open_folder(tmp_path)
    folder.write_batch(RUNS[:3])
    (batch,) = batches_of(tmp_path)
    batch.write_text(damage(batch.read_text()))
    _, runs = open_folder(tmp_path)
    assert runs == []


def test_what_a_killed_writer_left_behind_does_not_count(tmp_path):
    folder, _ = open_folder(tmp_path)
    folder.write_batch(RUNS[:3])
    (batch,) = batches_of(tmp_path)
    batch.with_name(batch.name + ".a1b2.new").write_text(batch.read_text())
    assert folder.read_runs() == RUNS[:3]


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"code": "0ther"}, "computed by other code (c0de, now 0ther)"),
        ({"text": FILE.replace("time_s: 10", "time_s: 11")}, "of an experiment with other parameters"),
        (
            {"text": FILE.replace("dispersion: 1.0", "dispersion: 2.0")},
            "of an experiment with other parameters",
        ),
    ],
)
def test_runs_of_other_code_or_parameters_are_refused_until_fresh(changed, words, tmp_path):
    folder, _ = open_folder(tmp_path)
    folder.write_batch(RUNS[:3])
    with pytest.raises(ExperimentError) as caught:
        open_folder(tmp_path, **changed)
    assert words in str(caught.value) and "--fresh" in str(caught.value)
    assert batches_of(tmp_path), "nothing is lost by the refusal"
    _, runs = open_folder(tmp_path, fresh=True, **changed)
    assert runs == [] and not batches_of(tmp_path)


@pytest.mark.parametrize("name", ["thesis.tex", "experiment.yaml", "batches", "about.json"])
def test_a_folder_that_is_none_of_ours_is_refused_and_not_touched(name, tmp_path):
    folder = tmp_path / "data"
    (folder / "batches").mkdir(parents=True)
    (folder / name).touch()
    for act in (lambda own: own.clear(SIMULATED), lambda own: own.begin(FILE, {}), lambda own: enter(own.hold())):
        with pytest.raises(ExperimentError, match="data: (holds files, but|no folder with) .*results"):
            act(ResultsFolder(str(folder), parse(), "c0de"))
    assert {entry.name for entry in folder.iterdir()} == {"batches", name} and not os.listdir(str(folder / "batches"))


def enter(context):
    with context:
        pass


def test_fresh_touches_no_file_of_another_name(tmp_path):
    folder, _ = open_folder(tmp_path)
    folder.write_batch(RUNS[:3])
    own = folder.name_series(0, [5, 6, 7])
    kept = [tmp_path / "batches" / "my_thesis.csv", tmp_path / "series" / "my.npy", tmp_path / "notes.txt"]
    gone = [Path(own + ".metrics.npy"), Path(own + ".poses.npy"), Path(own + ".poses.npy.0a1b2c3d.new")]
    for path in kept + gone:
        path.write_text("mine")
    folder.clear(SIMULATED)
    assert all(path.read_text() == "mine" for path in kept) and not any(path.exists() for path in gone)


def test_runs_on_robots_stay_marked_and_beside_simulated_ones(tmp_path):
    folder, _ = open_folder(tmp_path)
    real = [Run(0, 5, (1.0, 2.0), REAL, "hero_2 lost its pose")]
    folder.write_batch(RUNS[:1])
    folder.write_batch(real)
    assert folder.read_runs() == [real[0], RUNS[0]]
    assert (0, 5) not in folder.list_missing(folder.read_runs()), "computed"
    assert (0, 5) in folder.list_missing(folder.read_runs(), REAL), "a trial that does not count is repeated"
    with open(folder.write_table(folder.read_runs())) as file:
        assert "2,5,real,1.0,2.0,hero_2 lost its pose" in file.read()


def test_trials_on_robots_are_never_deleted(tmp_path):
    folder, _ = open_folder(tmp_path)
    real, text = Run(0, 6, (1.0, 2.0), REAL), FILE.replace("time_s: 10", "time_s: 11")
    for runs in (RUNS[:1], [real]):
        folder.write_batch(runs)
    folder, runs = open_folder(tmp_path, code="0ther", fresh=True)
    assert runs == [real], "they outlive a change of the code"
    folder.write_batch(RUNS[:1])
    ((trial, content),) = [(path, path.read_text()) for path in batches_of(tmp_path) if REAL in path.read_text()]
    assert folder.clear(REAL) == str(tmp_path / "set_aside" / "1")
    assert folder.read_runs() == RUNS[:1] and (tmp_path / "set_aside" / "1" / trial.name).read_text() == content
    trial.write_text(content)
    assert open_folder(tmp_path, text, "0ther", fresh=True)[1] == [], "of an experiment with other parameters"
    assert (tmp_path / "set_aside" / "2" / trial.name).read_text() == content and not batches_of(tmp_path)


def test_a_damaged_batch_is_set_aside_by_fresh_and_by_a_trial_of_its_name(tmp_path):
    folder, _ = open_folder(tmp_path)
    folder.write_batch([Run(0, 6, (1.0, 2.0), REAL)])
    (batch,) = batches_of(tmp_path)
    for number, act in enumerate((folder.clear, lambda kind: folder.write_batch([Run(0, 6, (3.0, 2.0), REAL)])), 1):
        batch.write_text("damaged")
        act(SIMULATED)
        assert (tmp_path / "set_aside" / str(number) / batch.name).read_text() == "damaged"
    assert folder.read_runs() == [Run(0, 6, (3.0, 2.0), REAL)]


def test_of_two_programs_the_second_is_refused_unless_both_compute_parts(tmp_path):
    first, second = (ResultsFolder(str(tmp_path / "e"), parse(), "c0de") for _ in range(2))
    with first.hold():
        for is_shared in (False, True):
            with pytest.raises(ExperimentError, match=r"e: another run is adding to it; .* --part 1/2 and --part 2/2$"):
                enter(second.hold(is_shared=is_shared))
        enter(second.hold(REAL))
    with first.hold(is_shared=True):
        enter(second.hold(is_shared=True))
        with pytest.raises(ExperimentError, match="another run"):
            enter(second.hold())
    enter(second.hold())


def test_what_a_killed_program_left_of_poses_goes_with_the_next_one_alone(tmp_path):
    folder, _ = open_folder(tmp_path)
    left, other = Path(folder.name_series(0, [5]) + ".poses.npy.0a1b2c3d.new"), tmp_path / "series" / "mine.new"
    for path in (left, other):
        path.write_text("")
    enter(folder.hold(is_shared=True))
    assert left.exists(), "another part may be writing it"
    enter(folder.hold(REAL))
    assert left.exists(), "trials on robots do not keep others from computing"
    enter(folder.hold())
    assert not left.exists() and other.exists()


@pytest.mark.parametrize("content", ["", "{", "[" * 100_000, "[]", "{}", '{"code": 1}'])
def test_a_damaged_about_json_is_one_line_that_names_the_folder(content, tmp_path):
    open_folder(tmp_path / "e")
    (tmp_path / "e" / "about.json").write_text(content)
    for act in (lambda: report.write_report(str(tmp_path / "e")), lambda: open_folder(tmp_path / "e")):
        with pytest.raises(ExperimentError, match="e: no folder with results of run: about.json") as caught:
            act()
        assert "\n" not in str(caught.value)


def test_a_report_never_mixes_runs_of_two_codes(tmp_path):
    open_folder(tmp_path)[0].write_batch(RUNS[:1])
    ResultsFolder(str(tmp_path), parse(), "0ther").write_batch(RUNS[1:2])
    with pytest.raises(ExperimentError, match="computed by other code"):
        report.write_report(str(tmp_path))


def test_a_trial_that_counts_replaces_one_that_does_not(tmp_path):
    good, bad = Run(0, 5, (1.0, 2.0), REAL), Run(0, 5, (3.0, 4.0), REAL, "stopped at 2.0 s")
    for number, order in enumerate(((good, bad), (bad, good))):
        path = tmp_path / str(number)
        for code, run in zip(("c0de", "0ther"), order):
            open_folder(path, code=code)[0].write_batch([run])
        assert open_folder(path)[0].read_runs() == [good]


@pytest.mark.slow
def test_the_folder_says_what_made_it(tmp_path):
    open_folder(tmp_path)
    assert (tmp_path / "experiment.yaml").read_text() == FILE
    assert json.loads((tmp_path / "about.json").read_text()) == {"code": "c0de", "numpy": "1"}


@pytest.mark.slow
def test_a_report_of_each_kind_of_runs_has_its_own_files(tmp_path, monkeypatch, capsys):
    pages, draw = [], report.draw_page
    monkeypatch.setattr(report, "draw_page", lambda *arguments: pages.append(arguments) or draw(*arguments))
    path = tmp_path / "both"
    folder, _ = open_folder(path)
    folder.write_batch(RUNS[:4])
    folder.write_batch([Run(0, 5, (7.0, 1.0), REAL)])
    folder.write_batch([Run(0, 7, (9.0, 1.0), REAL, "lost hero_3")])
    np.testing.assert_array_equal(load(str(path), REAL).metrics["dispersion"], [[7.0, *[np.nan] * 3], [np.nan] * 4])
    np.save(folder.name_series(0, [5, 6, 7, 8]) + METRICS_ENDING, np.arange(12.0).reshape(3, 4, 1))
    report.write_report(str(path))
    for name, median in (("summary.csv", 0.65), ("summary_robots.csv", 7.0)):
        first = (path / name).read_text().splitlines()[1].split(",")
        assert first[:2] == ["2", "dispersion"] and float(first[3]) == pytest.approx(median)
    assert {"report.html", "report_robots.html", "runs.csv"} <= set(os.listdir(str(path)))
    (_, simulated, text, about), (_, of_robots, _, _) = pages
    line = simulated["dispersion_over_time"].axes[0].lines[0]
    assert line.get_xdata().tolist() == [0.0, 1.0, 2.0] and line.get_ydata().tolist() == [1.5, 5.5, 9.5]
    assert text == FILE and about["code"] == "c0de"
    assert "dispersion" in of_robots and "dispersion_over_time" not in of_robots
    assert ["<h2>Over time" in (path / f"report{kind}.html").read_text() for kind in ("", "_robots")] == [True, False]
    assert "report_robots.html" in capsys.readouterr().out
    figures, of_robots = (set(os.listdir(str(path / name))) for name in ("figures", "figures_robots"))
    assert of_robots < figures and figures - of_robots >= {"dispersion_over_time.svg", "dispersion_over_time.pdf"}
    only = tmp_path / "robots"
    open_folder(only)[0].write_batch([Run(0, 5, (7.0, 1.0), REAL)])
    report.write_report(str(only))
    assert not (only / "summary.csv").exists() and (only / "summary_robots.csv").exists()
    with pytest.raises(ExperimentError, match="there is no run to report"):
        open_folder(tmp_path / "none")
        report.write_report(str(tmp_path / "none"))


def test_a_report_compares_runs_of_one_seed_and_says_what_is_missing():
    experiment = parse(FILE + "compare: {metric: dispersion, between: robots}\n")
    runs = [
        Run(0, 5, (1.0, math.inf)),
        Run(1, 5, (3.0, 1.0)),
        Run(0, 6, (1.0, 1.0)),
        Run(1, 6, (7.0, 1.0), remark="a robot was lifted"),
        Run(1, 6, (6.0, 1.0), kind=REAL),
        Run(1, 7, (9.0, 1.0)),
    ]
    found = build_report(experiment, runs)
    ((*cells, comparison),) = found.compared
    assert cells == list(experiment.cells) and comparison.pairs == 1
    assert comparison.difference.median == 2.0 and comparison.delta == 1.0
    assert [summary.values for summary in found.summaries["dispersion"]] == [(1.0, 1.0), (3.0, 6.0, 9.0)]
    assert found.seeds == [5, 6, 7]
    remarks = "\n".join(found.remarks)
    for words in ("2 of 8 runs are still missing", "3 seeds: ", "1 runs are left out", "not reached in 1 runs"):
        assert words in remarks


def test_each_cell_is_compared_with_that_of_the_first_value_and_corrected():
    text = FILE.replace("[2, 3]", "[2, 3, 4], delay_s: [0, 1]") + "compare: {metric: dispersion, between: robots}\n"
    experiment = parse(text)
    runs = [Run(cell, seed, (seed + cell * (seed - 6.3), 1.0)) for cell in range(6) for seed in range(5, 9)]
    compared = build_report(experiment, runs).compared
    pairs = [tuple(map(experiment.cells.index, cells)) for *cells, _ in compared]
    assert pairs == [(0, 2), (0, 4), (1, 3), (1, 5)]
    alone = [[run for run in runs if run.cell in cells] for cells in pairs]
    p_values = [build_report(experiment, own).compared[0][2].p_value for own in alone]
    assert [one.p_value for _, _, one in compared] == list(correct_by_holm(p_values))
    assert compared[0][2].p_value > p_values[0]


def test_what_runs_record_is_found_by_cell_and_seed(tmp_path):
    folder, _ = open_folder(tmp_path)
    for cell, seeds in ((0, [5, 7]), (1, [6]), (0, [6])):
        folder.write_batch([make_run(cell, seed) for seed in seeds])
        values = np.array([[[10.0 * cell + seed] for seed in seeds]] * 2)
        np.save(folder.name_series(cell, seeds) + METRICS_ENDING, values)
    folder.write_batch([make_run(0, 8)])  # nothing was recorded of it
    for cell, seeds in ((0, {5, 6, 7}), (1, {6})):
        found = folder.read_series(cell, METRICS_ENDING)
        assert {seed: values.tolist() for seed, values in found.items()} == {
            seed: [[10.0 * cell + seed]] * 2 for seed in seeds
        }
    assert folder.read_series(0, ".poses.npy") == {}


def test_code_is_the_files_of_all_packages_and_the_users_modules(tmp_path, monkeypatch):
    tmp_path /= "published"  # left out inside of packages, while a checkout may lie in any folder
    for package in code_version.PACKAGES:
        (tmp_path / package / "deep" / "__pycache__").mkdir(parents=True)
        for name in ("__init__.py", "module.py"):
            (tmp_path / package / name).write_text("")
        (tmp_path / "devel" / package).mkdir(parents=True)
    modules = {
        name: SimpleNamespace(__path__=[str(tmp_path / "devel" / name), str(tmp_path / name)])
        for name in code_version.PACKAGES
    }
    monkeypatch.setattr(code_version, "import_module", modules.__getitem__)
    monkeypatch.setattr(code_version, "hash_suite", code_version.hash_suite.__wrapped__)

    def change(path, text="changed\n"):
        before = code_version.hash_code({})
        path.write_text(text)
        return code_version.hash_code({}) != before

    inner = tmp_path / "hero_sim" / "deep"
    assert change(inner / "new.py") and change(inner / "new.py", "again\n") and change(tmp_path / "hero_node" / "b.py")
    assert change(inner / "arena.yaml")
    assert not change(tmp_path / "devel" / "hero_sim" / "__init__.py"), "of a devel space, which names the others"
    assert not change(inner / "notes.txt") and not change(inner / "__pycache__" / "c.py")
    (inner / "published").mkdir()
    assert not change(inner / "published" / "own.py"), "runs read what they need of these as files of the user"
    before = code_version.hash_code({})
    (inner / "new.py").rename(inner / "other.py")
    assert len(before) == 16 and code_version.hash_code({}) != before
    users = [{}, {"own.py": b"x = 1"}, {"own.py": b"x = 2"}, {"own.py": b"x = 1", "a/b.py": b""}, {"o.py": b"x = 1"}]
    assert len(set(map(code_version.hash_code, users))) == len(users)
    assert {"commit", "machine", "numpy", "python"} == set(code_version.describe_machine())


def test_a_process_whose_sources_differ_or_change_computes_nothing(monkeypatch):
    suite = code_version.hash_suite()
    code_version.check_suite(suite)
    with pytest.raises(ExperimentError, match="has other code of the suite .*update it and start again"):
        code_version.check_suite("0ther")
    monkeypatch.setattr(code_version, "_digest", lambda contents: "changed")
    with pytest.raises(ExperimentError, match="other code of the suite .changed, not %s" % suite):
        code_version.check_suite(suite)


@pytest.mark.parametrize("failure", [OSError("no git"), subprocess.TimeoutExpired("git", 10.0)])
def test_outside_of_a_checkout_the_commit_is_unknown(monkeypatch, failure):
    def fail(*arguments, **options):
        raise failure

    # The first call in a process asks a program, too.
    monkeypatch.setattr(code_version.platform, "platform", lambda: "Linux")
    monkeypatch.setattr(code_version.subprocess, "check_output", fail)
    assert code_version.describe_machine()["commit"] == "unknown"
