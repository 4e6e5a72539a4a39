"""Trials on robots, on stepped ones: their ends, their values, and trials that do not count."""

import math

import numpy as np
import pytest

from hero_sim.population import place_worlds
from hero_sim.stepped import RobotRows
from hero_swarm.experiments.computing import set_up
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.experiments.robot_trial import PERIOD_S, RobotTrial, StartDrive
from hero_swarm.metrics import METRICS
from hero_swarm.safety import ROBOTS, SafetyFilter
from hero_swarm.trial import OPEN

FILE = """\
behavior: rendezvous
robots: 3
time_s: 12
seeds: {count: 1}
metrics: [consensus_error, {time_until: {consensus_error: 0.25}}]
"""
STARTS = np.array([(0.0, 0.0, 0.0), (0.6, 0.0, 2.0), (0.0, 0.6, -1.0)])


def drive(text=FILE, lost_s=math.inf, found_s=math.inf):
    """Return the trial, when it ended, and the poses then; robot 1 has no pose from lost_s to found_s."""
    experiment = parse_experiment(text, "e.yaml")
    names = ["hero_%d" % number for number in range(3)]
    trial = RobotTrial(set_up(experiment, experiment.cells[0]), 1, names, SafetyFilter(ROBOTS))
    rows = RobotRows(place_worlds(OPEN, STARTS[None], [1], 1.0))
    while True:
        time_s, poses = rows.now_ms / 1000.0, rows.world.poses.copy()
        is_lost = lost_s <= time_s < found_s
        poses[1] += math.nan if is_lost else 0.0
        speeds = trial.step(time_s, poses, np.zeros(3))
        if speeds is None:
            return trial, time_s, poses
        assert not (is_lost and np.any(speeds)), "all wait"
        rows.send_velocity(np.arange(3), *speeds)
        rows.advance(rows.now_ms + round(1000.0 / trial.rate_hz))


@pytest.mark.slow
def test_a_trial_ends_at_its_time_with_values_and_without_contact():
    trial, end_s, poses = drive()
    assert end_s == pytest.approx(12.0) and trial.remark == ""
    error_m, reached_s = trial.list_values()
    assert error_m == pytest.approx(METRICS["consensus_error"](poses[None], None)[0], abs=0.01) and error_m < 0.2
    assert 1.0 <= reached_s <= 11.0
    assert METRICS["collisions"](poses[None], None)[0] == 0.0


@pytest.mark.parametrize("radii_m, touching", [(0.036835, 0.0), ([0.06, 0.06, 0.036835], 1.0)])
def test_collisions_are_counted_by_the_radii_of_the_robots(radii_m, touching):
    experiment = parse_experiment(FILE.split("metrics")[0] + "metrics: [collisions]\n", "e.yaml")
    safety = SafetyFilter(ROBOTS)
    safety.radii_m = radii_m
    trial = RobotTrial(set_up(experiment, experiment.cells[0]), 1, ["hero_0", "hero_1", "hero_2"], safety)
    poses = np.array([(0.0, 0.0, 0.0), (0.11, 0.0, 0.0), (0.0, 0.11, 0.0)])
    trial.step(0.0, poses, np.zeros(3))
    assert trial.list_values() == (touching,)


@pytest.mark.slow
def test_a_trial_ends_when_its_condition_holds():
    trial, end_s, _ = drive(FILE + "until: {consensus_error: 0.25}\n")
    error_m, reached_s = trial.list_values()
    assert end_s == reached_s < 11.0 and error_m <= 0.25


@pytest.mark.slow
def test_a_lost_pose_ends_the_trial_with_a_remark():
    trial, end_s, _ = drive(lost_s=2.5)
    assert trial.remark == "no pose of hero_1 for 2 s at 4.5 s" and end_s == pytest.approx(4.5, abs=0.06)
    assert trial.list_values()[1] == math.inf


@pytest.mark.slow
def test_robots_wait_for_a_pose_and_the_trial_goes_on():
    trial, end_s, poses = drive(lost_s=2.5, found_s=4.4)
    assert end_s == pytest.approx(12.0) and trial.remark == "" and not np.isnan(trial.list_values()).any()
    assert METRICS["consensus_error"](poses[None], None)[0] < 0.2, "they go on"


def test_a_trial_that_never_began_has_no_values():
    trial, _, _ = drive(lost_s=0.0)
    assert all(map(math.isnan, trial.list_values())) and trial.remark


def test_a_trial_with_objects_needs_the_poses_of_all():
    trial, end_s, _ = drive(FILE + "arena: box\n")
    assert trial.remark == "poses of 0 of the arena's 1 objects" and end_s == 0.0


def drive_to(places, lost_s=(0.0, 0.0)):
    """Return where robots that began at STARTS are, and when; robot 1 has no pose between two times."""
    start_drive = StartDrive(places)
    rows = RobotRows(place_worlds(OPEN, STARTS[None], [1], 1.0))
    while not start_drive.done and rows.now_ms < 120_000:
        poses = rows.world.poses.copy()
        if lost_s[0] <= rows.now_ms / 1000.0 < lost_s[1]:
            poses[1] = math.nan
        speeds = start_drive.step(poses, None, rows.now_ms / 1000.0, np.zeros(3))  # ages as PoseSource gives them
        rows.send_velocity(np.arange(3), *speeds)
        rows.advance(rows.now_ms + round(1000.0 * PERIOD_S))
        assert METRICS["collisions"](rows.world.poses[None], None)[0] == 0.0
    return rows.world.poses.copy(), rows.now_ms / 1000.0


@pytest.mark.slow
def test_robots_that_change_places_drive_around_each_other_and_turn():
    places = STARTS[[1, 2, 0]] + (0.0, 0.0, 1.0)
    poses, _ = drive_to(places)
    assert np.hypot(*(poses - places)[:, :2].T).max() < 0.015
    assert np.abs(np.remainder(poses - places + math.pi, 2.0 * math.pi) - math.pi)[:, 2].max() < 0.1


@pytest.mark.slow
def test_robots_wait_for_a_pose_that_is_lost_on_the_way():
    usual_s, later_s = drive_to(STARTS[[1, 2, 0]])[1], drive_to(STARTS[[1, 2, 0]], (3.0, 13.0))[1]
    assert 8.0 < later_s - usual_s < 14.0


def test_robots_have_arrived_when_all_were_there_for_half_a_second():
    drive, moving = StartDrive(STARTS), STARTS + (0.1, 0.0, 0.0)
    lost = STARTS.copy()
    lost[2, 2] = math.nan
    for poses, steps in ((STARTS, 9), (moving, 1), (STARTS, 9), (lost, 1), (STARTS, 9)):
        for _ in range(steps):
            speeds = drive.step(poses)
            assert speeds.shape == (2, 3) and not drive.done
            assert speeds.any() == (poses is moving)
    drive.step(STARTS)
    assert drive.done and 10 * PERIOD_S == 0.5


def test_robots_drive_to_their_starts_slower_while_poses_are_old():
    speeds_m_s = []
    for age_s in (0.0, 0.5, 1.0):
        drive = StartDrive(STARTS + (0.5, 0.0, 0.0))
        speeds_m_s.append(drive.step(STARTS, None, 100.0, np.full(3, age_s))[0].max())
        assert (age_s > 0.0) == bool(drive.lateness.take_warning())
    usual_m_s, slow_m_s, stopped_m_s = speeds_m_s
    assert 0.0 < slow_m_s < 0.5 * usual_m_s and stopped_m_s == 0.0


@pytest.mark.slow
def test_speeds_of_a_trial_are_those_between_its_samples(monkeypatch):
    monkeypatch.setitem(METRICS, "consensus_error", lambda poses, velocities, *rest: velocities[:, 0, 0])
    experiment = parse_experiment(FILE, "e.yaml")
    trial = RobotTrial(set_up(experiment, experiment.cells[0]), 1, ["a", "b", "c"], SafetyFilter(ROBOTS))
    for time_s in (0.0, 0.9, 1.05, 2.1, 2.1, 2.9):
        trial.step(time_s, STARTS + (0.2 * time_s, 0.0, 0.0), np.zeros(3))
    assert [values[0] for values in trial._samples] == pytest.approx([0.0, 0.2, 0.2])
    late = RobotTrial(set_up(experiment, experiment.cells[0]), 1, ["a", "b", "c"], SafetyFilter(ROBOTS))
    for _ in range(2):
        late.step(5.0, STARTS, np.zeros(3))
    assert [values[0] for values in late._samples] == [0.0, 0.0], "also where no time has passed"


@pytest.mark.slow
def test_a_trial_is_filtered_between_decisions_and_counts_limits(tmp_path):
    file = tmp_path / "meet.py"
    file.write_text(
        "import numpy as np\nfrom hero_swarm.behavior import Behavior\n\n\nclass Meet(Behavior):\n    rate_hz = 1.0\n\n"
        "    def step(self, sensed, memory, random):\n        x_m, y_m, yaw_rad = sensed.poses.T\n"
        "        return 5.0, 9.0 * np.sin(np.arctan2(0.2 - y_m, 0.2 - x_m) - yaw_rad), memory\n"
    )
    trial, end_s, poses = drive(FILE.replace("rendezvous", str(file)).replace("consensus_error, ", "collisions, "))
    assert trial.rate_hz == 20.0 and end_s == pytest.approx(12.0)
    assert trial.list_values()[0] == METRICS["collisions"](poses[None], None)[0] == 0.0
    assert trial.safety.calls == trial.safety.limited_calls == 241, "the last one, at 12 s, for the metrics alone"


@pytest.mark.slow
def test_metrics_of_a_trial_keep_what_they_count(tmp_path):
    file = tmp_path / "count.py"
    file.write_text(
        "import numpy as np\n\n\ndef seconds(state):\n    state.kept['seconds'] = state.kept.get('seconds', 0) + 1\n"
        "    return np.full(len(state.poses), state.kept['seconds'])\n"
    )
    trial, _, _ = drive(FILE.split("metrics")[0].replace("12", "3") + f"metrics: ['{file}:seconds']\n")
    assert trial.list_values() == (4.0,), "at 0, 1, 2 and 3 s"


def test_what_a_behavior_raises_in_a_trial_is_one_line_with_its_place(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "from hero_swarm.behavior import Behavior\n\n\nclass Mine(Behavior):\n"
        "    def step(self, sensed, memory, random):\n        return 1 / 0, 0.0, memory\n"
    )
    with pytest.raises(ExperimentError, match=r"seed 1: ZeroDivisionError: division by zero \(mine.py, line 6\)$"):
        drive(FILE.replace("rendezvous", str(file)))
