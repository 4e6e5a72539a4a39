"""Fitting the simulator to simulated robots with hidden errors, and the file of what was found."""

import functools
import math
import re
from unittest.mock import create_autospec

import numpy as np
import pytest

from hero_client.values import WHEEL_SEPARATION_M, follow_wheels
from hero_sim.errors import OptionError
from hero_sim.stepped import RobotRows
from hero_sim.world import KINDS, World, draw_errors, read_known
from hero_sim.world.arena import build_rectangle
from hero_sim.world.robot_errors import set_known
from hero_swarm import fit as fit_program
from hero_swarm.experiments.computing import set_up
from hero_swarm.experiments.computing.batch import load_checked
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.experiments.experiment_file import parse_experiment
from hero_swarm.experiments.results_folder import ResultsFolder
from hero_swarm.fitting import robot_fit
from hero_swarm.fitting.body_fit import _list_stretches, fit_body
from hero_swarm.fitting.motor_fit import _PARAMETERS, DELAY, Motors, build_errors, predict_ends
from hero_swarm.fitting.recording import (
    PULSES,
    VELOCITY,
    Recording,
    find_slips,
    interpolate_poses,
    measure_wheels,
    sample_times,
)
from hero_swarm.fitting.robot_fit import describe_fit, fit_robot
from hero_swarm.trial import OPEN
from hero_test.nonempty import nonempty

PERIOD_MS = 30
START_MS = 1015
"""Of recordings: at no time at which the firmware begins a cycle."""
HIDDEN = (
    "left_gain=1.15,right_gain=0.85,dead_zone_us=38,lag_s=0.12,left_wheel=1.05,right_wheel=0.97,"
    "wheel_separation_m=0.067,left_center_us=1522,right_center_us=1485"
)


@functools.lru_cache(maxsize=None)
def record(kind, time_s=60.0, delay_ms=0, turns=True, hidden=HIDDEN):
    """Return the recording of a robot with hidden errors that drives at random, with poses of a camera's noise.

    hidden: None for a nominal robot.
    """
    errors = draw_errors([np.random.RandomState(1)], 0.0 if hidden is None else 1.0)
    set_known(errors, 0, hidden or "friction=0")
    rows = RobotRows(World(OPEN, np.zeros((1, 3)), [np.random.RandomState(2)], errors))
    rows.advance(START_MS)
    random = np.random.RandomState(3)
    send, commands, odometry, poses = rows.send_pulses if kind == PULSES else rows.send_velocity, [], [], []
    command, next_ms, sent = None, 0.0, 0
    for now_ms in range(0, round(1000.0 * time_s), PERIOD_MS):
        if now_ms >= next_ms:
            pulses_us = np.rint(1500.0 + random.uniform(-80.0, 80.0, 2))
            speeds = (random.uniform(-0.05, 0.15), random.uniform(-2.5, 2.5) if turns else 0.0)
            command, next_ms = pulses_us if kind == PULSES else speeds, now_ms + random.uniform(600.0, 2000.0)
        if now_ms % (3 * PERIOD_MS) == 0:
            commands.append((now_ms, kind, *command))
        while sent < len(commands) and commands[sent][0] + delay_ms <= now_ms:
            send(np.arange(1), *commands[sent][2:])
            sent += 1
        rows.advance(START_MS + now_ms + PERIOD_MS)
        if not odometry or rows.odometry_ms[0] > START_MS + odometry[-1][0]:
            odometry.append((rows.odometry_ms[0] - START_MS, *rows.odometry[0, :3]))
        noise = random.normal(0.0, (0.001, 0.001, 0.01))
        poses.append((now_ms + PERIOD_MS, *(rows.world.poses[0] + noise)))
    tables = [np.array(table) for table in (commands, odometry, poses)]
    for table in tables:
        table[:, 0] /= 1000.0
    return Recording(*tables)


@pytest.mark.slow
def test_hidden_errors_come_back_and_predict_paths_not_seen():
    fit = fit_robot([record(PULSES, 45.0, delay_ms=90)])
    for key, hidden in nonempty(entry.split("=") for entry in HIDDEN.split(",")):
        assert fit.values[key] == pytest.approx(float(hidden), rel=0.005 if "center" in key else 0.1), key
    assert fit.delay_s == pytest.approx(0.09, rel=0.1)
    assert fit.after_m < fit.before_m / 3.0 and fit.after_m < 0.01


@pytest.mark.slow
def test_velocities_tell_the_body_but_no_motors():
    fit = fit_robot([record(VELOCITY, 40.0)])
    assert set(fit.values) == {"left_wheel", "right_wheel", "wheel_separation_m", "slip"}
    assert fit.values["wheel_separation_m"] == pytest.approx(0.067, rel=0.01)
    assert fit.values["right_wheel"] == pytest.approx(0.97, rel=0.01)
    lines = describe_fit(fit, 4)
    assert "no servo pulses were recorded" in lines[1]
    errors = draw_errors([np.random.RandomState(1)])
    set_known(errors, 4, lines[-1])
    assert errors.wheel_scale[0, 1] == pytest.approx(fit.values["right_wheel"], rel=1e-4)


@pytest.mark.slow
def test_a_robot_that_hardly_turns_cannot_be_fitted():
    with pytest.raises(ValueError, match="turned by .* rad only"):
        fit_robot([record(VELOCITY, 20.0, turns=False)])


EXPERIMENT = """\
behavior: milling
robots: 2
errors: %s
start: {kind: circle, gap_m: 0.2}
time_s: 1
seeds: {count: 2}
metrics: [rotation]
"""


def test_an_experiment_takes_the_errors_of_a_file_for_its_robots(tmp_path):
    file = tmp_path / "robots.errors"
    file.write_text("# found\nslip=0.01\nrobot=1,lag_s=0.11\nrobot=7,lag_s=0.3\n", encoding="utf-8")
    experiment = parse_experiment(EXPERIMENT % file, "e.yaml")
    load_checked(experiment)
    errors = set_up(experiment, experiment.cells[0]).build_trial([1, 2]).rows.world.errors
    assert errors.servo_lag_s.ravel().tolist() == [0.08, 0.11, 0.08, 0.11]
    assert set(errors.slip.ravel().tolist()) == {0.01}
    assert len(set(errors.servo_gain.ravel().tolist())) == 8  # the rest is drawn


def test_an_error_file_that_changes_makes_results_stale(tmp_path):
    file = tmp_path / "robots.errors"
    digests = set()
    for text in ("slip=0.01", "slip=0.02"):
        file.write_text(text, encoding="utf-8")
        experiment = parse_experiment(EXPERIMENT % file, "e.yaml")
        digests.add(ResultsFolder(str(tmp_path), experiment, "code").name_series(0, [1]))
    assert len(digests) == 2


def test_wrong_error_files_are_refused_with_the_line(tmp_path):
    file = tmp_path / "robots.errors"
    file.write_text("lagg_s=0.1\n", encoding="utf-8")
    for name, text in ((file, "lagg_s"), ("no_such", "no_such cannot be read")):
        with pytest.raises(ExperimentError, match="e.yaml, line 3: .*" + text):
            load_checked(parse_experiment(EXPERIMENT % name, "e.yaml"))
    with pytest.raises(OptionError, match="cannot be read"):
        read_known(str(tmp_path), range(2))


def test_a_fit_starts_from_the_drawing_within_the_limits_of_errors():
    values = {name: start for name, (start, *_) in _PARAMETERS.items() if name != DELAY}
    fitted, drawn = build_errors([Motors(values)]), build_errors([Motors({})])
    for name in nonempty(values):
        _, step, least, most = _PARAMETERS[name]
        kind = KINDS[name]
        array = kind.array
        assert np.array_equal(getattr(fitted, array), getattr(drawn, array)), name
        assert kind.least <= least < most <= kind.most and 0.0 < step < 0.1 * (most - least), name


def make_recording(duration_s, yaw_rad=0.0, turn_rad_s=0.0, speed_m_s=0.1, period_s=0.05):
    """A recording without a command of a robot that drives an arc, whose poses lie elsewhere than its odometry."""
    times_s = np.arange(0.0, duration_s + 1e-9, period_s)
    turned_rad = turn_rad_s * times_s
    forward_m = speed_m_s * np.array(
        [math.sin(turn) / turn_rad_s if turn_rad_s else time_s * 1.0 for turn, time_s in zip(turned_rad, times_s)]
    )
    left_m = speed_m_s * np.array([(1.0 - math.cos(turn)) / turn_rad_s if turn_rad_s else 0.0 for turn in turned_rad])
    wrapped_rad = np.remainder(turned_rad + math.pi, math.tau) - math.pi
    odometry = np.column_stack((times_s, forward_m, left_m, wrapped_rad))
    cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
    places_m = (2.0 + cosine * forward_m - sine * left_m, 1.0 + sine * forward_m + cosine * left_m)
    yaws_rad = np.remainder(turned_rad + yaw_rad + math.pi, math.tau) - math.pi
    return Recording(np.empty((0, 4)), odometry, np.column_stack((times_s, *places_m, yaws_rad)))


def test_wheels_roll_as_far_as_their_arcs():
    for turn_rad_s in (0.0, 0.5, -2.0):
        recording = make_recording(10.0, turn_rad_s=turn_rad_s)
        rolled_m = measure_wheels(recording, np.array([0.0, 2.5, 10.0]))
        aside_m_s = turn_rad_s * WHEEL_SEPARATION_M / 2.0
        speeds_m_s = np.array((0.1 - aside_m_s, 0.1 + aside_m_s))
        assert rolled_m == pytest.approx(np.outer((0.0, 2.5, 10.0), speeds_m_s), rel=2e-3)
        path = follow_wheels(rolled_m, WHEEL_SEPARATION_M)
        assert path[:, 2] == pytest.approx(turn_rad_s * np.array((0.0, 2.5, 10.0)), rel=2e-3)
    straight = follow_wheels(np.array([(0.0, 0.0), (1.1, 0.9), (2.2, 1.8)]), 2.0 * WHEEL_SEPARATION_M)
    step_rad = -0.2 / (2.0 * WHEEL_SEPARATION_M)
    assert straight[:, 2] == pytest.approx([0.0, step_rad, 2.0 * step_rad])
    assert straight[1, :2] == pytest.approx((math.cos(step_rad / 2.0), math.sin(step_rad / 2.0)))


def test_a_recording_is_cut_and_samples_lie_within_the_odometry():
    recording = make_recording(2.0)
    first = recording.cut(0.501)
    assert first.poses[:, 0] == pytest.approx(np.arange(0.0, 1.01, 0.05))
    assert np.array_equal(first.odometry[:, 0], first.poses[:, 0])
    assert recording.time_s == pytest.approx(2.0)
    assert sample_times(recording) == pytest.approx(np.arange(1, 40) * 0.05)
    ends = np.array(((0.0, 0.5, 0.5, 0.0), (1.5, 0.5, 0.5, 0.0)))
    assert find_slips(recording._replace(poses=ends)) == pytest.approx(np.arange(21, 31) * 0.05), "until the last pose"


def test_poses_are_interpolated_the_short_way_round():
    poses = np.array(((0.0, 0.0, 1.0, 3.0), (1.0, 2.0, 1.0, 3.2 - math.tau)))
    assert interpolate_poses(poses, np.array([0.5]))[0] == pytest.approx((1.0, 1.0, 3.1))


def test_a_body_is_fitted_to_stretches_that_have_poses_throughout():
    recording = make_recording(40.0, yaw_rad=2.5, turn_rad_s=0.4)
    assert fit_body([recording]) == pytest.approx(np.ones(3), abs=2e-3)
    stretches = list(_list_stretches(recording))
    assert [len(poses) for _, poses in stretches] == [80] * 4
    poses = recording.poses
    holed = recording._replace(poses=poses[(poses[:, 0] < 10.0) | (poses[:, 0] > 11.1)])
    assert [round(poses[0, 0], 2) for _, poses in _list_stretches(holed)] == pytest.approx(
        [round(stretches[index][1][0, 0], 2) for index in (0, 2, 3)]
    ), "a second without poses leaves a stretch out"
    assert not list(_list_stretches(recording._replace(poses=np.empty((0, 4)))))
    with pytest.raises(ValueError, match="turned by 5.8 rad only where it touched no wall; 6 are needed"):
        fit_body([make_recording(32.1, turn_rad_s=0.184)])


@pytest.mark.slow
def test_a_robot_that_was_told_nothing_is_predicted_where_it_began():
    recording = make_recording(13.0, yaw_rad=1.0)._replace(commands=np.array([(0.0, PULSES, 1500.0, 1500.0)]))
    for start_share, paths in ((0.5, 3), (0.0, 6), (0.9, 0)):
        assert Motors({}) == Motors({}, delay_s=0.0, phase_s=0.0), "as in the simulator"
        fits = [(Motors({}), np.ones(3)), (Motors({"lag_s": 0.2}, 0.1), np.ones(3))]
        ends_m = predict_ends(recording, fits, start_share, 2.0)
        assert ends_m == pytest.approx(np.full((2, paths), 0.2), abs=1e-6)


@functools.lru_cache(maxsize=None)
def drive_in_square(side_m, avoids, time_s=60.0):
    """Return the recording of a robot that wanders in a square, with or without a look at its walls."""
    errors = draw_errors([np.random.RandomState(5)])
    walls = build_rectangle(side_m, side_m, 1)
    rows = RobotRows(World(walls, np.zeros((1, 3)), [np.random.RandomState(2)], errors))
    rows.advance(START_MS)
    random, commands, odometry, poses = np.random.RandomState(4), [], [], []
    command, next_ms = (0.1, 0.0), 0.0
    for now_ms in range(0, round(1000.0 * time_s), PERIOD_MS):
        if now_ms >= next_ms:
            command, next_ms = (random.uniform(-0.05, 0.15), random.uniform(-2.0, 2.0)), now_ms + 1000.0
        linear_m_s, angular_rad_s = command
        ranges_m = rows.proximity_m[0]
        if avoids and linear_m_s > 0.0 and (ranges_m[[7, 0, 1]] < 0.14).any():
            linear_m_s = -0.08
        if avoids and linear_m_s < 0.0 and (ranges_m[[3, 4, 5]] < 0.14).any():
            linear_m_s = 0.08
        commands.append((now_ms / 1000.0, VELOCITY, linear_m_s, angular_rad_s))
        rows.send_velocity(np.arange(1), linear_m_s, angular_rad_s)
        rows.advance(START_MS + now_ms + PERIOD_MS)
        if not odometry or rows.odometry_ms[0] / 1000.0 > odometry[-1][0]:
            odometry.append((rows.odometry_ms[0] / 1000.0, *rows.odometry[0, :3]))
        noise = random.normal(0.0, (0.001, 0.001, 0.01))
        poses.append((rows.now_ms / 1000.0, *(rows.world.poses[0] + noise)))
    shift = np.array((START_MS / 1000.0, 0.0, 0.0, 0.0))
    return Recording(np.array(commands), np.array(odometry) - shift, np.array(poses) - shift)


@pytest.mark.slow
def test_stretches_in_which_wheels_turn_at_a_wall_are_left_out():
    pushing, free = drive_in_square(0.4, avoids=False), drive_in_square(1.5, avoids=True)
    assert len(find_slips(pushing)) * 0.05 > 15.0, "it pushes walls for a third of the time"
    assert len(find_slips(free)) * 0.05 < 0.5
    kept = [len(list(_list_stretches(recording))) for recording in (pushing, free)]
    assert kept[0] <= 2 < 6 <= kept[1]


@pytest.mark.slow
def test_a_robot_at_walls_gives_a_good_model_or_none():
    for side_m, avoids in ((0.4, False), (1.5, True)):
        try:
            fit = fit_robot([drive_in_square(side_m, avoids)])
        except ValueError as error:
            assert not avoids and re.search("touched no wall|after the fit|implausible|too short", str(error))
        else:
            assert fit.after_m < max(fit.before_m, robot_fit.NOISE_M)
            assert fit.values["wheel_separation_m"] == pytest.approx(0.063, rel=0.05)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ((1.0, 1.0, 0.78), "distance between the wheels 49.1 mm is implausible, more than 15 % off"),
        ((1.0, 1.2, 1.0), "right wheel 1.2 times the nominal one is implausible"),
    ],
)
@pytest.mark.slow
def test_an_implausible_body_is_refused_with_its_value(body, words, monkeypatch):
    monkeypatch.setattr(robot_fit, "fit_body", lambda recordings: np.array(body))
    monkeypatch.setattr(robot_fit, "predict_ends", lambda *arguments: np.array([[0.02], [0.01]]))
    with pytest.raises(ValueError, match=words):
        fit_robot([record(VELOCITY, 40.0)])


def write_fit(tmp_path, monkeypatch, recordings):
    """Run the program; return its exit status and the file, which held a line before."""
    monkeypatch.setattr(fit_program, "read_recordings", lambda paths: recordings)
    out = tmp_path / "robots.errors"
    out.write_text("slip=0\n")
    try:
        return fit_program.main(["x.bag", "--out", str(out)]), out.read_text()
    except ExperimentError as error:
        assert str(error) == f"no robot could be fitted; {out} is as it was"
        return None, out.read_text()


@pytest.mark.slow
def test_a_fit_that_predicts_worse_is_refused_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(robot_fit, "predict_ends", lambda *arguments: np.array([[0.031], [0.045]]))
    assert write_fit(tmp_path, monkeypatch, {3: [record(VELOCITY, 40.0)]}) == (None, "slip=0\n")
    assert (
        "hero_3: left out: held-out paths of 5 s end 45.0 mm off after the fit, 31.0 mm before: nothing is told"
        in capsys.readouterr().err
    )


def test_robots_after_one_that_cannot_be_fitted_are_fitted(tmp_path, monkeypatch, capsys):
    fits = [ValueError("too short"), robot_fit.Fit({"slip": 0.02}, 0.0, 0.02, 0.01), ValueError("turned by 1 rad only")]
    monkeypatch.setattr(fit_program, "fit_robot", create_autospec(fit_robot, side_effect=fits))
    status, text = write_fit(tmp_path, monkeypatch, {3: ["a"], 4: ["b", "c"], 6: ["d"]})
    assert status == 1 and [line for line in text.splitlines() if line[0] != "#"] == ["robot=4,slip=0.02"]
    assert capsys.readouterr().err == "hero_3: left out: too short\nhero_6: left out: turned by 1 rad only\n"
    assert [given.args for given in fit_program.fit_robot.call_args_list] == [(["a"],), (["b", "c"],), (["d"],)]


@pytest.mark.slow
def test_a_nominal_robot_has_nothing_to_correct(tmp_path, monkeypatch):
    ends_m = iter(([[0.0049], [0.006]], [[0.001], [0.001]]))
    monkeypatch.setattr(robot_fit, "predict_ends", lambda *arguments: np.array(next(ends_m)))
    nominal = record(VELOCITY, 40.0, hidden=None)
    status, text = write_fit(tmp_path, monkeypatch, {3: [nominal], 4: [nominal]})
    assert status == 0 and text.count("nothing to correct: it drives as a nominal robot\n") == 2
    for line in nonempty(line for line in text.splitlines() if line.startswith("robot=")):
        assert line.endswith(",left_wheel=1.0162,right_wheel=1.0162,slip=0.02,wheel_separation_m=0.063")


@pytest.mark.slow
def test_noise_does_not_decide_whether_a_nominal_robot_is_refused():
    fit = fit_robot([record(VELOCITY, 40.0, hidden=None)])
    assert max(fit.before_m, fit.after_m) < 0.004
    assert fit.values["left_wheel"] == pytest.approx(1.0162, abs=0.002)
