"""The procedures on simulated robots in virtual time, judged by the robots' known errors and by ground truth."""

import re
from functools import partial

import numpy as np
import pytest
from stepped_session import StepSession

from hero_calibration import store
from hero_calibration.calibration import calibrate_parts
from hero_calibration.errors import CalibrationError, EndedError
from hero_calibration.models import infrared_model
from hero_calibration.models.step_response import ANGULAR_RAD_S
from hero_calibration.procedures.infrared import calibrate_infrared
from hero_calibration.procedures.motors import MotorResult, calibrate_motors
from hero_calibration.procedures.placement import place_robots
from hero_calibration.procedures.velocity import VelocityResult, calibrate_velocity
from hero_calibration.store import restore
from hero_client.values import BODY_RADIUS_M
from hero_node.files import KeptCalibration, read_calibration
from hero_sim.link.wifi import PROFILES, Radio
from hero_sim.robot.ranges import FACTORY_CALIBRATION_COUNTS_M2, calibrate
from hero_sim.stepped import RobotRows
from hero_sim.world import Arena, World, draw_errors
from hero_sim.world.robot_errors import SERVO_CENTER_US, set_known
from hero_test.nonempty import nonempty

STEP_M_S = 0.08

SEEDS = (0,)
APART_M = 0.6
WALL_Y_M = 1.0
AT_WALL_Y_M = WALL_Y_M - infrared_model.WALL_M - BODY_RADIUS_M

CENTER_BOUND_US = 3.0
VELOCITY_BOUND = 0.2
TRUE_VELOCITY_BOUND = 0.25
"""Includes the delay of the commands, 3 to 7 %."""

RANGE_BOUND_M = 0.003
COUNTS_BOUND = 0.04


def make_session(count=4, seed=0, at_wall=False, known=(), places_m_deg=None, wifi=None):
    """Return a session of robots with factory settings and errors drawn from seed, in a row along a wall.

    at_wall: whether they face it, 10 cm away and turned by up to 5 degrees; otherwise they have room.
    known: errors that are set, as of --error; places_m_deg: of some robots by row; wifi: a name of PROFILES.
    """
    rng = np.random.RandomState(seed)
    errors = draw_errors([np.random.RandomState([seed, row]) for row in range(count)])
    errors.servo_center_us[:] = SERVO_CENTER_US + rng.randint(-50, 51, (count, 2))
    errors.servo_gain[:] = rng.uniform(0.8, 1.2, (count, 2))
    errors.dead_zone_us[:] = rng.uniform(20.0, 40.0, (count, 1))
    errors.alpha_counts_m2[:] = rng.uniform(0.36, 0.46, (count, 8))
    for text in known:
        set_known(errors, 0, text)
    degrees = 90.0 + rng.uniform(-5.0, 5.0, count)
    poses = np.column_stack([np.arange(count) * APART_M, np.full(count, AT_WALL_Y_M if at_wall else 0.0), degrees])
    for row, place in (places_m_deg or {}).items():
        poses[row] = place
    poses[:, 2] = np.radians(poses[:, 2])
    wall_m = np.array([[-1.0, WALL_Y_M, APART_M * count, WALL_Y_M]])
    arena = Arena("wall", wall_m, np.empty((0, 3)), (), np.array([-1.0, -1.0, APART_M * count, WALL_Y_M]))
    radios = [Radio(PROFILES[wifi], np.random.RandomState([seed, 1, row])) for row in range(count)] if wifi else ()
    robots = RobotRows(World(arena, poses, [rng], errors), radios)
    for row in range(count):
        robots.set_motor_centers(row, [SERVO_CENTER_US] * 2)
        robots.set_infrared_calibration(row, [FACTORY_CALIBRATION_COUNTS_M2] * 8)
    return StepSession(robots)


def place_and(procedure, session, at_wall=False):
    """Return the results of a procedure with the robots that are well placed."""
    results = {}
    place_robots(session, at_wall, ask=None)
    procedure(session, results)
    return results


def measure_velocity(session, motors):
    results = {}
    calibrate_velocity(session, motors, results)
    return results


def velocity_alone(session, results):
    calibrate_velocity(session, {}, results)


def check_accuracy(session, results, range_bound_m=RANGE_BOUND_M):
    """Compare results with the known errors of the robots, and with what was written to them."""
    errors = session.robots.world.errors
    true_counts_m2 = calibrate(errors.alpha_counts_m2, errors.beta_counts)
    for row, result in results.items():
        found, written = result.to_file(), session.probes[row].written
        if isinstance(result, MotorResult):
            true_us = pytest.approx(errors.servo_center_us[row].tolist(), abs=CENTER_BOUND_US)
            assert written["motor_centers_us"] == found["motor_centers_us"] == true_us
        elif isinstance(result, VelocityResult):
            before, after = found["velocity_errors"]
            assert after < min(VELOCITY_BOUND, 0.75 * before)
            assert written["velocity_gains"] == found["velocity_gains"] == [*result.gains[0], *result.gains[1]]
        else:
            assert np.abs(result.before_m).max() > range_bound_m > np.abs(result.after_m).max()
            assert result.counts_m2 == pytest.approx(true_counts_m2[row].tolist(), rel=COUNTS_BOUND)
            assert written["infrared_counts_m2"] == result.counts_m2


def is_moving(session):
    return (np.abs(session.robots.world.speeds_m_s) > 1e-3).any(axis=1).tolist()


@pytest.mark.parametrize("seed", SEEDS)
class TestAccuracy:
    @pytest.mark.slow
    def test_centers_are_right_to_3_us_and_wheels_follow_better(self, seed):
        session = make_session(count=10, seed=seed)
        errors_before = self.measure_errors(session)
        motors = place_and(calibrate_motors, session)
        check_accuracy(session, motors)
        velocity = measure_velocity(session, motors)
        check_accuracy(session, velocity)
        assert len(motors) == len(velocity) == 10
        errors_after = self.measure_errors(session)
        assert errors_after.mean() < 0.75 * errors_before.mean()
        assert errors_after.max() < TRUE_VELOCITY_BOUND

    def measure_errors(self, session):
        """Return the true mean deviation of each robot's wheels from the target speed in a turn to the left."""
        speeds_m_s = []
        session.settle()
        for _ in range(75):
            for probe in session.probes:
                probe.drive(ANGULAR_RAD_S)
            session.pause(0.02)
            speeds_m_s.append(session.robots.world.speeds_m_s * (-1.0, 1.0))
        session.settle()
        return np.abs(np.array(speeds_m_s) / STEP_M_S - 1.0).mean(axis=(0, 2))

    @pytest.mark.slow
    def test_ranges_are_right_to_3_mm_and_constants_to_4_percent(self, seed):
        session = make_session(count=16, seed=seed, at_wall=True)
        results = place_and(calibrate_infrared, session, at_wall=True)
        check_accuracy(session, results)
        assert len(results) == 16


class TestWifi:
    @pytest.mark.slow
    def test_a_hotspot_changes_neither_centers_nor_gains(self):
        session = make_session(count=3, wifi="hotspot")
        motors = place_and(calibrate_motors, session)
        velocity = measure_velocity(session, motors)
        assert len(motors) == len(velocity) == 3
        check_accuracy(session, motors)
        check_accuracy(session, velocity)

    @pytest.mark.slow
    def test_a_hotspot_changes_no_ranges(self):
        session = make_session(count=3, at_wall=True, wifi="hotspot")
        results = place_and(calibrate_infrared, session, at_wall=True)
        assert len(results) == 3
        check_accuracy(session, results)

    @pytest.mark.slow
    def test_on_a_bad_network_robots_are_calibrated_well_or_fail_with_a_reason(self):
        session = make_session(count=6, seed=1, wifi="bad")
        motors = place_and(calibrate_motors, session)
        velocity = measure_velocity(session, motors)
        check_accuracy(session, motors)
        check_accuracy(session, velocity)
        assert len(velocity) >= 3
        for probe in nonempty(session.probes):
            assert probe.robot_id in velocity or re.search("is the network busy|is the robot on", probe.failure)


@pytest.mark.parametrize(
    ("procedure", "at_wall"), [(calibrate_motors, False), (velocity_alone, False), (calibrate_infrared, True)]
)
class TestDisturbances:
    @pytest.mark.slow
    def test_a_robot_that_is_lost_fails_alone(self, procedure, at_wall):
        session = make_session(at_wall=at_wall)
        session.events[8.0] = lambda: setattr(session.probes[1], "is_lost", True)
        results = place_and(procedure, session, at_wall)
        assert sorted(results) == [0, 2, 3]
        check_accuracy(session, results)
        assert re.search("nothing received on /hero_1/|is not answered", session.probes[1].failure)
        assert [probe.failure for probe in session.probes if probe.robot_id != 1] == [None] * 3

    @pytest.mark.slow
    def test_a_network_that_stalls_for_2_s_changes_nothing(self, procedure, at_wall):
        session = make_session(at_wall=at_wall)

        def set_lost(is_lost):
            for probe in session.probes:
                probe.is_lost = is_lost

        session.events.update({8.0: lambda: set_lost(True), 10.0: lambda: set_lost(False)})
        results = place_and(procedure, session, at_wall)
        assert sorted(results) == [0, 1, 2, 3]
        check_accuracy(session, results)

    @pytest.mark.slow
    def test_all_robots_stop_when_the_program_is_to_end(self, procedure, at_wall):
        session = make_session(at_wall=at_wall)
        session.end_s = 7.0
        with pytest.raises(EndedError):
            place_and(procedure, session, at_wall)
        session.stop()
        session.sleep(0.5)
        assert is_moving(session) == [False] * 4
        assert session.now_s < session.end_s + 1.0


@pytest.mark.slow
def test_no_robot_keeps_gains_that_were_only_tried():
    session, results = make_session(count=2), {}
    # The second robot fails in the third test, and the program ends in the fourth.
    session.events[14.0] = partial(setattr, session.probes[1], "failure", "velocity: lost")
    session.end_s = 18.0
    given = {probe: [] for probe in session.probes}
    for probe in session.probes:
        write = probe.write
        probe.write = lambda key, values, probe=probe, write=write: given[probe].append(values) or write(key, values)
    with pytest.raises(EndedError):
        velocity_alone(session, results)
    for probe, (*tests, best) in nonempty(given.items()):
        # Each wheel has the best of its own.
        assert [tuple(best[:3]), tuple(best[3:])] == results[probe.robot_id].gains
        assert best != tests[-1] and best[:3] in [gains[:3] for gains in tests[:-1]]
        assert probe.written["velocity_gains"] == best == results[probe.robot_id].to_file()["velocity_gains"]
    assert session.probes[1].failure == "velocity: lost"


class TestFaults:
    @pytest.mark.slow
    def test_a_blocked_wheel_is_named_and_the_others_are_calibrated(self):
        session = make_session(known=["robot=1,right_gain=0", "robot=3,left_gain=0"])
        check_accuracy(session, place_and(calibrate_motors, session))
        assert [probe.failure is None for probe in session.probes] == [True, False, True, False]
        for row, wheel in ((1, "right"), (3, "left")):
            assert session.probes[row].failure.startswith("motors: the %s wheel does not turn at any pulse" % wheel)
        session.sleep(0.5)
        assert is_moving(session) == [False] * 4

    @pytest.mark.slow
    def test_robots_keep_to_their_room_whatever_their_centers(self):
        corners = [(1450, 1550), (1550, 1450), (1450, 1450), (1550, 1550), (1525, 1450), (1500, 1550)]
        known = ["robot=%d,left_center_us=%d,right_center_us=%d" % (row, *us) for row, us in enumerate(corners)]
        session = make_session(count=6, known=known)
        robots, far_m = session.robots, []
        start_m = robots.world.poses[:, :2].copy()
        robots.on_cycle.append(lambda rows: far_m.append(np.hypot(*(robots.world.poses[:, :2] - start_m).T).max()))
        check_accuracy(session, place_and(calibrate_motors, session))
        assert not any(probe.failure for probe in session.probes) and max(far_m) < 0.13

    @pytest.mark.slow
    def test_a_robot_that_drives_away_is_stopped_and_named(self):
        session = make_session(count=2)
        session.robots.world.servo_gains_m_s_us[1, 0] *= -1.0
        start_m = session.robots.world.poses[:, :2].copy()
        assert list(place_and(calibrate_motors, session)) == [0]
        assert re.match("motors: moved 1[567] cm instead of turning on the spot", session.probes[1].failure)
        moved_m = np.hypot(*(session.robots.world.poses[:, :2] - start_m).T)
        assert moved_m[1] < 0.2 and not is_moving(session)[1] and "motor_centers_us" not in session.probes[1].written

    @pytest.mark.slow
    def test_a_center_outside_the_sweep_is_refused(self):
        session = make_session(count=2, known=["robot=1,left_center_us=1650,right_center_us=1650"])
        assert list(place_and(calibrate_motors, session)) == [0]
        assert "the left wheel does not stop between" in session.probes[1].failure

    @pytest.mark.slow
    def test_a_robot_that_does_not_turn_from_the_wall_is_named(self):
        session = make_session(at_wall=True, known=["robot=2,left_gain=0,right_gain=0"])
        assert sorted(place_and(calibrate_infrared, session, at_wall=True)) == [0, 1, 3]
        assert re.search("could not turn on the spot: 4[0-9] degrees are missing", session.probes[2].failure)


class TestPlacement:
    def test_robots_too_close_to_something_are_named_and_fail(self):
        session = make_session(places_m_deg={1: (0.12, 0.0, 90.0), 2: (1.2, AT_WALL_Y_M, 90.0)})
        place_robots(session, at_wall=False, ask=None)
        assert [probe.robot_id for probe in session.active] == [3]
        for row, text in ((0, "5 cm from it, at sensor right"), (1, "5 cm from it, at sensor left"), (2, "front")):
            assert session.probes[row].failure.startswith("place: something is about ")
            assert text in session.probes[row].failure

    def test_robots_that_face_no_wall_are_named_and_fail(self):
        session = make_session(at_wall=True, places_m_deg={1: (0.6, 0.0, 90.0), 2: (1.2, WALL_Y_M - 0.18, 90.0)})
        place_robots(session, at_wall=True, ask=None)
        assert [probe.robot_id for probe in session.active] == [0, 3]
        for row in (1, 2):
            assert session.probes[row].failure.startswith("place: its front sensor reads ")

    @pytest.mark.parametrize(("answers", "active"), [(["", "s"], [0, 2, 3]), (["", "", "s"], [0, 2, 3]), (["q"], None)])
    def test_the_user_is_asked_again_until_all_is_well_or_he_decides(self, answers, active):
        session, asked = make_session(places_m_deg={1: (0.6, AT_WALL_Y_M, 90.0)}), []

        def ask(question):
            asked.append(question)
            return answers[len(asked) - 1]

        if active is None:
            with pytest.raises(EndedError):
                place_robots(session, False, ask)
        else:
            place_robots(session, False, ask)
            assert [probe.robot_id for probe in session.active] == active
        assert len(asked) == len(answers)

    def test_a_robot_that_is_silent_is_named(self):
        session = make_session()
        session.probes[3].is_lost = True
        session.sleep(4.0)
        place_robots(session, at_wall=False, ask=None)
        assert session.probes[3].failure == (
            "place: nothing received on /hero_3/encoder: is the robot on and in reach?"
        )


class TestCalibration:
    """The whole program, without ROS."""

    def run(self, session, tmp_path, *parts, ask=None):
        return calibrate_parts(session, parts, str(tmp_path), ask)

    def load(self, tmp_path, robot_id):
        return read_calibration(store.name_file(str(tmp_path), robot_id)).values

    @pytest.mark.slow
    def test_results_are_saved_by_robot_and_printed_in_a_table(self, tmp_path, capsys):
        session = make_session(count=2, known=["robot=1,left_gain=0"])
        assert self.run(session, tmp_path, "motors") == 1
        assert set(self.load(tmp_path, 0)) == {"motor_centers_us", "dead_zones_us"}
        assert self.load(tmp_path, 0)["motor_centers_us"] == session.probes[0].written["motor_centers_us"]
        assert not (tmp_path / "hero_1.yaml").exists()
        table = capsys.readouterr().out.split("\n\n")[-1]
        assert "hero_0: ok\n  motors    centers" in table
        assert "hero_1: FAILED: motors: the left wheel does not turn" in table

    @pytest.mark.slow
    def test_what_was_measured_before_an_early_end_is_saved(self, tmp_path, capsys):
        session = make_session(count=2)
        session.end_s = 60.0
        assert self.run(session, tmp_path, "motors", "velocity") == 130
        kept, written = self.load(tmp_path, 1), session.probes[1].written
        assert set(kept) == {"motor_centers_us", "dead_zones_us", "velocity_gains", "velocity_errors"}
        assert {key: kept[key] for key in written} == written, "what the robot holds, also of tests that were ended"
        assert "ended early" in capsys.readouterr().out
        session.sleep(0.5)
        assert is_moving(session) == [False] * 2

    @pytest.mark.slow
    def test_what_a_robot_was_given_is_saved_if_others_still_try_at_the_end(self, tmp_path):
        session = make_session(count=2)
        far = session.probes[1]
        for time_s, is_lost in ((5.0, True), (32.0, False)):
            session.events[time_s] = partial(setattr, far, "is_lost", is_lost)
        session.end_s = 60.0
        assert self.run(session, tmp_path, "motors") == 130
        assert self.load(tmp_path, 0)["motor_centers_us"] == session.probes[0].written["motor_centers_us"]
        assert not far.written and not (tmp_path / "hero_1.yaml").exists()

    def test_nothing_is_saved_if_the_end_comes_before_a_result(self, tmp_path):
        session = make_session(count=2)
        session.end_s = 5.0
        assert self.run(session, tmp_path, "motors") == 130
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.slow
    def test_results_replace_a_damaged_file_where_a_question_fails(self, tmp_path):
        (tmp_path / "hero_0.yaml").write_text("robot: hero_0\nvelocity_gains: 2026-13-45\n")
        answers = [""]

        def ask(question):
            if not answers:
                raise CalibrationError("no terminal to answer")
            return answers.pop()

        with pytest.raises(CalibrationError, match="no terminal"):
            self.run(make_session(count=1), tmp_path, "motors", "infrared", ask=ask)
        assert set(self.load(tmp_path, 0)) == {"motor_centers_us", "dead_zones_us"}
        assert "2026-13-45" in (tmp_path / "hero_0.previous.yaml").read_text()


class TestRestore:
    def test_all_settings_are_written_and_a_lost_robot_is_named(self, capsys):
        session = make_session(count=2)
        values = {"motor_centers_us": [1511, 1489], "velocity_gains": [7.0] * 6, "velocity_errors": [0.2, 0.1]}
        session.probes[1].is_lost = True
        assert restore(session, {row: KeptCalibration(row, "today", values) for row in (0, 1)}) == 1
        assert session.probes[0].written == {key: values[key] for key in ("motor_centers_us", "velocity_gains")}
        output = capsys.readouterr().out
        assert "hero_0: restored motor_centers_us, velocity_gains of today" in output
        assert "hero_1: FAILED: restore: motor_centers_us is not answered; restored nothing of today" in output
