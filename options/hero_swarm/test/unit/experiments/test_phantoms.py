"""Phantoms: the same experiment in worlds with other assumptions, and which share of its score survives."""

import math

import numpy as np
import pytest
import yaml

from hero_swarm.experiments import phantoms, runner
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import Metric, parse_experiment, read_experiment
from hero_swarm.experiments.worlds import WORLDS

FILE = """\
behavior: ahead.py
vary: {robots: [2], errors: [perfect, default]}
delay_s: 0.1
errors.friction: 0.2
start: {kind: circle, gap_m: 0.2}
time_s: 1
seeds: {from: 7, count: 50}
metrics: [dispersion]
record: {hz: 1}
compare: {metric: dispersion, between: errors}
"""


@pytest.fixture(name="path")
def write_files(tmp_path, monkeypatch, ahead):
    (tmp_path / "ahead.py").write_text(ahead)
    (tmp_path / "e.yaml").write_text(FILE)
    monkeypatch.chdir(str(tmp_path))
    return tmp_path / "e.yaml"


@pytest.mark.slow
def test_an_experiment_is_run_in_all_worlds_in_place_of_its_own(path, capsys):
    phantoms.main([str(path), "--seeds", "2", "--jobs", "1"])
    made = yaml.safe_load((path.parent / "e_phantoms.yaml").read_text())
    assert made["vary"] == {"world": list(WORLDS), "robots": [2]}
    assert made["seeds"] == {"from": 7, "count": 2}
    assert set(made) == {"behavior", "vary", "start", "time_s", "seeds", "metrics"}
    lines = capsys.readouterr().out.splitlines()
    first = lines.index("share of the nominal dispersion that is kept")
    assert [line.split("  ")[1].strip() for line in lines[first + 1 : -1]] == list(WORLDS)
    assert lines[first + 1].split()[-1] == "1.00"
    assert lines[-1].startswith("usual robots keep ")
    assert (path.parent / "e_phantoms" / "report.html").is_file()
    phantoms.main([str(path), "--seeds", "2", "--jobs", "1"])  # nothing is computed again
    assert "runs in" not in capsys.readouterr().err


def test_a_behavior_is_run_by_its_own_metric(path):
    options = phantoms.parse_options(["ahead.py", "--robots", "4", "--time", "3", "--seeds", "2", "--arena", "empty"])
    made = phantoms.make_file(options)
    _, experiment = read_experiment(made)
    assert made == "ahead_phantoms.yaml"
    assert [metric.source for metric in experiment.metrics] == ["dispersion"]
    assert {cell.settings["robots"] for cell in experiment.cells} == {4} and experiment.time_s == 3.0
    assert {(cell.start.kind, cell.start.cover, cell.start.gap_m) for cell in experiment.cells} == {
        ("uniform", 0.02, 0.0)
    }
    worlds = {cell.varied["world"]: cell.settings for cell in experiment.cells}
    assert worlds["friction"]["errors.friction"] == 0.3 and worlds["nominal"]["errors.friction"] == 0.0
    assert worlds["bad radio"]["wifi"] == "bad" and worlds["late poses"]["delay_s"] == 0.2


@pytest.mark.parametrize("text", ["mine: 1\n", "", "# Made by hand\n", phantoms._FIRST_LINE % "another.yaml"])
def test_a_file_that_somebody_wrote_is_not_written_over(path, text):
    (path.parent / "e_phantoms.yaml").write_text(text)
    with pytest.raises(ExperimentError, match="was not made by this command: move it away"):
        phantoms.make_file(phantoms.parse_options([str(path)]))
    assert (path.parent / "e_phantoms.yaml").read_text() == text


def test_a_behavior_that_is_not_there_is_refused_with_those_that_are(path):
    with pytest.raises(ExperimentError, match="behavior 'nosuch': .*milling"):
        phantoms.make_file(phantoms.parse_options(["nosuch"]))


def find_shares(metrics, scores):
    """Return the shares for scores by world, the same for both seeds; nominal's for those not given."""
    text = f"behavior: milling\nrobots: 3\nvary: {{world: [{', '.join(WORLDS)}]}}\ntime_s: 2\nseeds: {{count: 2}}\n"
    experiment = parse_experiment(text + f"metrics: {metrics}\n", "e.yaml")
    values = [[scores.get(world, scores["nominal"])] * 2 for world in WORLDS]
    return phantoms.find_shares(experiment, np.array(values))


@pytest.mark.parametrize(
    "metrics, scores, share",
    [
        ("[nearest_neighbor]", {"nominal": 0.8, "friction": 0.2}, 0.25),
        ("[rotation]", {"nominal": 0.89, "friction": 0.835}, 0.5),  # of random controllers, one in twenty has 0.78
        ("[{mean_of_last_s: {rotation: 1}}]", {"nominal": 1.0, "friction": 0.5}, 0.0),
        ("[dispersion]", {"nominal": 0.2, "friction": 0.8}, 0.25),  # less is better
        ("[{time_until: {rotation: 0.9}}]", {"nominal": 10.0, "friction": math.inf}, 0.0),  # so is earlier
    ],
)
def test_the_share_that_is_kept_knows_which_way_is_better(metrics, scores, share):
    shares = find_shares(metrics, scores)
    assert shares["friction"] == pytest.approx(share)
    assert shares["nominal"] == shares["late poses"] == 1.0
    assert "most is lost by friction (%.2f)" % share in phantoms.describe(shares, Metric("x", "x"))


@pytest.mark.parametrize(
    "metrics, nominal, words",
    [
        ("[fatness]", 0.0, "zero"), ("[{time_until: {rotation: 0.9}}]", math.inf, "zero"),
        ("[rotation]", 0.77, "not above chance"),
    ],
)  # fmt: skip
def test_without_a_nominal_score_there_is_no_verdict(metrics, nominal, words):
    source = "rotation" if words != "zero" else "fatness"
    text = phantoms.describe(find_shares(metrics, {"nominal": nominal}), Metric("x", source))
    assert "no score" in text and text.endswith(f"no verdict: the nominal score is {words}, or never reached")


@pytest.mark.slow
def test_run_names_that_other_assumptions_were_not_tried(path):
    options = ["--jobs", "1"]
    text = FILE.replace("count: 50", "count: 2")
    path.write_text(text)
    line = runner.run_experiment(runner.parse_options([str(path), *options]))
    assert line.endswith(f"; not tried with other assumptions: rosrun hero_swarm phantoms {path}")
    (path.parent / "e_phantoms").mkdir()
    assert runner.run_experiment(runner.parse_options([str(path), *options])).endswith("seeds each")


@pytest.mark.parametrize("own", ["errors: default", "errors.friction: 0.1", "wifi: router", "delay_s: 0"])
def test_a_world_does_not_go_with_what_it_gives(own):
    text = f"behavior: milling\nrobots: 3\nworld: usual\n{own}\ntime_s: 2\nseeds: {{count: 2}}\nmetrics: [order]\n"
    with pytest.raises(ExperimentError, match=f"{own.partition(':')[0]} does not go with world"):
        parse_experiment(text, "e.yaml")
