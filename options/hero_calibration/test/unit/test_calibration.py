"""Dead zones, step responses and infrared constants of robots with known true values."""

import math
import re
import sys
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from hero_calibration import calibrate
from hero_calibration.errors import CalibrationError
from hero_calibration.models import dead_zone, encoder_readings, step_response
from hero_calibration.models import infrared_model as model
from hero_calibration.models.infrared_model import Facing
from hero_calibration.procedures import infrared
from hero_client.values import BODY_RADIUS_M
from hero_node.robot_constants import TICK_M


def servo_speeds(pulses_us, center_us, zone_us=30.0, sign=1.0, noise_m_s=0.0, seed=0):
    """Speeds of a servo, as ticks in a step of 0.25 s show them."""
    beyond = np.asarray(pulses_us, dtype=float) - center_us
    speeds = np.sign(beyond) * np.maximum(np.abs(beyond) - zone_us, 0.0) * 0.25 / 220.0
    speeds = speeds + np.random.RandomState(seed).normal(0.0, 1.0, len(speeds)) * noise_m_s * (speeds != 0.0)
    tick_m_s = TICK_M / 0.25
    return sign * np.round(speeds / tick_m_s) * tick_m_s


def publish_stamps(times_s, setting=None, late=None):
    """Return stamps as the driver publishes them: never backwards.

    setting: (when, by how much) the robot sets its clock; late: (from, to) the network stalls, and stamps are times of
    arrival.
    """
    stamps_s = np.array(times_s)
    if setting is not None:
        stamps_s += np.where(times_s >= setting[0], setting[1], 0.0)
    if late is not None:
        stamps_s = np.where((times_s >= late[0]) & (times_s < late[1]), late[1], stamps_s)
    published_s = [stamps_s[0]]
    for stamp_s in stamps_s[1:]:
        published_s.append(max(stamp_s, published_s[-1] + 1e-6))
    return np.array(published_s)


DISTURBED = [
    {"setting": (10.5, -0.3)},
    {"setting": (10.5, -0.07)},
    {"setting": (10.5, -0.04)},
    {"setting": (10.5, 0.07)},
    {"setting": (10.5, 0.3)},
    {"late": (10.3, 10.4)},
    {"late": (10.3, 10.65)},
]


def make_readings(stamps_s, left_ticks, right_ticks=None, counts=None, heard_s=None):
    """Return readings; by default none is lost, and all arrive at their stamps."""
    right_ticks = left_ticks if right_ticks is None else right_ticks
    counts = np.arange(len(stamps_s)) if counts is None else counts
    heard_s = stamps_s if heard_s is None else heard_s
    return encoder_readings.make_readings(stamps_s, counts, left_ticks, right_ticks, heard_s)


class TestReadings:
    def test_steps_are_even_and_times_follow_stamps_on_a_good_network(self):
        times_s = 1.6e9 + np.arange(100) * 0.034
        readings = make_readings(times_s, np.arange(100.0))
        assert readings.step_s == pytest.approx(0.034)
        assert readings.times_s == pytest.approx(times_s, abs=0.001)
        assert readings.is_even.all()
        assert readings.find_even(3).shape == (97,)

    @pytest.mark.parametrize("disturbance", DISTURBED)
    def test_steps_stay_even_when_the_clock_is_set_or_the_network_stalls(self, disturbance):
        times_s = np.arange(9.0, 13.0, 0.034)
        readings = make_readings(publish_stamps(times_s, **disturbance), times_s)
        assert readings.step_s == pytest.approx(0.034, rel=0.01)
        # A clock that is set forward looks like a pause.
        assert np.count_nonzero(~readings.is_even) <= 1
        is_far = np.abs(times_s - 10.5) > 0.5
        before_and_after = publish_stamps(times_s, disturbance.get("setting"))
        assert readings.times_s[is_far] == pytest.approx(before_and_after[is_far], abs=0.02)

    @pytest.mark.parametrize("pause_s", [0.02, 0.1, 1.0])
    def test_a_pause_of_the_robot_is_found(self, pause_s):
        times_s = np.arange(9.0, 12.0, 0.034)
        times_s += np.where(times_s > 10.5, pause_s, 0.0)
        readings = make_readings(times_s, times_s)
        assert np.flatnonzero(~readings.is_even).tolist() == [int(np.count_nonzero(times_s <= 10.5)) - 1]

    def test_lost_readings_are_no_pause(self):
        counts = np.delete(np.arange(100), [40, 41, 60])
        readings = make_readings(9.0 + counts * 0.034, counts * 2.0, counts=counts)
        assert readings.is_even.all()
        assert readings.step_s == pytest.approx(0.034)

    def test_one_reading_or_none_has_no_steps(self):
        for count in (0, 1):
            readings = make_readings(np.arange(count) * 0.034, np.zeros(count))
            assert len(readings.is_even) == len(readings.find_even(3)) == 0


class TestDeadZone:
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize("center_us", [1440.0, 1478.5, 1500.0, 1533.0, 1560.0])
    def test_the_center_is_found_to_3_us_for_both_mountings_of_the_servo(self, center_us, sign):
        pulses_us = dead_zone.list_pulses()
        zone = dead_zone.find_dead_zone(pulses_us, servo_speeds(pulses_us, center_us, sign=sign, noise_m_s=0.001))
        assert zone.center_us == pytest.approx(center_us, abs=3.0)
        assert zone.high_us - zone.low_us == pytest.approx(60.0, abs=6.0)

    @pytest.mark.parametrize("disturbance", [{}, *DISTURBED])
    def test_the_speed_at_each_step_is_right_with_uncertain_stamps(self, disturbance):
        start_times_s = 10.0 + np.arange(8) * dead_zone.PULSE_S
        stamps_s = np.arange(9.0, 14.0, 0.034)
        speeds_m_s = 0.02 * np.clip(np.floor((stamps_s - 10.1) / dead_zone.PULSE_S), -1, 7)
        ticks = np.cumsum(speeds_m_s * 0.034) / TICK_M
        heard_s = publish_stamps(stamps_s, late=disturbance.get("late"))
        readings = make_readings(publish_stamps(stamps_s, **disturbance), ticks, -ticks, heard_s=heard_s)
        left, right = dead_zone.measure_sweep(readings, start_times_s)
        # A clock that is off by 0.3 s takes readings of the previous step.
        is_far = abs(disturbance.get("setting", (0.0, 0.0))[1]) > 0.2
        expected = 0.02 * np.arange(8)
        if disturbance.get("late") == (10.3, 10.65):
            expected[1] = np.nan  # sent in a silence
        assert left == pytest.approx(expected, abs=0.021 if is_far else 0.006, nan_ok=True)
        assert right == pytest.approx(-left, nan_ok=True)

    @pytest.mark.parametrize("missing", [0.2, 0.33, 0.49])
    def test_the_center_is_found_with_many_steps_missing(self, missing):
        pulses_us = np.array(dead_zone.list_pulses())
        speeds = servo_speeds(pulses_us, 1533.0)
        speeds[np.random.RandomState(1).permutation(len(pulses_us)) < missing * len(pulses_us)] = np.nan
        assert dead_zone.find_dead_zone(pulses_us, speeds).center_us == pytest.approx(1533.0, abs=4.0)

    def test_the_center_of_a_servo_that_lags_is_found(self):
        pulses_us = np.array(dead_zone.list_pulses())
        lagging_us = pulses_us - 3.0 * np.sign(np.diff(pulses_us, append=pulses_us[-1] - 1))
        zone = dead_zone.find_dead_zone(pulses_us, servo_speeds(lagging_us, 1490.0))
        assert zone.center_us == pytest.approx(1490.0, abs=2.0)

    def test_sweeps_that_disagree_are_refused(self):
        pulses_us = np.array(dead_zone.list_pulses())
        got_us = np.where(np.arange(len(pulses_us)) < 41, pulses_us - 12, pulses_us)
        with pytest.raises(CalibrationError, match="us with rising pulses and around 149[01] us with falling"):
            dead_zone.find_dead_zone(pulses_us, servo_speeds(got_us, 1490.0))

    @pytest.mark.parametrize("apart", [40, 46, 52])
    def test_a_wrong_speed_beside_the_dead_zone_does_not_move_it(self, apart):
        pulses_us = np.array(dead_zone.list_pulses())
        speeds = servo_speeds(pulses_us, 1490.0)
        speeds[np.flatnonzero(pulses_us == 1490 + apart)[0]] = 0.13
        assert dead_zone.find_dead_zone(pulses_us, speeds).center_us == pytest.approx(1490.0, abs=1.5)

    @pytest.mark.parametrize("first", range(0, 82, 3))
    @pytest.mark.parametrize("late", [1, 2, 3])
    def test_late_pulses_are_noticed_or_do_no_harm(self, first, late):
        pulses_us = np.array(dead_zone.list_pulses())
        got_us = pulses_us.copy()
        got_us[first + 1 : first + 1 + late] = pulses_us[first]
        try:
            zone = dead_zone.find_dead_zone(pulses_us, servo_speeds(got_us, 1478.0))
        except CalibrationError as error:
            assert "try again" in str(error)
        else:
            assert zone.center_us == pytest.approx(1478.0, abs=1.0 + dead_zone.AGREE_US / 2.0)

    @pytest.mark.parametrize(
        ("speeds", "words"),
        [
            (lambda pulses: servo_speeds(pulses, 1500.0) * 0.0, "does not turn at any pulse.*plugged in"),
            (lambda pulses: servo_speeds(pulses, 1650.0), "does not stop between"),
            (lambda pulses: np.maximum(servo_speeds(pulses, 1500.0), 0.0), "does not stop between"),
        ],
    )
    def test_a_wheel_without_a_dead_zone_is_refused_with_the_reason(self, speeds, words):
        pulses_us = dead_zone.list_pulses()
        with pytest.raises(CalibrationError, match=words):
            dead_zone.find_dead_zone(pulses_us, speeds(pulses_us))


def drive_wheel(lag_s, steady=1.0, delay_s=0.05, stop_s=math.inf):
    """Times and ticks of a wheel that is commanded at 10 s, and to stop stop_s later."""
    stamps_s = np.arange(9.0, 12.0, 0.034)
    since_s = np.maximum(np.minimum(stamps_s - 10.0, stop_s) - delay_s, 0.0)
    distance_m = steady * step_response.STEP_M_S * (since_s - lag_s * (1.0 - np.exp(-since_s / lag_s)))
    return stamps_s, np.floor(distance_m / TICK_M)


def measure(times_s, ticks, **disturbance):
    """Return the response of a wheel that was commanded at 10 s."""
    readings = make_readings(publish_stamps(times_s, **disturbance), ticks)
    start = step_response.find_start(readings, 10.0)
    curve = step_response.measure_speed(readings, ticks, start, 10.0 + step_response.STEP_S)
    return step_response.evaluate_response([curve])


class TestSpeedResponse:
    def test_a_quick_wheel_scores_better_than_a_slow_one(self):
        quick, slow = (measure(*drive_wheel(lag_s)) for lag_s in (0.1, 0.4))
        assert quick.score < slow.score
        assert quick.mean_error == pytest.approx(0.1 / 1.4, abs=0.05)
        assert slow.mean_error == pytest.approx(0.4 / 1.4, abs=0.06)

    @pytest.mark.parametrize("disturbance", DISTURBED)
    def test_uncertain_stamps_do_not_change_the_response(self, disturbance):
        steady, disturbed = measure(*drive_wheel(0.1)), measure(*drive_wheel(0.1), **disturbance)
        assert disturbed.mean_error == pytest.approx(steady.mean_error, abs=0.02)
        assert disturbed.overshoot == pytest.approx(steady.overshoot, abs=0.02)

    def test_a_pause_is_not_mistaken_for_a_fast_wheel(self):
        times_s, ticks = drive_wheel(0.1)
        kept = (times_s < 10.6) | (times_s > 10.75)
        paused = measure(times_s[kept], ticks[kept])
        assert paused.overshoot < 0.1

    def test_the_delay_of_the_command_does_not_count(self):
        stamps_s, ticks = drive_wheel(0.1, delay_s=0.3)
        readings = make_readings(stamps_s, ticks)
        start = step_response.find_start(readings, 10.0)
        assert readings.times_s[start] == pytest.approx(10.3, abs=0.08)
        standing = make_readings(stamps_s, np.zeros(len(stamps_s)))
        assert standing.times_s[step_response.find_start(standing, 10.0)] == pytest.approx(10.0, abs=0.035)

    def test_a_late_start_shortens_the_response_or_is_refused(self):
        prompt, late = (measure(*drive_wheel(0.1, delay_s=delay_s, stop_s=1.5)) for delay_s in (0.0, 0.2))
        assert late.mean_error == pytest.approx(prompt.mean_error, abs=0.02)
        with pytest.raises(CalibrationError, match="speeds could be measured"):
            measure(*drive_wheel(0.1, delay_s=0.5, stop_s=1.5))

    def test_a_very_late_start_is_refused_unless_it_may_be_late(self):
        stamps_s, ticks = drive_wheel(0.1, delay_s=0.9)
        readings = make_readings(stamps_s, ticks)
        with pytest.raises(CalibrationError, match=r"turned only (0.9|1.0) s after its command"):
            step_response.find_start(readings, 10.0)
        start = step_response.find_start(readings, 10.0, may_be_late=True)
        assert readings.times_s[start] == pytest.approx(10.0, abs=0.035)
        with pytest.raises(CalibrationError, match="no encoder readings came"):
            step_response.find_start(make_readings(stamps_s[:0], ticks[:0]), 10.0)

    def test_a_speed_belongs_to_the_middle_between_its_readings(self):
        stamps_s = 9.0 + 0.034 * np.arange(80)
        ticks = 0.5 * np.arange(80.0)
        times_s, speeds_m_s = step_response.measure_speed(make_readings(stamps_s, ticks), ticks, 30, 12.0)
        assert times_s[:2] == pytest.approx([-2 * 0.034 + 0.051, -0.034 + 0.051])  # from 0.1 s before the start on
        assert times_s[-1] <= step_response.STEP_S - 0.1 - 0.051 < times_s[-1] + 0.034
        assert speeds_m_s == pytest.approx(0.5 * TICK_M / 0.034)

    def test_the_response_is_the_mean_of_both_directions(self):
        times_s, target = np.array([-0.1, 0.0, 0.1, 0.2]), step_response.STEP_M_S
        quick, slow = np.array([0.0, 1.0, 0.9, 1.2]), np.array([0.0, 0.5, 0.5, 0.8])
        response = step_response.evaluate_response([(times_s, target * quick), (times_s, target * slow)])
        assert response.mean_error == pytest.approx((0.3 / 3 + 1.2 / 3) / 2)
        assert response.overshoot == pytest.approx(0.2 / 2)
        assert response.score == pytest.approx(response.mean_error + 0.3 * response.overshoot)

    def test_the_search_finds_the_best_gains_within_range(self):
        def respond(gains):
            error = abs(gains[0] - 1300.0) / 5000.0 + abs(gains[1] - 12000.0) / 50000.0
            return step_response.Response(error, 0.0)

        tried = []
        for _ in range(step_response.ROUNDS):
            gains = step_response.choose_gains(tried, 1e-9)
            tried.append((gains, respond(gains)))
        assert tried[0][0] == step_response.DEFAULT_GAINS
        assert step_response.find_best(tried) == min(tried, key=lambda item: respond(item[0]).score)
        assert all(0.0 <= gain <= 17000.0 for gains, _ in tried for gain in gains)


def face_wall(alphas, sensor, misalignment_rad=0.0, moved_m=0.0):
    """Readings of a wall that one sensor faces, by the published model."""
    wall_m = model.WALL_M + BODY_RADIUS_M - moved_m
    counts = []
    for index in range(8):
        angle_rad = math.remainder((index - sensor) * model.BEAM_STEP_RAD + misalignment_rad, 2.0 * math.pi)
        sees = abs(angle_rad) < 1.2
        counts.append(alphas[index] * model.expected_brightness(angle_rad, wall_m) - 0.93 if sees else 0.5)
    ranges_m = [BODY_RADIUS_M + math.sqrt(0.5 / max(count, 0.1)) for count in counts]
    return Facing(sensor, counts, ranges_m, moved_m)


class TestInfrared:
    ALPHAS = (0.39, 0.42, 0.44, 0.36, 0.42, 0.46, 0.40, 0.43)

    def test_constants_are_found_to_3_percent_despite_misalignment_and_drift(self):
        misalignment_rad = [math.radians(angle) for angle in (0, 3, -4, 5, -2, 0, 4, -5)]
        facings = [
            face_wall(self.ALPHAS, (4 - step) % 8, misalignment_rad[step], moved_m=0.001 * (step - 3))
            for step in range(8)
        ]
        found = model.compute_calibration(facings)
        # The constant includes the offset of the signal at 10 cm: 0.93 counts.
        assert found == pytest.approx([alpha - 0.0093 for alpha in self.ALPHAS], rel=0.03)

    def test_outlying_scans_are_left_out_of_the_average(self):
        scans = np.full((10, 8), 42.0)
        scans[:2] = 4.0
        assert model.average(scans) == pytest.approx([42.0] * 8)
        scans[:, 0] = np.nan
        assert np.isnan(model.average(scans)).tolist() == [True] + [False] * 7
        assert model.average(np.array([[1.0] * 8, [3.0] * 8, [5.0] * 8])) == pytest.approx([3.0] * 8)

    def test_a_misaligned_robot_is_refused(self):
        with pytest.raises(CalibrationError, match="misaligned by [0-9]+ degrees when sensor front faces"):
            model.estimate_misalignment_rad(face_wall(self.ALPHAS, 4, math.radians(20.0)))

    def test_the_misalignment_has_the_right_sign_and_size(self):
        for degrees in (-8.0, 0.0, 8.0):
            misalignment_rad = model.estimate_misalignment_rad(face_wall([0.42] * 8, 4, math.radians(degrees)))
            assert math.degrees(misalignment_rad) == pytest.approx(degrees, abs=2.0)

    def test_a_sensor_that_sees_no_wall_is_refused(self):
        facings = [face_wall(self.ALPHAS, sensor) for sensor in range(8)]
        counts = [3.0 if index == 6 else count for index, count in enumerate(facings[6].counts)]
        facings[6] = facings[6]._replace(counts=counts)
        with pytest.raises(CalibrationError, match="sensor left reads 3 counts; 42 are typical"):
            model.compute_calibration(facings)
        with pytest.raises(CalibrationError, match="see no wall"):
            model.estimate_misalignment_rad(Facing(4, [0.5] * 8, [0.2] * 8, 0.0))

    def test_range_errors_are_unknown_without_a_calibration(self):
        facings = [face_wall(self.ALPHAS, sensor) for sensor in range(8)]
        errors_m = model.range_errors_m(facings)
        assert errors_m[0] == pytest.approx(math.sqrt(0.5 / facings[0].counts[0]) - 0.1, abs=1e-9)
        facings[2] = facings[2]._replace(ranges_m=[math.nan] * 8)
        assert math.isnan(model.range_errors_m(facings)[2])
        result = infrared.InfraredResult([], model.range_errors_m(facings), np.full(8, -0.002))
        assert result.describe() == "largest range error at 10 cm unknown (no calibration) before, 2 mm after"

    @pytest.mark.parametrize(
        ("counts", "at_wall", "words"),
        [
            ({}, False, None),
            ({0: 30.0, 1: 20.0}, False, "about 12 cm from it, at sensor rear$"),
            ({4: 42.0, 3: 20.0, 5: 20.0}, True, None),
            ({4: 42.0, 0: 20.0}, True, "at sensor rear$"),
            ({4: 5.0}, True, "front sensor reads 5 counts; 42 are typical"),
        ],
    )
    def test_obstacles_and_a_missing_wall_are_found(self, counts, at_wall, words):
        found = model.find_obstacle([counts.get(index, 1.0) for index in range(8)], at_wall)
        assert found is None if words is None else re.search(words, found)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["dance"], "parts are motors, velocity, infrared"),
        (["--yes"], "name one or the other"),
        (["--robots", "x"], "--robots"),
        (["infrared", "--yes", "--batch", "5"], "each batch has to be placed"),
        (["--batch", "0"], "--batch"),
    ],
)
def test_wrong_options_are_refused_by_name(arguments, words, capsys):
    with pytest.raises(SystemExit) as caught:
        calibrate.parse_options(arguments)
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


def test_files_to_restore_follow_the_word_restore():
    options = calibrate.parse_options(["restore", "a.yaml", "b.yaml"])
    assert (options.restore, options.files, options.parts) == (True, ["a.yaml", "b.yaml"], [])
    assert calibrate.parse_options([]).parts == ["motors", "velocity", "infrared"]


def test_a_part_alone_needs_no_question_and_folders_may_begin_with_a_tilde(monkeypatch, tmp_path):
    assert calibrate.parse_options(["infrared", "--yes"]).parts == ["infrared"]
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert calibrate.parse_options([]).folder == str(tmp_path / "hero_calibration")
    assert calibrate.parse_options(["--folder", "here"]).folder == str(tmp_path / "here")


@pytest.mark.parametrize(("statuses", "status", "count"), [((0, 1, 0), 1, 3), ((1, 130, 0), 130, 2), ((0, 0, 0), 0, 3)])
def test_batches_are_calibrated_one_after_another_until_one_is_ended(statuses, status, count, monkeypatch, tmp_path):
    probes = [SimpleNamespace(robot_id=number, name="hero_%d" % number) for number in (0, 3, 4, 8, 9)]
    calibrated, ends = [], iter(statuses)

    def run(session, parts, folder, ask, tape):
        calibrated.append([probe.robot_id for probe in session])
        return next(ends)

    monkeypatch.setattr(sys, "argv", ["calibrate", "infrared", "--batch", "2", "--folder", str(tmp_path)])
    monkeypatch.setattr(calibrate, "Program", lambda *_, **__: nullcontext())
    monkeypatch.setattr(calibrate, "find_robots", lambda program, robot_ids: probes)
    monkeypatch.setattr(calibrate, "RosSession", lambda program, batch: batch)
    monkeypatch.setattr(calibrate, "calibrate_parts", run)
    assert calibrate.main() == status
    assert calibrated == [[0, 3], [4, 8], [9]][:count]


@pytest.mark.parametrize("turned_deg", [-10.0, -3.0, 0.0, 5.0, 11.0])
@pytest.mark.parametrize("moved_m", [-0.01, 0.0, 0.02])
def test_the_neighbors_of_a_sensor_tell_how_far_the_robot_is_turned(turned_deg, moved_m):
    wall_m, turned_rad = 0.1 + BODY_RADIUS_M - moved_m, math.radians(turned_deg)
    counts = [0.0] * 8
    for sensor, side in ((5, 1.0), (3, -1.0)):  # turned to the left, the right one is nearer to the wall
        counts[sensor] = 0.42 * model.expected_brightness(math.pi / 4.0 + side * turned_rad, wall_m)
    found_rad = model.estimate_misalignment_rad(Facing(4, counts, [0.1] * 8, moved_m))
    assert found_rad == pytest.approx(turned_rad, rel=0.02 if abs(turned_deg) < 4.0 else 0.08, abs=1e-9)
