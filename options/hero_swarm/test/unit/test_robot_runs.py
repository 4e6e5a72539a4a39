"""One trial on robots in virtual time: it lasts as long as its experiment says, by a time that nobody sets."""

from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

pytest.importorskip("rospy", reason="trials on robots need ROS")
import rospy

from hero_client import StoppedError
from hero_node import Clock
from hero_node.ros import ros_clock
from hero_swarm.ros import robot_runs

RATE_HZ, TRIAL_S = 10.0, 2.0


class Stage(Clock):
    """A program with one robot and the trial that it drives; the clock of ROS is ahead of the machine's time."""

    now_s = 50.0
    is_simulated, ahead_s, rate_hz, remark, lost, stop_s = False, 1000.0, RATE_HZ, "", None, np.inf

    def __init__(self, monkeypatch):
        self.times_s, self.stops, self.name, self.safety = [], 0, "hero_3", SimpleNamespace()
        self.lateness = SimpleNamespace(take_warning=lambda: "")
        for module in (ros_clock, robot_runs):
            monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now_s))
        monkeypatch.setattr(rospy, "get_time", lambda: self.now_s + self.ahead_s)
        monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: not self.is_simulated)

    def sleep(self, duration_s):
        self.now_s += duration_s
        return True

    def check_not_stopped(self):
        if self.now_s >= self.stop_s:
            raise StoppedError("stopped")

    def missing(self):
        return self.lost

    def stop(self):
        self.stops += 1

    def __iter__(self):
        yield self

    def __len__(self):
        return 1

    def read(self):
        return np.zeros((1, 3)), np.zeros(1)

    def describe_missing(self):
        return ""

    def step(self, time_s, *sensed):
        """Note the time of the trial; the clock is set by an hour, back and forth, in each step."""
        self.times_s.append(time_s)
        self.ahead_s = self.ahead_s if self.is_simulated else 4600.0 - self.ahead_s
        return (np.zeros(1), np.zeros(1)) if time_s < TRIAL_S else None

    def send(self, *speeds):
        if self.is_simulated:
            self.ahead_s += 1.0 / RATE_HZ  # twice as fast

    def drive(self):
        return robot_runs._drive(self, self, self, self, (self, self, self))


@pytest.fixture(name="stage")
def make_stage(monkeypatch):
    return Stage(monkeypatch)


def test_a_trial_lasts_as_long_as_it_should_when_the_clock_is_set(stage):
    assert stage.drive() and stage.remark == "" and stage.stops == 1
    assert stage.now_s == pytest.approx(50.0 + TRIAL_S, abs=0.11)
    assert np.diff(stage.times_s) == pytest.approx(1.0 / RATE_HZ)


def test_a_trial_lasts_its_time_of_a_simulation(stage):
    stage.is_simulated = True
    assert stage.drive() and stage.remark == ""
    assert stage.now_s == pytest.approx(50.0 + TRIAL_S / 2.0, abs=0.11)


def test_a_trial_that_ends_early_says_when(stage):
    stage.stop_s = 51.0
    assert stage.drive() and stage.remark in ("stopped at 1.0 s", "stopped at 1.1 s")
    stage.lost, stage.stop_s = "has gone", np.inf
    assert stage.drive() and stage.remark == "lost hero_3 at 0.0 s: has gone"


def test_robots_drive_to_their_starts_as_wide_as_the_widest(stage, monkeypatch):
    start_drive = mock.create_autospec(robot_runs.StartDrive, return_value=SimpleNamespace(done=True))
    monkeypatch.setattr(robot_runs, "StartDrive", start_drive)
    stage.max_body_radius_m, starts = 0.06, np.zeros((1, 3))
    robot_runs._drive_to_starts(stage, stage, starts, stage, "seed 1")
    start_drive.assert_called_once_with(starts, 0.06)
    assert stage.stops == 1


def test_a_robot_that_is_missing_counts_as_unseen_on_the_way_to_its_start(stage, monkeypatch):
    drive = mock.create_autospec(robot_runs.StartDrive, instance=True)
    drive.done, drive.lateness = False, SimpleNamespace(take_warning=lambda: "")
    drive.step.side_effect = lambda poses, *sensed: seen.append(poses.tolist()) or np.full((2, 1), 0.1)
    monkeypatch.setattr(robot_runs, "StartDrive", lambda starts, radius_m: drive)
    monkeypatch.setattr(robot_runs, "START_LIMIT_S", 1.0)
    seen, told, stage.max_body_radius_m, stage.lost = [], [], 0.06, "has gone"
    stage.report_missing, stage.fresh_proximity, stage.drive = told.append, lambda: None, pytest.fail
    robot_runs._drive_to_starts(stage, stage, np.zeros((1, 3)), stage, "seed 1")
    assert len(seen) > 1 and np.isnan(seen).all()
    assert told == [{"hero_3": "has gone"}] * len(seen)


def test_the_safety_filter_of_a_trial_knows_the_robots_that_are_not_in_it(stage):
    places = np.array([[1.0, 2.0, 0.05]])
    others = SimpleNamespace(read=lambda: places, describe_missing=lambda: "")
    assert robot_runs._drive(stage, stage, stage, stage, (stage, stage, others))
    assert stage.safety.others_m is places


def test_a_stop_of_all_robots_ends_the_drive_to_the_starts(stage, monkeypatch):
    drive = mock.create_autospec(robot_runs.StartDrive, instance=True)
    drive.done, drive.lateness = False, SimpleNamespace(take_warning=lambda: "")
    drive.step.return_value = np.array([[0.1], [0.2]])
    monkeypatch.setattr(robot_runs, "StartDrive", lambda starts, radius_m: drive)
    driven, told, warned = [], [], []
    stage.max_body_radius_m, stage.stop_s, stage.describe_missing = 0.06, 51.0, lambda: "hero_9 has no pose"
    stage.report_missing, stage.fresh_proximity, stage.warn = told.append, lambda: None, warned.append
    stage.drive, stage.warn_if_blind = lambda *speed: driven.append(speed), lambda: driven.append("checked")
    robot_runs._drive_to_starts(stage, stage, np.zeros((1, 3)), stage, "seed 1")
    assert stage.now_s == pytest.approx(51.0, abs=0.11) and stage.stops == 1
    assert driven[:2] == [(0.1, 0.2), "checked"] and len(driven) == 2 * (len(told) - 1)
    assert set(warned) == {"hero_9 has no pose"}


@pytest.mark.parametrize(
    ("answers", "expected"),
    [
        (["x", "D", robot_runs.START], robot_runs.START),
        ([robot_runs.START, robot_runs.DRIVE], robot_runs.START),
        ([robot_runs.DRIVE, robot_runs.START], robot_runs.DRIVE),
        (["x", robot_runs.END, robot_runs.START], robot_runs.END),
        ([None, robot_runs.START], robot_runs.END),
    ],
)
def test_a_trial_starts_when_the_operator_says_so(stage, answers, expected):
    left, stage.running, stage.robots = iter(answers), True, [stage]
    stage.ask = lambda question: next(left)
    assert robot_runs._ask(stage, stage, np.zeros((1, 3)), stage, "seed 1") == expected
    stage.running = False
    assert robot_runs._ask(stage, stage, np.zeros((1, 3)), stage, "seed 1") == robot_runs.END


def test_no_trial_starts_before_all_robots_are_ready(stage, capsys):
    states = [{"stop_s": 0.0}, {"stop_s": np.inf, "lost": "has gone"}]
    states += [{"lost": None, "unseen": "no pose"}, {"unseen": ""}]
    poses = [np.array([[3e-3, 4e-3, 6.3]])] + [np.full((1, 3), np.nan)] * 3
    questions, stage.running, stage.robots, stage.describe_missing = [], True, [stage], lambda: stage.unseen
    stage.read = lambda: (poses[min(len(questions), 3)], np.zeros(1))

    def ask(question):
        vars(stage).update(states[len(questions)])
        questions.append(question.partition(". Enter")[0])
        return robot_runs.START

    stage.ask = ask
    assert robot_runs._ask(stage, stage, np.zeros((1, 3)), stage, "seed 1") == robot_runs.START
    first = "seed 1: robots are up to 5 mm (hero_3) and 1 degrees (hero_3) from their places"
    assert questions == [first] + ["seed 1: hero_3 has no pose"] * 3
    assert capsys.readouterr().err.splitlines() == [
        f"seed 1: cannot start: {reason}" for reason in ("stopped", "hero_3: has gone", "no pose")
    ]


def test_the_operator_is_told_who_is_farthest_off_and_who_is_turned_most():
    swarm = SimpleNamespace(robots=[SimpleNamespace(name="hero_3"), SimpleNamespace(name="hero_7")])
    starts = np.array([(0.0, 0.0, 3.0), (1.0, 1.0, 0.25)])
    for turn_rad, degrees in (
        (0.5, "29 degrees (hero_7)"),
        (-0.5, "29 degrees (hero_7)"),
        (0.125, "16 degrees (hero_3)"),
    ):
        poses = starts + [(0.03, -0.04, -6.0), (0.0, 0.02, turn_rad)]
        source = SimpleNamespace(read=lambda poses=poses: (poses, np.zeros(2)))
        offsets = robot_runs._describe_offsets(swarm, starts, source)
        assert offsets == f"robots are up to 50 mm (hero_3) and {degrees} from their places"


def test_the_drive_to_the_starts_ends_after_two_minutes(stage, monkeypatch):
    drive = mock.create_autospec(robot_runs.StartDrive, instance=True)
    drive.done, drive.lateness = False, SimpleNamespace(take_warning=lambda: "late")
    drive.step.return_value = np.zeros((2, 1))
    monkeypatch.setattr(robot_runs, "StartDrive", lambda starts, radius_m: drive)
    stage.max_body_radius_m, warned = 0.06, []
    stage.report_missing, stage.fresh_proximity, stage.warn = mock.Mock(), lambda: None, warned.append
    stage.drive, stage.warn_if_blind = lambda *speed: None, lambda: None
    robot_runs._drive_to_starts(stage, stage, np.zeros((1, 3)), stage, "seed 1")
    assert stage.now_s - 50.0 == pytest.approx(120.0, abs=0.06) and stage.stops == 1
    assert len(drive.step.call_args_list) == pytest.approx(20.0 * 120.0, abs=2) and set(warned) == {"late"}
