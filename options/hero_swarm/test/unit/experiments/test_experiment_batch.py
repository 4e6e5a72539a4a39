"""Runs of one cell in this process: what columns take of the samples, where a run ends, and what is recorded."""

import math
import os

import numpy as np
import pytest

from hero_swarm import metrics
from hero_swarm.experiments import runner
from hero_swarm.experiments.computing.batch import METRICS_ENDING, POSES_ENDING, compute_batch, take_values
from hero_swarm.experiments.computing.code_version import hash_suite
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_test.nonempty import nonempty
from hero_test.small_disk import SmallDisk

FILE = """\
behavior: aggregation
vary: {robots: [3]}
start: {kind: uniform, cover: 0.05}
time_s: 4
seeds: {from: 11, count: 3}
metrics: [dispersion, {mean_of_last_s: {nearest_neighbor: 2}}, {time_until: {dispersion_ratio: 1.5}}]
record: {hz: 2}
"""


def compute(text, seeds, stem):
    return compute_batch(parse_experiment(text, "e.yaml"), hash_suite(), 0, seeds, stem)


def take(text, series):
    return take_values(parse_experiment(FILE.replace("nearest_neighbor: 2", text), "e.yaml"), series)


@pytest.mark.slow
def test_columns_are_a_last_sample_a_mean_or_the_first_time_below_a_bound():
    # Of each second: dispersion, dispersion_ratio, nearest_neighbor.
    series = np.array([(1.0, 2.0, 10.0), (2.0, 1.6, 20.0), (3.0, 1.4, 40.0), (4.0, 1.7, 80.0), (5.0, 1.3, 160.0)])
    assert take("nearest_neighbor: 2", series) == (5.0, 120.0, 2.0)
    assert take("nearest_neighbor: 3", series)[1] == pytest.approx(280.0 / 3.0)
    assert take("nearest_neighbor: 60", series)[1] == 62.0
    assert take("nearest_neighbor: 1", series[:2]) == (2.0, 20.0, math.inf)
    series[0, 1] = 1.5
    assert take("nearest_neighbor: 1", series)[2] == 0.0, "it holds from the start on"


@pytest.mark.slow
def test_a_run_that_has_ended_has_no_more_samples_and_others_go_on(tmp_path):
    whole = compute(FILE, [11, 12, 13], str(tmp_path / "a"))
    series, poses = (np.load(str(tmp_path / ("a" + ending))) for ending in (METRICS_ENDING, POSES_ENDING))
    assert series.shape == (5, 3, 3) and poses.shape == (9, 3, 3, 3) and np.isfinite(poses).all()
    assert [run.seed for run in whole] == [11, 12, 13] and {run.cell for run in whole} == {0}
    # Samples lie 1 s apart and poses 0.5 s: both are of the same times.
    assert metrics.dispersion(poses[::2, 1, :, :2].astype(float)) == pytest.approx(series[:, 1, 0], rel=1e-5)
    assert [run.values[0] for run in whole] == pytest.approx(series[-1, :, 0].tolist())

    bound = float(np.sort(series[2, :, 0])[0]) * 1.0001  # one run is below it after 2 s
    text = FILE.replace("time_s: 4", "time_s: 4\nuntil: {dispersion: %r}" % bound).replace("record: {hz: 2}\n", "")
    runs = compute(text, [11, 12, 13], str(tmp_path / "b"))
    ended = np.load(str(tmp_path / ("b" + METRICS_ENDING)))
    for world in range(3):
        below = np.flatnonzero(series[:, world, 0] <= bound)
        last = below[0] if len(below) else 4
        assert np.isfinite(ended[: last + 1, world]).all() and np.isnan(ended[last + 1 :, world]).all()
        assert runs[world].values[0] == pytest.approx(series[last, world, 0])
    assert np.isnan(ended[-1]).any()
    assert not (tmp_path / ("b" + POSES_ENDING)).exists()
    first = 11 + int(series[2, :, 0].argmin())
    compute(text + "record: {hz: 2}\n", [first], str(tmp_path / "d"))
    recorded = np.load(str(tmp_path / ("d" + POSES_ENDING)))
    assert recorded.dtype == np.float32 and recorded.shape == (9, 1, 3, 3)
    assert (recorded[:5, 0] == poses[:5, first - 11]).all() and np.isnan(recorded[5:]).all(), "it ended after 2 s"
    alone = compute(FILE, [12], str(tmp_path / "c"))
    assert alone == whole[1:2], "a run has the same values alone"


def test_metrics_get_speeds_in_meters_per_second(tmp_path, monkeypatch):
    monkeypatch.setitem(metrics.METRICS, "dispersion", lambda poses, velocities, *_: velocities[:, 0, 0])
    compute(FILE.replace("hz: 2", "hz: 20"), [11], str(tmp_path / "a"))
    series, poses = (np.load(str(tmp_path / ("a" + ending))) for ending in (METRICS_ENDING, POSES_ENDING))
    moved_m = float(poses[40, 0, 0, 0] - poses[39, 0, 0, 0])  # in the last cycle before 2 s
    assert series[2, 0, 0] == pytest.approx(moved_m * 20.0, rel=1e-3) and abs(moved_m) > 1e-4


def test_what_a_behavior_raises_names_the_cell_and_the_seeds(tmp_path, monkeypatch):
    monkeypatch.setitem(metrics.METRICS, "dispersion", lambda *arguments: 1 // 0)
    with pytest.raises(ExperimentError, match="with seeds 11 to 13: ZeroDivisionError: .*test_experiment_batch"):
        compute(FILE, [11, 12, 13], str(tmp_path / "a"))
    assert not (tmp_path / ("a" + POSES_ENDING)).exists(), "a file has its name once it is whole"


def make_experiment(robots=20, time_s=600, count=100):
    text = FILE.replace("[3]", "[%d, 1000]" % robots).replace("time_s: 4", "time_s: %g" % time_s)
    return parse_experiment(text.replace("count: 3", "count: %d" % count), "e.yaml")


class Folder:
    def name_series(self, cell, seeds):
        return "%d:%d-%d" % (cell, seeds[0], seeds[-1])


def test_a_batch_is_some_seconds_of_work_and_something_for_each_worker():
    for robots, time_s, expected in ((20, 600, 40), (20, 601, 40), (20, 599, 41), (3, 1, 1000), (20, 80000, 1)):
        assert runner.choose_batch(make_experiment(robots, time_s), 0) == expected
    experiment = make_experiment()
    missing = [(0, seed) for seed in range(11, 111)] + [(1, seed) for seed in (12, 14)]
    cases = ((None, 1, [40, 40, 20, 1, 1]), (None, 4, [13] * 7 + [9, 1, 1]), (30, 4, [30] * 3 + [10, 2]))
    for size, workers, sizes in cases:
        batches = list(runner.list_batches(experiment, missing, size, workers, Folder()))
        assert [len(batch.seeds) for batch in batches] == sizes
        assert [(batch.cell, seed) for batch in batches for seed in batch.seeds] == missing
        assert all(batch.experiment.cells == (experiment.cells[batch.cell],) for batch in nonempty(batches))
        assert batches[0].stem == os.getcwd() + "/" + "0:11-%d" % (10 + sizes[0])


def test_options_of_run_have_their_limits(capsys):
    parse = runner.parse_options
    assert parse(["e.yaml"]).part == (1, 1) and parse(["e.yaml", "--part", "3/3"]).part == (3, 3)
    assert parse(["e.yaml", "--jobs", "1024", "--batch", "1000"]).jobs == 1024
    assert parse(["e.yaml", "--executor", "dask:tcp://a:1"]).executor == "tcp://a:1"
    assert parse(["e.yaml", "--robots", "0-2"]).robots == [0, 1, 2]
    for words in (
        "--part 0/3", "--part 4/3", "--part 3", "--part 1/x", "--jobs 0", "--jobs 1025", "--jobs x", "--batch 0",
        "--batch 1001", "--executor dask:", "--executor tcp://a:1", "--robots all",
    ):  # fmt: skip
        with pytest.raises(SystemExit) as end:
            parse(["e.yaml", *words.split()])
        assert end.value.code == 2 and words.split()[0] in capsys.readouterr().err


@pytest.mark.slow
def test_two_programs_that_record_one_batch_leave_it_whole(tmp_path, monkeypatch):
    stem, measured = str(tmp_path / "a"), metrics.METRICS["dispersion"]

    def measure_beside_another(*state):
        monkeypatch.setitem(metrics.METRICS, "dispersion", measured)
        compute(FILE, [11], stem)
        return measured(*state)

    monkeypatch.setitem(metrics.METRICS, "dispersion", measure_beside_another)
    compute(FILE, [11], stem)
    assert np.load(stem + POSES_ENDING).any(axis=(1, 2, 3)).all()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a" + METRICS_ENDING, "a" + POSES_ENDING]


def test_poses_for_which_a_disk_has_no_room_are_named_and_leave_nothing(tmp_path):
    disk = SmallDisk(tmp_path, "64k")
    try:
        with pytest.raises(OSError, match="No space left on device: '.*a%s'" % POSES_ENDING):
            compute(FILE.replace("time_s: 4", "time_s: 4000"), [11], os.path.join(disk.path, "a"))
        assert os.listdir(disk.path) == []
    finally:
        disk.close()
