"""Trials on robots one after the other: what is recorded and kept of each, also where one fails or the user ends."""

import argparse
import contextlib
import subprocess
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

pytest.importorskip("rospy", reason="trials on robots need ROS")
from hero_client import Program
from hero_client.values import MODELS
from hero_node import end_process
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.results_folder import REAL, ResultsFolder, Run
from hero_swarm.experiments.robot_trial import RobotTrial
from hero_swarm.ros import own_readings, pose_source, robot_runs, wheel_commands
from hero_swarm.ros.robot_runs import DRIVE, END, RECORD_END_S, RECORD_START_S, START

IDS = [3, 8]


class Bench:
    """Two robots, one of them a HeRo+, and what is done with them, in its order."""

    def __init__(self, monkeypatch, missing):
        self.steps, self.answers, self.finished, self.remarks = [], [], [], []
        robots = [
            SimpleNamespace(name="hero_%d" % number, robot_id=number, model=MODELS[model])
            for number, model in zip(IDS, ("hero", "hero_plus"))
        ]
        self.experiment = SimpleNamespace(cells=[make_cell("few"), make_cell("many")], time_s=60.0)
        self.folder = mock.create_autospec(ResultsFolder, instance=True)
        self.folder.path = "results"
        self.folder.list_missing.side_effect = lambda runs, kind: missing if (runs, kind) == ([], REAL) else None
        self.folder.read_runs.return_value = ["all runs"]
        self.folder.write_batch.side_effect = lambda runs: self.steps.append(("keep", *runs))
        self.folder.write_table.side_effect = lambda runs: self.steps.append(("table", *runs))
        setup = mock.Mock(spec_set=["place_robots", "behavior"])
        setup.place_robots.side_effect = lambda seeds: np.zeros((len(seeds), len(IDS), 3))
        for name, value in (
            ("Program", lambda name: contextlib.nullcontext("program")),
            ("Swarm", lambda ids: contextlib.nullcontext(robots) if ids == IDS else None),
            ("PoseSource", mock.create_autospec(pose_source.PoseSource)),
            ("ObjectSource", mock.create_autospec(pose_source.ObjectSource)),
            ("OtherRobots", mock.create_autospec(pose_source.OtherRobots)),
            ("OwnReadings", mock.create_autospec(own_readings.OwnReadings)),
            ("WheelCommands", mock.create_autospec(wheel_commands.WheelCommands)),
            ("set_up", lambda experiment, cell: setup),
            ("RobotTrial", mock.create_autospec(RobotTrial, side_effect=self.make_trial)),
            ("_drive_to_starts", lambda *_: self.steps.append("to the start")),
            ("_ask", lambda *_: self.answers.pop(0)),
            ("_record", self.record),
            ("_drive", self.drive),
        ):
            monkeypatch.setattr(robot_runs, name, value)

    def make_trial(self, setup, seed, names, safety, readings):
        assert names == ["hero_3", "hero_8"]
        self.radii_m = safety.radii_m
        safety.calls, safety.limited_calls = 4, 1
        return SimpleNamespace(remark="", list_values=lambda: (float(seed), 0.5), safety=safety)

    @contextlib.contextmanager
    def record(self, program, path, name, ids, time_s):
        assert (program, path, ids, time_s) == ("program", "results", IDS, 60.0)
        self.steps.append("record " + name)
        try:
            yield
        finally:
            self.steps.append("recorded")

    def drive(self, program, swarm, trial, commands, sources):
        self.steps.append("drive")
        trial.remark = self.remarks.pop(0) if self.remarks else ""
        return self.finished.pop(0) if self.finished else True

    def run(self):
        options = argparse.Namespace(robots=IDS, frame="map", calibration="~/calibration")
        return robot_runs.run_on_robots(self.experiment, self.folder, [], options)


def make_cell(label):
    return SimpleNamespace(label=label, settings={"robots": len(IDS)})


def test_each_trial_is_kept_with_its_remark_before_the_next_one(monkeypatch, capsys):
    bench = Bench(monkeypatch, [(0, 5), (1, 5)])
    bench.answers, bench.remarks = [DRIVE, START, START], ["stopped at 3.0 s", ""]
    line = bench.run()
    kept = [Run(0, 5, (5.0, 0.5), REAL, "stopped at 3.0 s"), Run(1, 5, (5.0, 0.5), REAL, "")]
    first, second = (
        ["record cell_%d_seed_5" % (cell + 1), "drive", "recorded", ("keep", kept[cell]), ("table", "all runs")]
        for cell in (0, 1)
    )
    assert bench.steps == ["to the start", "to the start", *first, "to the start", *second]
    assert line == "results/runs.csv: 1 of 2 missing trials done; start it again for the others"
    told = capsys.readouterr().out.splitlines()
    assert "few, seed 5: does not count: stopped at 3.0 s" in told and "many, seed 5: done" in told
    assert "many, seed 5: in 25 % of the steps the behavior asked for more than robots can drive: limited" in told
    assert bench.radii_m == [MODELS[model].body_radius_m for model in ("hero", "hero_plus")]


@pytest.mark.parametrize("ends_by", ["answer", "signal"])
def test_a_trial_that_the_user_ends_is_not_kept_and_none_follows(monkeypatch, ends_by):
    bench = Bench(monkeypatch, [(0, 5), (0, 6), (0, 7)])
    bench.answers = [START, END] if ends_by == "answer" else [START, START]
    bench.finished = [True, False]
    assert "1 of 3 missing trials done; start it again for the others" in bench.run()
    assert [step[0] for step in bench.steps if step[0] in ("keep", "table")] == ["keep", "table"]
    assert bench.steps[-1] == ("to the start" if ends_by == "answer" else "recorded")


def test_an_experiment_for_other_robots_than_those_named_is_refused(monkeypatch):
    bench = Bench(monkeypatch, [(0, 5)])
    bench.experiment.cells[1].settings["robots"] = 3
    with pytest.raises(ExperimentError, match="--robots names 2 robots, but many has 3"):
        bench.run()
    assert bench.steps == []


class Recorder:
    """The recorder as a process: when its first file is there, and when it ends."""

    def __init__(self, monkeypatch, folder, starts_s=1.0, ends_s=np.inf, stops_s=np.inf):
        self.now_s, self.folder, self.limits_s = 0.0, folder, (starts_s, ends_s, stops_s)
        self.commands, self.waits_s, self.process = [], [], mock.create_autospec(subprocess.Popen, instance=True)
        self.process.poll.side_effect = lambda: None if self.now_s < self.limits_s[1] else 1
        self.program = mock.create_autospec(Program, instance=True)
        self.program.sleep.side_effect = self.sleep
        monkeypatch.setattr(robot_runs.subprocess, "Popen", self.start)
        monkeypatch.setattr(robot_runs.time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(robot_runs, "end_process", mock.create_autospec(end_process, side_effect=self.end))

    def start(self, command, stdin):
        assert stdin == subprocess.DEVNULL, "answers of the operator are not for it"
        self.commands.append(command)
        return self.process

    def end(self, process, patience_s):
        assert process is self.process
        self.waits_s.append(patience_s)

    def sleep(self, duration_s):
        self.now_s += duration_s
        if self.now_s >= self.limits_s[0]:
            (self.folder / "bags" / "cell_1_seed_5_0.bag.active").touch()
        return self.now_s < self.limits_s[2]

    def record(self):
        return robot_runs._record(self.program, str(self.folder), "cell_1_seed_5", IDS, 60.0)


@pytest.mark.parametrize("error", [None, ExperimentError("no"), KeyboardInterrupt(), ZeroDivisionError()])
def test_the_recorder_ends_with_the_trial_whatever_ends_that(monkeypatch, tmp_path, error):
    (tmp_path / "bags").mkdir()
    (tmp_path / "bags" / "cell_1_seed_5_of_before.bag").touch()
    recorder = Recorder(monkeypatch, tmp_path)
    with pytest.raises(type(error)) if error else contextlib.nullcontext(), recorder.record():
        assert recorder.now_s == pytest.approx(1.0, abs=0.11) and recorder.waits_s == [], "it writes now"
        if error:
            raise error
    assert recorder.waits_s == [RECORD_END_S]
    (command,) = recorder.commands
    words = dict(zip(command, command[1:]))
    assert words["--folder"] == str(tmp_path / "bags") and words["--name"] == "cell_1_seed_5"
    assert words["--robots"] == "3 8" and words["--seconds"] == "80"


@pytest.mark.parametrize("limits", [{"ends_s": 0.5}, {"starts_s": np.inf}])
def test_without_a_recorder_there_is_no_trial(monkeypatch, tmp_path, limits):
    (tmp_path / "bags").mkdir()
    recorder = Recorder(monkeypatch, tmp_path, **limits)
    with pytest.raises(ExperimentError, match="the trial is not recorded"), recorder.record():
        pytest.fail("a trial began")
    assert recorder.waits_s == [RECORD_END_S] and recorder.now_s <= RECORD_START_S + 0.2


def test_a_program_that_is_to_end_waits_for_no_file(monkeypatch, tmp_path):
    (tmp_path / "bags").mkdir()
    recorder = Recorder(monkeypatch, tmp_path, starts_s=np.inf, stops_s=0.3)
    with recorder.record():
        assert recorder.now_s < 0.5
    assert recorder.waits_s == [RECORD_END_S]
