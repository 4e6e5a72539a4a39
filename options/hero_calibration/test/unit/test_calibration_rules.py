"""Limits of the calibration one by one: what is too old, too near, too far off; and the numbers that files hold."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hero_calibration import calibration, store
from hero_calibration.calibration import INFRARED, MOTORS, VELOCITY, WHEELS, calibrate_parts
from hero_calibration.errors import CalibrationError, EndedError
from hero_calibration.models import dead_zone, step_response
from hero_calibration.models import infrared_model as model
from hero_calibration.models.encoder_readings import make_readings
from hero_calibration.models.infrared_model import Facing
from hero_calibration.models.step_response import DEFAULT_GAINS, Response, choose_gains, find_best
from hero_calibration.procedures import wheels
from hero_calibration.procedures.infrared import InfraredResult
from hero_calibration.procedures.motors import MotorResult
from hero_calibration.procedures.placement import place_robots
from hero_calibration.procedures.velocity import VelocityResult, evaluate_test
from hero_calibration.procedures.wheels import NOMINAL_M, Leg, fit_wheels, follow_ticks
from hero_calibration.robots.probe import Probe
from hero_calibration.robots.session import Session
from hero_client.values import BODY_RADIUS_M
from hero_node import Pose
from hero_node.files import KeptCalibration
from hero_node.robot_constants import TICK_M

CAMERA_SD, NOMINAL_GAIN_M_S_US, SETTLE_S, STALE_S = (0.001, 0.001, 0.005), 0.25 / 220.0, 0.6, 3.0


class FakeProbe(Probe):
    """A robot that notes commands."""

    def __init__(self, robot_id):
        super().__init__(robot_id)
        self.sent = []

    def drive(self, angular_rad_s, linear_m_s=0.0):
        self.sent.append(("drive", angular_rad_s, linear_m_s))

    def turn(self, angle_rad):
        self.sent.append(("turn", angle_rad))

    def set_pulses(self, left_us, right_us):
        self.sent.append(("pulses", left_us, right_us))

    def stop(self):
        self.sent.append("stop")

    def write(self, key, values):
        self.sent.append((key, list(values)))


class FakeSession(Session):
    """Robots in virtual time; on_sleep is called with the time."""

    def __init__(self, count=2):
        super().__init__([FakeProbe(number) for number in range(count)])
        self.time_s, self.end_s, self.on_sleep = 100.0, math.inf, lambda now_s: None

    @property
    def now_s(self):
        return self.time_s

    def sleep(self, duration_s):
        self.time_s += duration_s
        self.on_sleep(self.time_s)
        return self.time_s < self.end_s

    def map(self, work, probes):
        for probe in probes:
            work(probe)

    def hear(self, counts=(1.0,) * 8):
        for probe in self.probes:
            probe.receive_encoder(self.time_s, self.time_s, 1, 0.0, 0.0)
            probe.receive_pose(self.time_s, Pose(0.0, 0.0, 0.0))
            probe.receive_scan(self.time_s, counts, (0.1,) * 8)


def test_a_robot_is_silent_when_one_of_its_topics_is():
    for topic in ("encoder", "odom", "laser"):
        session = FakeSession(1)
        session.hear()
        (probe,) = session.probes
        session.time_s += STALE_S
        assert probe.find_silence(session.time_s) is None
        session.time_s += 0.01
        if topic != "encoder":
            probe.receive_encoder(session.time_s, 0.0, 2, 0.0, 0.0)
        if topic != "odom":
            probe.receive_pose(session.time_s, Pose(0.0, 0.0, 0.0))
        if topic != "laser":
            probe.receive_scan(session.time_s, (1.0,) * 8, (0.1,) * 8)
        with pytest.raises(CalibrationError, match="nothing received on /hero_0/%s" % topic):
            probe.check_alive(session.time_s)


def test_readings_that_were_lost_keep_their_numbers():
    (probe,) = FakeSession(1).probes
    for seq in (1, 2, 5, 6, 3, 4, 90000, 90001):  # three came; a driver that was started again; one that jumped
        probe.receive_encoder(0.034 * seq, 0.034 * seq, seq, 1.0 * seq, 2.0 * seq)
    assert [row[1] for row in probe._encoder] == [1, 2, 5, 6, 7, 8, 9, 10]
    readings = probe.read_wheels()
    assert readings.left_ticks[2] == 5.0 and readings.right_ticks[2] == 10.0 and len(readings.heard_s) == 8


def test_a_place_is_the_mean_since_the_stop_also_across_pi():
    (probe,) = FakeSession(1).probes
    assert probe.find_place(0.0) is None
    for heard_s, place in ((1.0, (9, 9, 0)), (2.0, (1, 2, math.pi - 0.1)), (3.0, (2, 4, -math.pi + 0.3))):
        probe.receive_place(heard_s, Pose(*place))
    assert probe.find_place(2.0) == pytest.approx((1.5, 3.0, -math.pi + 0.1)) and probe.find_place(3.1) is None


def test_scans_are_averaged_since_they_were_forgotten():
    (probe,) = FakeSession(1).probes
    with pytest.raises(CalibrationError, match="no infrared readings came on /hero_0/laser"):
        probe.read_scans()
    for count in (9.0, 1.0, 3.0):
        probe.receive_scan(0.0, (count,) * 8, (count / 10.0,) * 8)
        if count == 9.0:
            probe.forget_scans()
    counts, ranges_m = probe.read_scans()
    assert probe.count_scans() == 2 and counts.tolist() == [2.0] * 8 and ranges_m == pytest.approx([0.2] * 8)
    probe.receive_scan(0.0, (1.0,) * 7, (0.1,) * 8)
    with pytest.raises(CalibrationError):
        probe.read_scans()
    assert model.read_signals([1, 9, 2, 9, 3, 9]) == [1.0, 2.0, 3.0]


def test_a_robot_that_fails_is_stopped_and_the_others_go_on(capsys):
    session, tried, moved = FakeSession(3), [], []
    session.hear()

    def evaluate(probe, count, is_last):
        assert count == len(moved)
        tried.append((probe.robot_id, is_last))
        if probe.robot_id == 1 or (probe.robot_id == 2 and len(tried) < 4):
            raise CalibrationError("bad data")

    def move(probes):
        moved.append([probe.robot_id for probe in probes])
        return len(moved)

    session.repeat("motors", 3, move, evaluate)
    assert moved == [[0, 1, 2], [1, 2], [1]] and tried[-1] == (1, True)
    assert [probe.robot_id for probe in session.active] == [0, 2]
    assert session.probes[1].failure == "motors: bad data"
    assert session.probes[1].sent == ["stop"] and not session.probes[0].sent
    told = capsys.readouterr().out.splitlines()
    assert "hero_1 once more: motors: bad data" in told and told[-1] == "hero_1 failed: motors: bad data"

    def fail_again(probe):
        raise CalibrationError("silent")

    session.for_each("velocity", fail_again, session.probes[1:2])
    assert session.probes[1].failure == "motors: bad data", "the first cause"
    assert session.probes[1].sent == ["stop", "stop"]
    silent = FakeSession(1)
    silent.repeat("motors", 3, move, evaluate)
    silent.probes[0].robot_id = 1
    silent.repeat("motors", 3, move, evaluate)
    assert silent.probes[0].failure.startswith("motors: nothing received") and moved[3:] == [[0], [1]]
    session.settle()
    assert session.time_s == pytest.approx(100.0 + SETTLE_S) and session.probes[0].sent == ["stop"]
    session.end_s = session.time_s + 0.5
    with pytest.raises(EndedError):
        session.pause(1.0)
    assert session.time_s == pytest.approx(session.end_s, abs=0.021)
    for probe in session.probes:
        probe.sent.clear()
    session.stop()
    assert [probe.sent for probe in session.probes] == [["stop"]] * 3, "also the one that failed"


def test_badly_placed_robots_may_be_placed_again_or_left_out(capsys):
    session = FakeSession(2)
    counts = {0: [1.0] * 8, 1: [30.0] + [1.0] * 7}

    def receive(now_s):
        session.hear()
        for probe in session.probes:
            probe.forget_scans()
            for _ in range(5):
                probe.receive_scan(now_s, counts[probe.robot_id], (0.1,) * 8)

    session.on_sleep = receive
    answers = iter(["", "", "s"])
    place_robots(session, False, lambda question: next(answers))
    assert session.probes[1].failure == "place: something is about 12 cm from it, at sensor rear"
    assert session.probes[0].failure is None and capsys.readouterr().out.count("hero_1: something") == 3
    with pytest.raises(EndedError):
        place_robots(session, False, lambda question: "q")
    session.probes[1].failure = None
    counts[1][0] = 1.0
    place_robots(session, False, lambda question: "")
    assert len(session.active) == 2
    counts[0][4] = counts[1][4] = 42.0
    place_robots(session, True, None)
    assert len(session.active) == 2


@pytest.mark.parametrize("ask", [None, lambda question: ""])
def test_what_sensors_saw_before_a_robot_was_placed_does_not_count(ask):
    session = FakeSession(2)
    for probe in session.probes:
        for _ in range(20):
            probe.receive_scan(session.time_s, [30.0] * 8, (0.1,) * 8)

    def receive(now_s):
        session.hear()
        for probe in session.probes:
            probe.receive_scan(now_s, [1.0] * 8, (0.1,) * 8)

    session.on_sleep = receive
    place_robots(session, False, ask)
    assert [probe.failure for probe in session.probes] == [None, None] and session.time_s > 100.0


def test_obstacles_count_beyond_their_limits():
    for counts, at_wall, is_seen in (
        ({0: 16.0}, False, False),
        ({0: 16.1}, False, True),
        ({4: 16.1}, False, True),
        ({4: 22.0}, True, False),
        ({4: 21.9}, True, True),
        ({4: 110.0}, True, False),
        ({4: 110.1}, True, True),
        ({4: 42.0, 3: 100.0, 5: 100.0}, True, False),
        ({4: 42.0, 2: 16.1}, True, True),
        ({4: 42.0, 6: 16.1}, True, True),
    ):
        found = model.find_obstacle([counts.get(index, 1.0) for index in range(8)], at_wall)
        assert (found is not None) == is_seen, counts


def face(sensor, count=42.0, left=12.0, right=12.0, moved_m=0.0):
    counts = [1.0] * 8
    counts[sensor], counts[(sensor + 1) % 8], counts[(sensor - 1) % 8] = count, left, right
    return Facing(sensor, counts, [0.1] * 8, moved_m)


def test_constants_that_no_sensor_has_are_refused():
    facings = [face(sensor) for sensor in range(8)]
    assert model.compute_calibration(facings) == pytest.approx([0.42] * 8)
    for count, is_taken in ((22.0, True), (21.9, False), (110.0, True), (110.1, False)):
        changed = [face(3, count), *(face(sensor) for sensor in range(8) if sensor != 3)]
        if is_taken:
            assert model.compute_calibration(changed)[3] == pytest.approx(count / 100.0)
            continue
        with pytest.raises(CalibrationError, match="sensor front right reads"):
            model.compute_calibration(changed)
    for moved_m, says in ((-0.08, "sensor rear would get 1.36"), (0.045, "sensor rear would get 0.13")):
        with pytest.raises(CalibrationError, match=says):
            model.compute_calibration([face(0, moved_m=moved_m), *facings[1:]])
    with pytest.raises(CalibrationError, match="sensor left would get nan"):
        model.compute_calibration([one for one in facings if one.sensor != 6])
    assert model.estimate_misalignment_rad(face(4, left=4.1, right=4.1)) == 0.0
    for left, says in ((4.0, "see no wall"), (90.0, "misaligned by")):
        with pytest.raises(CalibrationError, match=says):
            model.estimate_misalignment_rad(face(4, left=left, right=4.0))
    errors_m = model.range_errors_m([face(2, moved_m=0.01)])
    assert errors_m[2] == pytest.approx(0.1 - (0.1 + BODY_RADIUS_M - 0.01)) and np.isnan(errors_m[:2]).all()


def test_dead_zones_have_their_widths_and_sweeps_their_pulses():
    pulses = dead_zone.list_pulses()
    assert pulses[0] == pulses[-1] == 1380 and pulses[40] == pulses[41] == 1620 and len(pulses) == 82
    assert dead_zone.DeadZone(1470.0, 1531.0, 1e-3).center_us == 1500.5

    def sweep(edge_us, gain_m_s_us, rest_us):
        """Speeds of a servo that rests until rest_us, and whose line meets zero at edge_us."""
        beyond_us = [pulse - 1500 for pulse in pulses]
        return [math.copysign(gain_m_s_us * (abs(us) - edge_us), us) if abs(us) > rest_us else 0.0 for us in beyond_us]

    zone = dead_zone.find_dead_zone(pulses, sweep(80.0, 1e-3, 99.0))
    assert (zone.low_us, zone.high_us, zone.gain_m_s_us) == pytest.approx((1420.0, 1580.0, 1e-3))
    assert dead_zone.find_dead_zone(pulses, sweep(99.0, 0.01, 103.0)).high_us == pytest.approx(1599.0)
    with pytest.raises(CalibrationError, match="stops from 1399 to 1601 us, which is implausible"):
        dead_zone.find_dead_zone(pulses, sweep(101.0, 0.01, 103.0))


def test_files_hold_rounded_numbers_in_the_order_that_they_say():
    zones = [dead_zone.DeadZone(1470.4, 1530.3, 1e-3), dead_zone.DeadZone(1480.0, 1541.2, 1e-3)]
    motors = MotorResult(zones)
    assert motors.to_file() == {"motor_centers_us": [1500, 1511], "dead_zones_us": [1470, 1530, 1480, 1541]}
    assert motors.describe() == "centers 1500 and 1511 us"
    slow, quick = Response(0.3, 0.2), Response(0.1, 0.0)
    velocity = VelocityResult([slow, quick], [quick, quick], [(1.0, 2.0, 0.1), (3.0, 4.0, 0.1)])
    assert velocity.to_file() == {"velocity_gains": [1.0, 2.0, 0.1, 3.0, 4.0, 0.1], "velocity_errors": [0.2, 0.1]}
    assert velocity.describe() == "mean error 20 % before, 10 % after"
    assert slow.score == pytest.approx(0.36)
    infrared = InfraredResult([0.4200049] * 8, np.full(8, 0.01234), np.array([0.001, -0.0021] * 4))
    assert (
        infrared.to_file()["infrared_counts_m2"] == [0.42] * 8
        and infrared.to_file()["range_errors_before_m"] == [0.0123] * 8
    )
    assert infrared.describe() == "largest range error at 10 cm 12 mm before, 2 mm after"
    ticks = np.column_stack((np.arange(0.0, 601.0, 10.0), np.arange(0.0, 601.0, 10.0)))
    wheels = fit_wheels(
        [Leg(ticks, Pose(600.0 * TICK_M, 0.0, 0.0)), Leg(ticks * (-1, 1), follow_ticks(ticks * (-1, 1), NOMINAL_M))]
    )
    assert wheels.to_file()["wheels_m"] == pytest.approx([0.0492, 0.0492, 0.063], abs=1e-6)
    assert wheels.describe().startswith("diameters 49.20 and 49.20 mm, distance 63.00 mm")


def test_ticks_lead_along_arcs_and_wheels_are_scaled_by_what_was_measured():
    assert NOMINAL_M[:2] == pytest.approx(0.0492)
    ticks = np.column_stack((np.zeros(101), np.arange(101.0)))
    turn_rad = 100.0 * TICK_M / 0.063
    radius_m = 0.063 / 2.0
    expected = (radius_m * math.sin(turn_rad), radius_m * (1.0 - math.cos(turn_rad)), turn_rad)
    assert follow_ticks(ticks, NOMINAL_M) == pytest.approx(expected, abs=1e-5)
    straight = np.column_stack((np.arange(0.0, 601.0, 10.0),) * 2)
    spin = straight * (-1.0, 1.0)
    true_m = NOMINAL_M * (1.02, 0.98, 1.03)
    legs = [Leg(one, follow_ticks(one, true_m)) for one in (straight, spin, -straight)]
    result = fit_wheels(legs)
    assert result.wheels_m == pytest.approx(true_m, rel=1e-6) and result.after < 1e-3 < 1.0 < result.before
    assert CAMERA_SD == (0.001, 0.001, 0.005)
    for scale, is_taken in ((1.099, True), (1.101, False), (0.899, False)):
        true_m = NOMINAL_M * (scale, scale, 1.0)
        legs = [Leg(one, follow_ticks(one, true_m)) for one in (straight, spin)]
        if is_taken:
            assert fit_wheels(legs).wheels_m == pytest.approx(true_m, rel=1e-4)
            continue
        with pytest.raises(CalibrationError, match="did it slip"):
            fit_wheels(legs)


def test_each_wheel_is_judged_in_the_direction_of_its_turn():
    stamps_s = np.arange(0.0, 12.0, 0.034)
    left_m_s = np.where(
        (stamps_s > 2.0) & (stamps_s < 3.5), -1.0, np.where((stamps_s > 6.0) & (stamps_s < 7.5), 1.0, 0.0)
    )
    ticks = np.cumsum(left_m_s * step_response.STEP_M_S * 0.034) / TICK_M
    readings = make_readings(stamps_s, np.arange(len(stamps_s)), np.round(ticks), np.round(-0.5 * ticks), stamps_s)
    left, right = evaluate_test(readings, [2.0, 6.0], may_be_late=False)
    assert left.mean_error < 0.1
    assert right.mean_error == pytest.approx(0.5, abs=0.05)
    assert pytest.approx(2.0 * 0.08 / 0.063) == step_response.ANGULAR_RAD_S


def test_gains_are_searched_first_for_the_integral_and_scaled_to_the_servo():
    for servo_gain, scale in ((NOMINAL_GAIN_M_S_US, 1.0), (2.0 * NOMINAL_GAIN_M_S_US, 0.5), (9.0, 0.5), (1e-9, 2.0)):
        found = []
        for number in range(step_response.ROUNDS):
            response = Response(0.5 - 0.1 * (number == 2) - 0.2 * (number == 5), 0.0)
            found.append((choose_gains(found, servo_gain), response))
        tried = [gains for gains, _ in found]
        assert tried[0] == DEFAULT_GAINS
        assert tried[1:4] == [(650.0 * scale, integral * scale, 0.1) for integral in (4000.0, 6000.0, 8500.0)]
        assert tried[4:] == [(proportional * scale, 6000.0 * scale, 0.1) for proportional in (400.0, 900.0, 1400.0)]
        assert find_best(found)[0] == tried[5] and step_response.ROUNDS == 7


def test_kept_calibrations_are_restored_robot_by_robot(tmp_path, capsys):
    for number, gains in ((0, [1.0, 2.0, 0.1] * 2), (1, [3.0, 4.0, 0.1] * 2)):
        values = {"velocity_gains": gains, "wheels_m": [0.05, 0.05, 0.06]}
        store.save(store.name_file(str(tmp_path), number), KeptCalibration(number, "2026-01-01", values))
    found = store.load_calibrations(str(tmp_path), [], [1])
    assert list(found) == [1] and list(store.load_calibrations(str(tmp_path), [], None)) == [0, 1]
    session = FakeSession(2)
    assert store.restore(session, store.load_calibrations(str(tmp_path), [], None)) == 0
    assert session.probes[1].sent == [("velocity_gains", [3.0, 4.0, 0.1] * 2)], "what is measured only is not written"
    assert "hero_0: restored velocity_gains of 2026-01-01" in capsys.readouterr().out
    path = store.name_file(str(tmp_path), 0)
    with pytest.raises(CalibrationError, match="more than one file is for hero_0"):
        store.load_calibrations("", [path, path], None)
    with pytest.raises(CalibrationError, match="no calibration of these robots in %s" % tmp_path):
        store.load_calibrations(str(tmp_path), [], [7])
    session.probes[0].write = lambda key, values: (_ for _ in ()).throw(CalibrationError("no answer"))
    assert store.restore(session, store.load_calibrations(str(tmp_path), [], None)) == 1
    assert "hero_0: FAILED: restore: no answer; restored nothing" in capsys.readouterr().out


def test_wheels_drive_a_square_to_each_side_and_are_looked_at_at_rest(monkeypatch):
    driven, looked = [], []
    monkeypatch.setattr(wheels, "_drive", lambda session, probes, part: driven.append(part))
    probe = SimpleNamespace(robot_id=3, find_place=looked.append)
    session = SimpleNamespace(
        probes=[probe],
        now_s=100.0,
        pause=lambda duration_s: setattr(session, "now_s", session.now_s + duration_s),
        repeat=lambda title, tries, drive, evaluate, results: drive([probe]),
    )
    wheels.calibrate_wheels(session, None, {})
    turns_rad = [angular_rad_s * duration_s for _, angular_rad_s, duration_s in driven]
    sides_m = [linear_m_s * duration_s for linear_m_s, _, duration_s in driven]
    assert sum(turns_rad[:8]) == pytest.approx(-sum(turns_rad[8:])) and min(turns_rad[:8]) == 0.0 < turns_rad[1]
    assert sum(turns_rad[:8]) == pytest.approx(2.0 * math.pi, rel=0.1) and len(set(sides_m)) == 2
    # One look before the first part and one after each; only the second half of a stop counts.
    assert looked == pytest.approx([100.0 + (count + 0.5) * wheels.MEASURE_S for count in range(17)])


class Kept:
    """A result that a file and a table can hold."""

    def to_file(self):
        return {"motor_centers_us": [1500, 1500]}

    def describe(self):
        return "measured"


@pytest.fixture(name="calls")
def catch_parts(monkeypatch):
    """What a calibration asks of its procedures, in order; each gives every active robot a result."""
    calls = []

    def measure(name, session, *arguments):
        calls.append((name, *arguments))
        arguments[-1].update({probe.robot_id: Kept() for probe in session.active})

    def place(session, at_wall, ask):
        calls.append(("place", at_wall))
        if ask is not None:
            ask(session)

    for name in ("motors", "velocity", "infrared", "wheels"):
        monkeypatch.setattr(calibration, "calibrate_" + name, lambda *arguments, name=name: measure(name, *arguments))
    monkeypatch.setattr(calibration, "place_robots", place)
    return calls


def test_parts_follow_each_other_and_robots_are_placed_where_they_need_it(calls, tmp_path, capsys):
    def run(*parts, ask=None, tape=None):
        calls.clear()
        session = FakeSession(1)
        status = calibrate_parts(session, parts, str(tmp_path), ask, tape)
        return status, [call[:2] if call[0] == "place" else call[0] for call in calls]

    floor, wall = ("place", False), ("place", True)
    for parts, expected in (
        ((MOTORS, VELOCITY, INFRARED, WHEELS), [floor, "motors", "velocity", floor, "wheels", wall, "infrared"]),
        ((VELOCITY,), [floor, "velocity"]),
        ((MOTORS,), [floor, "motors"]),
        ((INFRARED,), [wall, "infrared"]),
        ((WHEELS,), [floor, "wheels"]),
    ):
        assert run(*parts) == (0, expected)
    assert run(MOTORS, VELOCITY)[0] == 0 and list(calls[2][1]) == [0], "velocity takes the servos' slopes"
    assert wheels.ROOM in capsys.readouterr().out
    assert run(WHEELS, tape=min)[0] == 0 and calls[1][:2] == ("wheels", min)
    capsys.readouterr()

    def lose(session):
        session.probes[0].failure = "place: lost"

    assert run(MOTORS, WHEELS, INFRARED, ask=lose) == (1, [floor]), "without a robot there is nothing to do"
    assert capsys.readouterr().out.endswith("hero_0: FAILED: place: lost\n")
    answers = iter([None])

    def end(session):
        if next(answers, EndedError):
            raise EndedError

    assert run(MOTORS, INFRARED, ask=end) == (130, [floor, "motors", wall])
    text = capsys.readouterr().out
    assert "hero_0: ok\n  motors    measured\n  %s\n" % store.name_file(str(tmp_path), 0) in text
    assert text.endswith("ended early: robots hold what the table shows, and keep the rest\n")
    assert run(INFRARED, ask=end) == (130, [wall]) and "hero_0: not measured\n" in capsys.readouterr().out


def test_a_folder_that_is_full_fails_the_robot_in_its_line(calls, tmp_path, monkeypatch, capsys):
    def refuse(*arguments):
        assert [probe.sent[-1:] for probe in session.probes] == [["stop"]] * 2, "robots stand before what may fail"
        raise OSError(28, "No space left on device", "what replaces it")

    monkeypatch.setattr(store, "save", refuse)
    session = FakeSession(2)
    assert calibrate_parts(session, (MOTORS,), str(tmp_path), None) == 1
    told = capsys.readouterr().out
    for number in range(2):
        path = store.name_file(str(tmp_path), number)
        line = f"hero_{number}: FAILED: {path} cannot be written: No space left on device\n  motors    measured\n"
        assert line in told
