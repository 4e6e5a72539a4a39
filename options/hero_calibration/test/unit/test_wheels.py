"""Wheels: simulated robots with hidden wheels are calibrated, and drift less on paths that were not used for it."""

import math

import numpy as np
import pytest
from test_calibration_procedures import make_session
from test_calibration_rules import FakeSession

from hero_calibration.errors import CalibrationError, EndedError
from hero_calibration.procedures import wheels
from hero_calibration.procedures.wheels import NOMINAL_M, Leg, calibrate_wheels, fit_wheels, follow_ticks
from hero_client.values import WHEEL_SEPARATION_M
from hero_node import Pose, invert_pose, transform_pose, wrap_angle
from hero_node.robot_constants import TICK_M
from hero_test.nonempty import nonempty

HELD_OUT = [(0.12, 0.9, 2.0), (0.15, -0.5, 3.0), (0.0, 2.0, 1.5), (0.1, 0.0, 3.0), (0.12, -1.2, 2.5), (0.1, 0.6, 3.0)]
ROOMY = {row: (2.0 * row, -3.0, 90.0) for row in range(4)}


@pytest.fixture
def session():
    return make_session(4, seed=2, places_m_deg=ROOMY)


def see(session, noise, row):
    x_m, y_m, yaw_rad = session.robots.world.poses[row] + noise.normal(0.0, (0.001, 0.001, 0.003))
    return Pose(x_m, y_m, wrap_angle(yaw_rad))


def watch(session):
    """Let a camera measure robots with an error of 1 mm and 3 mrad."""
    noise = np.random.RandomState(5)

    def measure(rows):
        for row in rows:
            session.probes[row].receive_place(session.now_s, see(session, noise, row))

    session.robots.on_cycle.append(measure)


def measure_drift(session, wheels_m):
    """Drive paths of their own; return how far (m) odometry with these wheels ends from the truth, by robot."""
    starts, ticks = session.robots.world.poses.copy(), [[robot.copy()] for robot in session.robots.ticks]
    session.robots.on_cycle.append(lambda rows: [ticks[row].append(session.robots.ticks[row].copy()) for row in rows])
    for linear_m_s, angular_rad_s, duration_s in HELD_OUT:
        end_s = session.now_s + duration_s
        while session.now_s < end_s:
            for probe in session.probes:
                probe.drive(angular_rad_s, linear_m_s)
            session.sleep(0.1)
    session.stop()
    session.sleep(1.0)
    drifts = []
    for row, (start, end) in enumerate(zip(starts, session.robots.world.poses)):
        true = transform_pose(invert_pose(Pose(*start)), Pose(*end))
        drifts.append(
            [
                float(np.hypot(found.x_m - true.x_m, found.y_m - true.y_m))
                for found in (follow_ticks(np.array(ticks[row]), wheels) for wheels in (NOMINAL_M, wheels_m[row]))
            ]
        )
    session.robots.on_cycle.pop()
    return np.array(drifts)


@pytest.mark.slow
def test_calibrated_wheels_drift_a_third_as_far_on_other_paths(session):
    watch(session)
    results = {}
    calibrate_wheels(session, None, results)
    drifts_m = measure_drift(session, [results[row].wheels_m for row in range(4)])
    before_m, after_m = np.sqrt(np.mean(np.square(drifts_m), axis=0))
    assert before_m > 0.03
    assert after_m < before_m / 3.0, drifts_m
    assert all(result.after < 1.5 < result.before for result in nonempty(results.values()))


@pytest.mark.slow
def test_a_tape_measure_finds_the_wheels_too(session):
    results, asked = {}, []

    def ask(question):
        """Place robots on marks, and measure from them with an error of a millimeter."""
        if question.startswith("Mark"):
            ask.marks = session.robots.world.poses.copy()
            return ""
        row = int(question[len("hero_")])
        asked.append(row)
        mark, here = Pose(*ask.marks[row]), Pose(*session.robots.world.poses[row])
        moved = transform_pose(invert_pose(mark), here)
        return "%.0f %.0f" % (1e3 * moved.x_m, 1e3 * moved.y_m) if "left" in question else "%.0f" % (1e3 * moved.x_m)

    calibrate_wheels(session, ask, results)
    assert asked == [0, 1, 2, 3] * 3
    wheels_m = {row: result.wheels_m for row, result in results.items()}
    before_m, after_m = np.sqrt(np.mean(np.square(measure_drift(session, wheels_m)), axis=0))
    assert after_m < before_m / 3.0


@pytest.mark.slow
def test_answers_that_are_no_numbers_are_asked_for_again(session):
    for probe in session.probes[1:]:
        probe.failure = "is not there"
    answers = iter(["", "ten", "590", "", "5", "5 x", "5, -3", "", "0 0"])
    calibrate_wheels(session, lambda question: next(answers), {})
    assert list(answers) == []


def test_wheels_that_were_measured_are_kept_if_the_next_answer_ends_it(monkeypatch):
    session, results, answers = FakeSession(2), {}, iter(["", "600", "600", "", "0 0", "0 0", "", "1 2"])

    def ask(question):
        for answer in answers:
            return answer
        raise EndedError

    monkeypatch.setattr(wheels, "_drive", lambda session, probes, part: None)
    monkeypatch.setattr(wheels, "_take_ticks", lambda probe, start_s, end_s: np.zeros((2, 2)))
    monkeypatch.setattr(wheels, "fit_wheels", lambda legs: [leg.moved[:2] for leg in legs])
    with pytest.raises(EndedError):
        calibrate_wheels(session, ask, results)
    assert results == {0: [(0.6, 0.0), (0.0, 0.0), (0.001, 0.002)]}


@pytest.mark.slow
def test_robots_that_no_camera_sees_fail_with_the_remedy(session):
    session.robots.on_cycle.append(
        lambda rows: session.now_s < 3.0 and session.probes[1].receive_place(session.now_s, Pose(0.0, 0.0, 0.0))
    )  # the second robot leaves the camera's view on its way
    results = {}
    calibrate_wheels(session, None, results)
    assert results == {}
    for probe in nonempty(session.probes[:2]):
        assert "localize does not track it: is its tag in view? Or measure by --tape" in probe.failure


def test_wheels_that_no_robot_has_are_refused():
    ticks = np.column_stack([np.arange(0.0, 600.0, 10.0)] * 2)
    legs = [Leg(ticks, Pose(0.1, 0.0, 0.0)), Leg(ticks * (-1.0, 1.0), Pose(0.0, 0.0, 1.5))]
    with pytest.raises(CalibrationError, match="did it slip, or was it touched"):
        fit_wheels(legs)


def test_a_leg_that_turns_far_ends_within_half_a_turn():
    ticks = np.column_stack((np.zeros(2), (0.0, 5.0 * WHEEL_SEPARATION_M / TICK_M)))
    assert follow_ticks(ticks, NOMINAL_M).yaw_rad == pytest.approx(5.0 - 2.0 * math.pi)


@pytest.mark.parametrize(("mount", "is_right"), [((0.0, 0.0, 0.0), True), ((0.005, 0.0, 0.087), False)])
def test_a_tag_that_sits_off_center_is_not_taken_for_wheels(mount, is_right):
    straight = np.column_stack([np.linspace(0.0, 0.3 / TICK_M, 20)] * 2)
    turn = np.linspace(0.0, WHEEL_SEPARATION_M * math.pi / 4.0 / TICK_M, 20)[:, None]
    legs = []
    for ticks in (straight, turn * (-1.0, 1.0), straight, turn * (1.0, -1.0)):
        moved = follow_ticks(ticks, NOMINAL_M * (1.01, 0.99, 1.02))
        seen = transform_pose(invert_pose(Pose(*mount)), transform_pose(moved, Pose(*mount)))
        legs.append(Leg(ticks, seen))
    if is_right:
        assert fit_wheels(legs).wheels_m == pytest.approx(NOMINAL_M * (1.01, 0.99, 1.02), rel=1e-3)
    else:
        with pytest.raises(CalibrationError, match="is its tag off-center"):
            fit_wheels(legs)
