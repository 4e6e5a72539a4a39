"""Metrics of users: what they see, in which columns they are, what is hashed, and what is refused."""

import csv
import os

import numpy as np
import pytest

from hero_client.values import BODY_RADIUS_M
from hero_swarm.behavior import Behavior, Neighbors
from hero_swarm.experiments import report, runner
from hero_swarm.experiments.computing import set_up
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.experiments.robot_trial import RobotTrial
from hero_swarm.learning.vector_env import SwarmVectorEnv
from hero_swarm.safety import ROBOTS, SafetyFilter
from hero_swarm.trial import Trial

OWN = """\
import numpy as np
import scale
from hero_swarm.behavior import Behavior, Neighbors

class Counting(Behavior):
    near = Neighbors(range_m=10.0)
    speed_m_s = 0.1

    def step(self, sensed, memory, random):
        return self.speed_m_s, 0.0, np.ones(len(sensed.numbers)) if memory is None else memory + 1.0

    def colors(self, memory):
        return np.tile((0.0, 0.5, 0.0), (len(memory), 1))

def steps(state):
    return state.by_world(state.memory).mean(axis=1) * scale.SCALE

def seen(state):
    assert state.radii_m.shape == (3,) and state.arena.name == "open" and state.colors[0, 1] == 0.5
    return state.by_world(state.sensed.near.counts).sum(axis=1)
"""

FILE = """\
behavior: own.py
vary: {speed_m_s: [0.05, 0.1]}
robots: 3
time_s: 3
seeds: {count: 2}
metrics: [own.py:steps, own.py:seen, {time_until: {own.py:steps: ">= 30"}}, {mean_of_last_s: {own.py:steps: 2}}]
compare: {metric: steps, between: speed_m_s}
start: {kind: circle}
"""


@pytest.fixture(name="path")
def write_files(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "scale.py").write_text("SCALE = 1.0\n")
    (tmp_path / "e.yaml").write_text(FILE)
    return tmp_path / "e.yaml"


def run(path, *options):
    runner.run_experiment(runner.parse_options([str(path), "--jobs", "1", *options]))
    with open(str(path.with_suffix("") / "runs.csv")) as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_own_metrics_see_memory_sensors_and_colors_and_are_columns(path, capsys):
    rows = run(path)
    assert len(rows) == 4
    for row in rows:
        # The behavior steps 20 times a second; the sample at 0 s follows its first step.
        assert (float(row["steps"]), float(row["seen"])) == (61.0, 6.0)
        assert float(row["time_until_steps_30_s"]) == 2.0
        assert float(row["steps_mean_of_last_2_s"]) == 51.0
    report.main([str(path.with_suffix(""))])
    assert "speed_m_s 0.1 against speed_m_s 0.05, 2 pairs: difference 0" in capsys.readouterr().out


@pytest.mark.slow
def test_an_edited_metric_or_module_of_it_is_other_code(path):
    run(path)
    path.with_name("scale.py").write_text("SCALE = 2.0\n")
    with pytest.raises(ExperimentError, match="computed by other code"):
        run(path)
    assert float(run(path, "--fresh")[0]["steps"]) == 122.0


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "return state.poses.mean()",
            r"steps \(line \d+\) gives an array of shape \(\), but must give one number .* 2 worlds \(2,\)",
        ),
        ("return 'many'", r"steps \(line \d+\) gives 'many', but must give numbers"),
        ("return state.poses[:, 0, 0] * np.nan", r"steps \(line \d+\) gives nan at 0 s, .*\(hero_swarm/metrics/own.py"),
        ("return state.by_world(None)", r"ValueError: the behavior keeps no memory, or shows no colors"),
        ("return state.memory['x']", r"IndexError: .*\(own.py, line 16\)"),
        ("state.poses[:] = 0.0", r"ValueError: .*read-only \(own.py, line 16\)"),
        ("raise SystemError('no')", r"SystemError: no \(own.py, line 16\)"),
    ],
)
def test_a_wrong_metric_is_refused_before_anything_runs(path, line, words):
    path.with_name("own.py").write_text(OWN.replace("return state.by_world(state.memory)", line + " #"))
    with pytest.raises(ExperimentError, match=words) as caught:
        run(path)
    assert "\n" not in str(caught.value) and not path.with_suffix("").exists()


@pytest.mark.slow
def test_runs_that_are_done_stay_when_a_metric_fails_later(path):
    text = "import numpy as np\n\ndef late(state):\n    return 1.0 / (state.time_s < 2 or len(state.sensed.poses) < 8)"
    path.with_name("late.py").write_text(text + " * np.ones(len(state.poses))\n")
    path.write_text(
        "behavior: rendezvous\nvary: {robots: [3, 4]}\ntime_s: 3\nseeds: {count: 2}\nmetrics: [late.py:late]\n"
    )
    with pytest.raises(
        ExperimentError, match=r"rendezvous, robots 4 with seeds 1 to 2: ZeroDivisionError: .*line 4\)$"
    ):
        run(path)
    path.with_name("late.py").write_text(text.replace("1.0 / ", "") + " * np.ones(len(state.poses))\n")
    with pytest.raises(ExperimentError, match="computed by other code"):
        run(path)
    assert len(os.listdir(str(path.with_suffix("") / "batches"))) == 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[own.py:steps,", "[other.py:steps,", "metric .*other.py: no such file"),
        (
            "own.py:seen,",
            "own.py:stops,",
            r"line 6: metric .*own.py:stops: the file has no function stops; did you mean steps\?",
        ),
        ("[own.py:steps,", "[own.py,", "line 6: metrics is 'own.py', but must be one of: .*, FILE.py:FUNCTION"),
        ('">= 30"', "30", "line 6: .*own.py:steps is 30, but must be a text such as"),
        ("own.py:seen,", "scale.py:steps,", "line 6: metrics holds 'steps' more than once"),
    ],
)
def test_a_metric_that_is_missing_or_unclear_is_refused(path, old, new, words):
    path.write_text(FILE.replace(old, new))
    with pytest.raises(ExperimentError, match=words):
        run(path)


def test_a_trial_on_robots_measures_the_same_state(path):
    experiment = parse_experiment(FILE, str(path))
    trial = RobotTrial(set_up(experiment, experiment.cells[0]), 1, ["a", "b", "c"], SafetyFilter(ROBOTS))
    poses = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    trial.safety.radii_m = np.full(3, BODY_RADIUS_M)
    for step in range(61):
        trial.step(step * 0.05, poses, np.zeros(3))
    assert trial.list_values() == (61.0, 6.0, 2.0, 51.0)


def test_rewards_are_the_gain_of_an_own_metric(tmp_path):
    path = tmp_path / "own.py"
    path.write_text("def x(state):\n    return state.poses[..., 0].mean(axis=1)\n")
    env = SwarmVectorEnv(1, 2, metric=f"{path}:x")
    env.reset(1)
    start_m = env._poses[..., 0].mean()
    total = sum(env.step(np.array([(0.5, 0.0), (0.2, 0.0)]))[1] for _ in range(10))
    np.testing.assert_allclose(total, env._poses[..., 0].mean() - start_m, atol=1e-9)


class Still(Behavior):
    near = Neighbors()

    def step(self, sensed, memory, random):
        draws = random.random()
        return draws * 0.1, 0.0, None


def test_to_read_the_state_changes_no_run():
    watched, other = Trial(Still(), robots=4, seeds=[1, 2]), Trial(Still(), robots=4, seeds=[1, 2])
    for _ in range(10):
        assert watched.state.time_s == other.rows.now_ms / 1000.0
        assert watched.step() == other.step()
    assert (watched.poses == other.poses).all() and watched.poses[0, 0, 0] != 0.0
