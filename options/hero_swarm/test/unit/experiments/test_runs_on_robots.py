"""Experiments on robots, here stepped ones: each robot counts by its own model, and all are stopped at the end."""

import argparse
from contextlib import nullcontext
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

pytest.importorskip("rospy", reason="the program needs ROS")
from hero_client.values import MODELS, NO_OBJECTS
from hero_sim.stepped import StepSwarm
from hero_swarm.experiments.computing import CellSetup
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.experiments.results_folder import ResultsFolder
from hero_swarm.ros import robot_runs

FIRST_ID = 4
EXPERIMENT = """\
behavior: %s
robots: 2
time_s: 12
seeds: {count: 1}
metrics: [consensus_error]
"""
BEHAVIOR = """\
from hero_swarm.behavior import Behavior


class Ahead(Behavior):
    def step(self, sensed, memory, random):
        return 0.1, 0.0, None
"""
ARENA = """
bounds_m: [-1, -1, 1, 1]
starts_m_deg: [[-0.3, 0.12, -25], [-0.3, -0.12, 25]]
"""


class Program:
    """The operator, who starts each trial; time is that of the stepped robots."""

    running = True

    def __init__(self, swarm):
        self.swarm, self.sleep, self.rate = swarm, swarm.sleep, swarm.rate

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def ask(self, question):
        return robot_runs.START


def run(monkeypatch, tmp_path, models):
    """Run a trial on two stepped robots whose ways meet; return the distances of their centers in m."""
    arena = tmp_path / "arena.yaml"
    arena.write_text(ARENA)
    own = tmp_path / "ahead.py"
    own.write_text(BEHAVIOR)
    with StepSwarm(2, first_id=FIRST_ID, arena=str(arena), perfect=True, model=models) as swarm:
        ids, log = [robot.robot_id for robot in swarm], swarm.log()
        source = SimpleNamespace(
            read=lambda: (swarm.rows.world.poses.copy(), np.zeros(2)), describe_missing=lambda: "", warn=pytest.fail
        )
        others = SimpleNamespace(read=lambda: np.empty((0, 3)), describe_missing=lambda: "")
        for name, value in (
            ("Program", lambda name: Program(swarm)),
            ("Swarm", lambda wanted: nullcontext(swarm) if wanted == ids else pytest.fail()),
            ("PoseSource", lambda wanted, frame: source if (wanted, frame) == (ids, "world") else pytest.fail()),
            ("ObjectSource", lambda *arguments, **options: SimpleNamespace(read=lambda: NO_OBJECTS)),
            ("OtherRobots", lambda own, frame: others if (own, frame) == (ids, "world") else pytest.fail()),
            ("_drive_to_starts", lambda *arguments: None),
            ("_record", lambda *arguments: nullcontext()),
            ("time", SimpleNamespace(monotonic=lambda: swarm.now_s)),
            ("read_duration_clock_s", lambda: swarm.now_s),
            ("rospy", SimpleNamespace(get_time=lambda: swarm.now_s, logwarn=pytest.fail)),
        ):
            monkeypatch.setattr(robot_runs, name, value)
        monkeypatch.setattr(CellSetup, "place_robots", lambda setup, seeds: swarm.rows.world.poses[None].copy())
        folder = mock.create_autospec(ResultsFolder, instance=True)
        folder.list_missing.return_value, folder.path = [(0, 1)], str(tmp_path)
        options = argparse.Namespace(robots=ids, frame="world", calibration="")
        text = robot_runs.run_on_robots(parse_experiment(EXPERIMENT % own, "e.yaml"), folder, [], options)
        assert "1 of 1 missing trials done" in text
        ((written,),) = folder.write_batch.call_args.args
        assert written.remark == "" and written.seed == 1
        swarm.sleep(1.0)  # their own watchdogs would take 2 s
        assert np.abs(swarm.rows.world.speeds_m_s).max() < 0.001
    return np.hypot(*(log.true_pose[:, 0, 0, :2] - log.true_pose[:, 0, 1, :2]).T)


@pytest.mark.slow
def test_robots_of_each_model_keep_as_far_apart_from_body_to_body(monkeypatch, tmp_path):
    radius_m, plus_radius_m = (MODELS[name].body_radius_m for name in ("hero", "hero_plus"))
    stock_m = run(monkeypatch, tmp_path, []).min() - 2.0 * radius_m
    for plus in ((4,), (4, 5)):
        distances_m = run(monkeypatch, tmp_path, ["hero_plus,robot=%d" % number for number in plus])
        bodies_m = len(plus) * plus_radius_m + (2 - len(plus)) * radius_m
        assert distances_m.min() - bodies_m == pytest.approx(stock_m, abs=0.015), plus  # of 23 mm that a HeRo+ is wider
