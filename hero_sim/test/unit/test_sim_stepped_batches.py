"""RobotRows as programs use it: many robots and worlds at once, commands that cannot be used, figures, Wi-Fi."""

from unittest.mock import create_autospec

import numpy as np
import pytest
from stepped_worlds import build_world

from hero_sim.link.wifi import PROFILES, Radio
from hero_sim.robot.models import MODELS
from hero_sim.stepped.robot_rows import RobotRows
from hero_sim.stepped.rules.servo_pulses import ServoPulses
from hero_sim.world import compiled
from hero_sim.world.world import World
from hero_test.nonempty import nonempty


def build_radios(profile, count):
    return [Radio(PROFILES[profile], np.random.RandomState(row)) for row in range(count)]


def wander(robots, seconds, rows=None):
    """Drive the robots at rows, or all, anew ten times a second; return all readings as bytes."""
    rows = np.arange(len(robots.ticks)) if rows is None else rows
    log = []
    for step in range(seconds * 10):
        turns_rad_s = 2.0 * np.sin(step / 7.0 + np.arange(len(rows)) % 5)
        robots.send_velocity(rows, np.where(robots.proximity_m[rows].min(axis=1) < 0.15, 0.0, 0.1), turns_rad_s)
        robots.advance(robots.now_ms + 100)
        readings = (robots.odometry, robots.velocities, robots.ticks, robots.proximity_m, robots.world.poses)
        log.append(np.hstack(readings)[rows].tobytes())
    return log


@pytest.mark.slow
@pytest.mark.parametrize("profile", [None, "hotspot"])
def test_two_runs_give_the_same_bytes(profile):
    logs = [wander(RobotRows(build_world(4, 3), build_radios(profile, 4) if profile else ()), 10) for _ in range(2)]
    assert logs[0] == logs[1]


@pytest.mark.slow
def test_a_world_of_a_batch_gives_the_same_bytes_as_alone():
    def run(seeds, place):
        """Drive one world of a batch; the robots of the others wake up earlier and are driven otherwise."""
        robots = RobotRows(build_world(4, *seeds))
        own = np.arange(4 * place, 4 * place + 4)
        others = np.setdiff1d(np.arange(4 * len(seeds)), own)
        robots.send_position(others, 0.1, 0.0)
        robots.advance(3017)
        robots.send_pulses(others, 1400, 1600)
        return wander(robots, 8, own)

    assert run([1, 2, 3], 1) == run([2], 0)


def wander_with_loops(monkeypatch, rows):
    """Return the readings of two worlds, and the speeds behind the filter; loops are used from so many rows on.

    Robot 2, a HeRo+, is driven a second later than the others: its controller does not run.
    """
    monkeypatch.setattr(compiled, "COMPILED_ROWS", rows)
    models = [MODELS["hero"], MODELS["hero"], MODELS["hero_plus"]]
    robots = RobotRows(build_world(3, 1, 2, models=models), models=models * 2)
    log = wander(robots, 1, np.array([0, 1, 3, 4, 5])) + wander(robots, 2)
    robots.set_odometry(2, 0.1, 0.2, 3.0)
    log += wander(robots, 1)
    assert robots.ticks.all() and np.abs(robots.odometry[:, 2]).max() > 2.0
    return log, robots._encoders.filtered_m_s.tobytes()


def test_loops_give_the_same_bytes_as_arrays(monkeypatch):
    monkeypatch.setattr(compiled, "_compile_loops", lambda module: module)
    with np.errstate(over="ignore"):  # of random bits, which wrap
        looped = wander_with_loops(monkeypatch, 0)
    assert looped == wander_with_loops(monkeypatch, 10**9)


@pytest.mark.option("numba")
def test_compiled_loops_give_the_same_bytes_as_arrays(monkeypatch):
    assert wander_with_loops(monkeypatch, 0) == wander_with_loops(monkeypatch, 10**9)


def test_commands_that_are_not_finite_are_refused_with_their_rows():
    robots = RobotRows(build_world(3, 0))
    with pytest.raises(ValueError, match="row 2 must be finite, not nan and 0.0"):
        robots.send_velocity(2, np.nan, 0.0)
    with pytest.raises(ValueError, match=r"rows \[1\] must be finite"):
        robots.send_position([0, 1, 2], [0.1, np.inf, 0.1], 0.0)
    robots.advance(1000)
    assert not robots.ticks.any()


def test_a_row_that_no_robot_has_and_time_that_has_passed_are_refused():
    robots = RobotRows(build_world(3, 0))
    for row in (-1, 3):
        with pytest.raises(IndexError, match="no robot row %d; rows are 0..2" % row):
            robots.send_velocity(row, 0.1, 0.0)
    robots.advance(100)
    with pytest.raises(ValueError, match="100 ms already, later than 99 ms"):
        robots.advance(99)


def test_a_light_goes_out_15_s_after_its_last_command():
    robots = RobotRows(build_world(2, 0))
    robots.advance(300)
    robots.send_light(1, (1.0, 0.5, 0.0, 1.0))
    robots.advance(15300)
    assert robots.lights.tolist() == [[0.0] * 4, [1.0, 0.5, 0.0, 1.0]]
    robots.advance(15301)
    assert not robots.lights.any()


def test_hooks_get_every_cycle_and_scan_with_its_readings():
    robots, cycles, scans = RobotRows(build_world(2, 0)), [], []
    robots.on_cycle.append(lambda rows: cycles.append((robots.now_ms, rows.tolist(), robots.odometry_ms.tolist())))
    robots.on_scan.append(lambda rows: scans.append((robots.now_ms, rows.tolist(), robots.scan_ms.tolist())))
    robots.advance(1000)
    for calls in (cycles, scans):
        assert all(call == (call[0], [0, 1], [call[0]] * 2) for call in calls)
    assert [now_ms for now_ms, *_ in cycles[:7]] == [34, 68, 102, 136, 170, 205, 239]
    assert [now_ms for now_ms, *_ in scans] == [205, 410, 615, 820]


def test_sensors_that_are_not_calibrated_show_nan():
    robots = RobotRows(build_world(2, 0))
    robots.set_infrared_calibration(1, [np.nan] * 8)
    robots.advance(300)
    assert np.isnan(robots.proximity_m[1]).all() and not np.isnan(robots.proximity_m[0]).any()


@pytest.mark.slow
def test_wifi_delays_readings_but_changes_none_of_them():
    ideal, delayed = RobotRows(build_world(2, 0)), RobotRows(build_world(2, 0), build_radios("bad", 2))
    readings = [{}, {}]
    for robots, found in zip((ideal, delayed), readings):

        def note(rows, robots=robots, found=found):
            for row in rows.tolist():
                found.setdefault(row, []).append((*robots.odometry[row].tolist(), *robots.ticks[row].tolist()))

        robots.on_cycle.append(note)
        # Straight to the servos: a command would be late.
        robots.world.write_pulses(True, np.array([(1440, 1300), (1400, 1390)]))
        robots.advance(20000)
    for row, received in nonempty(readings[1].items()):
        assert received == readings[0][row][: len(received)] and len(received) > 450


@pytest.mark.slow
def test_wifi_gaps_are_those_of_the_profile():
    robots, times_ms = RobotRows(build_world(3, 0), build_radios("hotspot", 3)), [[], [], []]
    robots.on_cycle.append(lambda rows: [times_ms[row].append(robots.now_ms) for row in rows.tolist()])
    robots.advance(60000)
    gaps_ms = np.concatenate([np.diff(times) for times in times_ms])
    p50, p95, p99, longest = np.percentile(gaps_ms, [50, 95, 99, 100])
    assert p50 == 34 and 43 <= p95 <= 50 and 50 <= p99 <= 70 and 400 <= longest <= 1300


@pytest.mark.slow
def test_a_stop_is_sent_through_wifi_that_stalls_and_motion_behind_it():
    robots = RobotRows(build_world(1, 0, scale=0.0), build_radios("bad", 1))
    moved = []
    for _ in range(10):
        for _ in range(20):
            robots.send_velocity(0, 0.1, 0.0)
            robots.advance(robots.now_ms + 50)
        moved.append(robots.world.speeds_m_s.max())
        robots.send_velocity(0, 0.0, 0.0)
        robots.advance(robots.now_ms + 6000)
        assert not robots.world.commands_m_s.any()
    assert np.median(moved) > 0.07


class FixedDelays:
    """A radio whose delays (ms) are those given, and the last of them from then on."""

    def __init__(self, up_ms, down_ms):
        self.up, self.down = FixedDelay(up_ms), FixedDelay(down_ms)

    def is_congested(self, now_ms):
        return False


class FixedDelay:
    def __init__(self, delays_ms):
        self.delays_ms = list(delays_ms)

    def send(self, now_ms, length):
        return now_ms + (self.delays_ms.pop(0) if len(self.delays_ms) > 1 else self.delays_ms[0])


def test_a_stop_read_with_a_motion_is_dropped_and_its_repeat_stops():
    robots = RobotRows(build_world(1, 0, scale=0.0), [FixedDelays([1], [58, 1])])
    robots.send_velocity(0, 0.1, 0.0)
    robots.advance(30)
    robots.send_velocity(0, 0.0, 0.0)  # sent at 60 ms; both are read at 101 ms
    robots.advance(140)
    assert (robots.world.commands_m_s > 0.0).all()
    robots.advance(160)
    assert not robots.world.commands_m_s.any()


def test_no_command_is_sent_while_another_is_on_its_way():
    robots = RobotRows(build_world(1, 0, scale=0.0), [FixedDelays([1], [500, 30])])
    robots.send_velocity(0, 0.1, 0.0)
    robots.advance(100)
    robots.send_velocity(0, -0.1, 0.0)
    robots.advance(540)
    assert (robots.world.commands_m_s > 0.0).all()
    robots.advance(700)
    assert (robots.world.commands_m_s < 0.0).all()


def test_readings_from_before_odometry_was_set_are_not_received_after():
    robots = RobotRows(build_world(1, 0, scale=0.0), [FixedDelays([100], [1])])
    robots.world.write_pulses(True, np.array([[1300], [1300]]))
    robots.advance(1000)
    assert abs(robots.odometry[0, 2]) > 0.5
    robots.set_odometry(0, 1.0, 2.0, 0.5)
    for _ in range(90):
        assert robots.odometry[0].tolist() == [1.0, 2.0, 0.5] and not robots.velocities.any()
        robots.advance(robots.now_ms + 1)
    robots.advance(robots.now_ms + 100)
    assert robots.odometry[0, 2] != 0.5 and robots.odometry[0, :2] == pytest.approx([1.0, 2.0], abs=0.01)


def test_odometry_does_not_depend_on_how_often_it_is_read():
    often, seldom = RobotRows(build_world(3, 0)), RobotRows(build_world(3, 0))
    often.on_cycle.append(lambda rows: often.odometry)
    for step in range(25):
        for robots in (often, seldom):
            robots.send_velocity([0, 1], 0.1, [4.0, -1.0])
            robots.advance(robots.now_ms + 100)
            if step == 20:
                robots.set_odometry(1, 1.0, 2.0, 0.5)
    assert often.odometry.tolist() == seldom.odometry.tolist() and often.odometry[:2].all()


def test_the_velocity_is_reset_when_odometry_is_set():
    robots = RobotRows(build_world(1, 0, scale=0.0))
    robots.world.write_pulses(True, np.array([[1300], [1700]]))
    robots.advance(2000)
    speed_m_s = robots.velocities[0, 0]
    robots.set_odometry(0, 0.0, 0.0, 0.0)
    assert not robots.velocities.any() and not robots.ticks.any()
    robots.advance(2150)
    assert robots.velocities[0, 0] == pytest.approx(speed_m_s, rel=0.05)


def test_pulses_that_go_out_already_are_not_written_again():
    world, pulses_us = create_autospec(World, instance=True), np.array([[1400.0] * 3, [1600.0] * 3])
    servos, first = ServoPulses(world, np.full((2, 3), 1500.0)), np.array([True, False, False])
    counts = []
    for which in (first, first, True, True):
        servos.write(0, pulses_us, which)
        counts.append(world.write_pulses.call_count)
    servos.stop(np.array([1]))
    for which in (first, True):
        servos.write(5, pulses_us, which)
        counts.append(world.write_pulses.call_count)
    assert counts == [1, 1, 2, 2, 2, 3]
