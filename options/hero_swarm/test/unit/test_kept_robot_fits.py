"""Fits of robots on short recordings: what they find must not change without a word in CHANGELOG.rst.

See hero_test.checks.kept_results.
"""

from unittest.mock import create_autospec

import numpy as np
import pytest

from hero_swarm.fitting import motor_fit, robot_fit
from hero_swarm.fitting.body_fit import _list_stretches, fit_body
from hero_swarm.fitting.motor_fit import Motors, fit_motors, predict_ends, replay_commands
from hero_swarm.fitting.recording import (
    PULSES,
    VELOCITY,
    Recording,
    find_slips,
    interpolate_poses,
    measure_wheels,
    sample_times,
)
from hero_swarm.fitting.robot_fit import Fit, describe_fit, fit_robot
from hero_test.checks.kept_results import check_sums
from hero_test.nonempty import nonempty

PERIOD_S = 0.05


def make_recording(time_s, kind=PULSES, seed=1, rest_s=(0.0, 0.0), share=0.0, sign=1.0):
    """Return a recording of odometry in curves, of poses elsewhere that are turned, and lag behind for a while."""
    random = np.random.RandomState(seed)
    times_s = np.arange(0.0, time_s, PERIOD_S)
    linear_m_s, angular_rad_s = sign * (0.06 + 0.05 * np.sin(times_s / 2.0)), 1.5 * np.cos(times_s / 3.0 + seed)
    yaw_rad = np.cumsum(angular_rad_s) * PERIOD_S
    x_m, y_m = (np.cumsum(linear_m_s * turned(yaw_rad)) * PERIOD_S for turned in (np.cos, np.sin))
    wrapped_rad = np.remainder(yaw_rad + np.pi, 2.0 * np.pi) - np.pi
    odometry = np.column_stack((times_s, x_m, y_m, wrapped_rad))
    moves = np.where((times_s >= rest_s[0]) & (times_s < rest_s[1]), share, 1.0)
    turned_rad = 0.7 + 1.03 * np.cumsum(angular_rad_s * moves) * PERIOD_S
    places_m = [np.cumsum(0.97 * linear_m_s * moves * turned(turned_rad)) * PERIOD_S for turned in (np.cos, np.sin)]
    poses = np.column_stack((times_s + 0.01, *places_m, np.remainder(turned_rad + np.pi, 2.0 * np.pi) - np.pi))
    poses[:, 1:] += random.normal(0.0, 0.001, (len(poses), 3))
    told_s = np.arange(0.0, time_s, 0.3)
    pulses = np.rint(1500.0 + random.uniform(-70.0, 70.0, (len(told_s), 2)))
    speeds = random.uniform((-0.05, -2.0), (0.15, 2.0), (len(told_s), 2))
    commands = np.column_stack((told_s, np.full(len(told_s), kind), pulses if kind == PULSES else speeds))
    return Recording(commands, odometry, poses[:: 1 + seed % 2])


MOTORS = [
    Motors({}),
    Motors({"left_gain": 1.2, "lag_s": 0.15, "left_center_us": 1507.0}, 0.06, 0.016),
    Motors({"right_gain": 0.8, "dead_zone_us": 45.0, "right_center_us": 1290.0}, 0.0, 0.04),
]


@pytest.mark.parametrize(
    ("kind", "kept"), [(PULSES, [-1.8514286, 0.2674275, 468]), (VELOCITY, [0.0071181, -0.2380986, 468])]
)
def test_commands_are_replayed_as_they_were(kind, kept):
    recording = make_recording(4.0, kind)
    check_sums(kept, replay_commands(recording, MOTORS))


def test_motors_are_fitted_in_the_steps_that_they_were(monkeypatch):
    monkeypatch.setattr(motor_fit, "_ITERATIONS", 2)
    found = []
    for motors in fit_motors([make_recording(3.0), make_recording(2.5, seed=2)]):
        found += [*motors.values.values(), motors.delay_s, motors.phase_s]
    check_sums([1942.815382, 380.8751977, 16], *found)


def test_a_body_is_fitted_to_curves_as_it_was():
    recordings = [make_recording(30.0), make_recording(40.0, seed=2, rest_s=(9.0, 12.0))]
    lengths = [[len(poses) for _, poses in _list_stretches(recording)] for recording in recordings]
    check_sums([17.7852784, -168.3426207, 9], fit_body(recordings), *lengths)


@pytest.mark.parametrize(
    ("kind", "kept"), [(PULSES, [0.3452531, 0.4229561, 39]), (VELOCITY, [-0.0014432, 0.0492524, 39])]
)
def test_ends_of_paths_are_predicted_as_they_were(kind, kept):
    recording = make_recording(15.0, kind, rest_s=(9.0, 10.5))
    robots = [(motors, np.array(body)) for motors, body in zip(MOTORS, ((1, 1, 1), (1.02, 0.99, 1.03), (1, 1.05, 1)))]
    late = recording._replace(poses=recording.poses[recording.poses[:, 0] > 1.7])
    given = [(recording, share) for share in (0.0, 0.3, 0.8)] + [(late, 0.0)]
    check_sums(kept, *(predict_ends(one, robots, share, 2.0) for one, share in given))


def test_recordings_are_read_at_times_as_they_were():
    recording = make_recording(12.0, seed=2, rest_s=(4.0, 6.5))
    times_s, cut = sample_times(recording), recording.cut(0.61)
    found = times_s, measure_wheels(recording, times_s), find_slips(recording), interpolate_poses(cut.poses, times_s)
    check_sums([-1083.626786, 1537.4239643, 2803], *found, *cut)
    none = find_slips(make_recording(0.9))
    assert none.shape == (0,)


def test_samples_at_which_poses_lag_behind_wheels_are_those_that_were():
    found = []
    for seed, sign in ((1, 1.0), (2, -1.0), (3, 1.0)):
        recording = make_recording(24.0, seed=seed, rest_s=(3.0, 22.0), share=0.52, sign=sign)
        slips_s = find_slips(recording)
        assert 5 < len(slips_s) < 350, "only some"
        found += [slips_s, len(slips_s)]
    check_sums([-97.3419688, -29.9278207, 231], *found)


def test_a_fit_is_told_with_its_errors_and_its_delay():
    values = {"left_wheel": 1.0123456, "slip": 0.02}
    assert describe_fit(Fit(values, 0.0, 0.0123, 0.0045), 3) == [
        "# hero_3: held-out paths of 5 s end 4.5 mm off, before the fit 12.3 mm",
        "# hero_3: no servo pulses were recorded, so motors are nominal",
        "robot=3,left_wheel=1.0123,slip=0.02",
    ]
    assert describe_fit(Fit({"lag_s": 0.1}, 0.0316, 0.004, 0.004), 12) == [
        "# hero_12: nothing to correct: it drives as a nominal robot",
        "# hero_12: held-out paths of 5 s end 4.0 mm off, before the fit 4.0 mm",
        "# hero_12: commands work 32 ms later than in the simulator",
        "robot=12,lag_s=0.1",
    ]


def test_a_fit_is_judged_by_the_third_that_it_has_not_seen(monkeypatch):
    recordings, body = [make_recording(30.0), make_recording(15.0, seed=2)], np.array((1.01, 0.99, 1.02))
    motors = [Motors({"lag_s": 0.1}, 0.02), Motors({"lag_s": 0.1}, 0.02, 0.01)]
    results = {"fit_body": {"return_value": body}, "fit_motors": {"return_value": motors}}
    ends_m = [np.array([[0.02, 0.06], [0.01, 0.03]]), np.array([[0.03], [0.02]])]
    for name, result in {**results, "predict_ends": {"side_effect": ends_m}}.items():
        monkeypatch.setattr(robot_fit, name, create_autospec(getattr(robot_fit, name), **result))
    fit = fit_robot(recordings)
    for fitted in nonempty((robot_fit.fit_body, robot_fit.fit_motors)):
        assert [seen.time_s for seen in fitted.call_args.args[0]] == pytest.approx([20.0, 10.0], abs=0.06)
    judged = robot_fit.predict_ends.call_args_list
    assert [id(call.args[0]) for call in judged] == list(map(id, recordings))
    assert [[motors for motors, _ in call.args[1]] for call in judged] == [[Motors({}), own] for own in motors]
    assert [call.args[2:] for call in judged] == [(pytest.approx(2.0 / 3.0), 5.0)] * 2
    assert (fit.before_m, fit.after_m, fit.delay_s) == (0.03, 0.02, 0.02)
    lost = 1.0 - 0.02 * np.sqrt(2.0 / np.pi)
    expected = {"lag_s": 0.1, "left_wheel": 1.01 / lost, "right_wheel": 0.99 / lost, "slip": 0.02}
    assert fit.values == pytest.approx({**expected, "wheel_separation_m": 1.02 * 0.063})
