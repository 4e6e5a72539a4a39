"""What varies reaches the robots: behaviors with their own parameters, sensors, errors, Wi-Fi and starts."""

import csv

import numpy as np
import pytest

from hero_swarm.experiments import report, runner
from hero_swarm.experiments.computing import set_up
from hero_swarm.experiments.computing.batch import load_checked
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_test.nonempty import nonempty

BEHAVIOR = """\
from hero_swarm.behavior import Behavior, Neighbors

class Gather(Behavior):
    near = Neighbors(range_m=1.0)
    gain = 0.1

    def step(self, sensed, memory, random):
        return self.gain * (sensed.near.counts > 0), 0.0, memory
"""
FILE = """\
vary:
  behavior: [dispersal, {gather.py: {gain: 0.05}}, {gather.py: {gain: 0.15}}]
  near.range_m: [0.05, 5]
robots: 3
start: {kind: circle, gap_m: 0.3}
time_s: 2
seeds: {count: 3}
metrics: [dispersion]
compare: {metric: dispersion, between: behavior}
"""


@pytest.fixture(name="path")
def write_files(tmp_path):
    (tmp_path / "gather.py").write_text(BEHAVIOR)
    (tmp_path / "e.yaml").write_text(FILE)
    return tmp_path / "e.yaml"


def load(path, text=FILE):
    path.write_text(text)
    experiment = parse_experiment(text, str(path))
    load_checked(experiment)
    return experiment


@pytest.mark.slow
def test_a_baseline_is_compared_with_a_controller_over_its_sensor_range(path, capsys):
    runner.run_experiment(runner.parse_options([str(path), "--jobs", "1"]))
    with open(str(path.with_suffix("") / "runs.csv")) as file:
        rows = list(csv.DictReader(file))
    values = {}
    for row in rows:
        values.setdefault((row["behavior"], row["near.range_m"]), []).append(float(row["dispersion"]))
    assert len(values) == 6 and all(len(runs) == 3 for runs in values.values())
    baseline = [runs for (name, _), runs in values.items() if name == "dispersal"]
    assert baseline[0] == baseline[1], "it has no sensor named near"
    near, far = (np.mean(values["gather.py gain 0.15", value]) for value in ("0.05", "5.0"))
    assert abs(near - far) > 0.05, "beyond their sensors robots rest"
    report.main([str(path.with_suffix(""))])
    told = capsys.readouterr().out
    assert (
        "behavior gather.py gain 0.05, near.range_m 5.0 against behavior dispersal, near.range_m 5.0, 3 pairs" in told
    )


def test_runs_of_a_seed_start_alike_whatever_the_behavior(path):
    experiment = load(path)
    starts = [set_up(experiment, cell).build_trial([1]).poses for cell in experiment.cells]
    assert all((start == starts[0]).all() for start in nonempty(starts))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("near.range_m", "naer.range_m", "line 3: .* has no parameter 'naer.range_m'; there are .*"),
        ("near.range_m", "near.rang_m", r"line 3: .* has no parameter 'near.rang_m'.*; did you mean near.range_m\?"),
        ("near.range_m", "errors.slipp", r"line 3: .* has no parameter 'errors.slipp'; .*; did you mean errors.slip\?"),
        ("{gain: 0.05}", "{gian: 0.05}", "line 2: gather.py has no parameter 'gian'; there are gain, .*near.range_m"),
        ("dispersal, {g", "{dispersal: {gain: 1}}, {g", "line 2: dispersal has no parameter 'gain'"),
        ("gather.py: {gain: 0.05}", "other.py: {}", "behavior .*other.py: no such file"),
        ("[0.05, 5]", "[0.05, -5]", "line 3: .*near.range_m is -5.0, but must be a number from 0 to inf"),
        ("{gain: 0.05}", "{gain: far}", "line 2: .*gain is 'far', but must be a number"),
    ],
)
def test_names_that_no_behavior_has_are_refused_with_their_line(path, old, new, words):
    with pytest.raises(ExperimentError, match=words):
        load(path, FILE.replace(old, new))


@pytest.mark.slow
def test_errors_of_all_robots_and_wifi_reach_the_robots(path):
    text = FILE.replace(
        "near.range_m: [0.05, 5]", "errors.slip: [0, 0.3]\n  errors: [perfect, 2.0]\n  wifi: [ideal, bad]"
    )
    experiment = load(path, text)
    built = {}
    for cell in experiment.cells:
        if cell.behavior == "gather.py" and cell.parameters["gain"] == 0.15:
            trial = set_up(experiment, cell).build_trial([1, 2])
            for _ in range(30):
                trial.step()
            built[cell.settings["errors.slip"], cell.settings["errors"], cell.settings["wifi"]] = trial
    assert len(built) == 8
    for (slip, errors, _), trial in built.items():
        of_robots = trial.rows.world.errors
        assert (of_robots.slip == slip).all() and (errors == "perfect") == (np.ptp(of_robots.servo_gain) == 0.0)
    late, prompt = built[0.0, "perfect", "bad"], built[0.0, "perfect", "ideal"]
    assert (late.poses != prompt.poses).any()
    again = set_up(experiment, experiment.cells[-1]).build_trial([2])
    for _ in range(30):
        again.step()
    assert (again.poses[0] == built[0.3, 2.0, "bad"].poses[1]).all(), "a world has its own channel and seeds"


def test_starts_vary(path):
    text = FILE.replace("start: {kind: circle, gap_m: 0.3}\n", "")
    text = text.replace("near.range_m: [0.05, 5]", "start: [{kind: grid}, {kind: circle}]")
    experiment = load(path, text)
    grid, circle = (set_up(experiment, cell).build_trial([1]).poses for cell in experiment.cells[:2])
    assert experiment.cells[0].label == "behavior dispersal, start grid" and (grid != circle).any()
