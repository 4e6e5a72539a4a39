"""An error that was not foreseen is seen: it is not taken for the failure of one robot, nor for the user's Ctrl-C."""

from types import SimpleNamespace

import numpy as np
import pytest
from test_calibration_rules import FakeSession

from hero_calibration import calibration, store
from hero_calibration.procedures import motors, placement, wheels
from hero_calibration.robots import ros_probe
from hero_node import Pose
from hero_node.files import KeptCalibration
from hero_test.checks.unforeseen import UnforeseenError, fail, fail_once


def calibrate(monkeypatch, folder):
    monkeypatch.setattr(calibration, "_calibrate", fail)
    calibration.calibrate_parts(FakeSession(), ["motors"], str(folder), None)


def save(monkeypatch, folder):
    monkeypatch.setattr(calibration.store, "save", fail)
    calibration._save(FakeSession().probes[0], str(folder), {})


def save_over_another(monkeypatch, folder):
    (folder / "hero_0.yaml").write_text("robot: hero_0")
    monkeypatch.setattr(store, "read_calibration", fail)
    store.save(str(folder / "hero_0.yaml"), KeptCalibration(0, "", {}, {}))


def work_for_each(_monkeypatch, _folder):
    FakeSession().for_each("motors", fail)


def evaluate_once_more(_monkeypatch, _folder):
    session = FakeSession()
    session.hear()
    session.repeat("motors", 2, lambda _: None, fail)


def evaluate_sweep(monkeypatch, _folder):
    monkeypatch.setattr(motors.dead_zone, "find_dead_zone", fail)
    motors.evaluate_sweep(np.zeros((2, 4)), np.zeros((2, 4)))


def plan_sweeps(monkeypatch, _folder):
    session = FakeSession(1)
    monkeypatch.setattr(motors.dead_zone, "measure_sweep", fail)
    motors._plan_sweeps(session, {session.probes[0]: Pose(0.0, 0.0, 0.0)})


def check_places(monkeypatch, _folder):
    session = FakeSession()
    session.on_sleep = lambda _now_s: session.hear()
    monkeypatch.setattr(placement, "find_obstacle", fail)
    placement.check_places(session, at_wall=False)


def measure_by_tape(monkeypatch, _folder):
    monkeypatch.setattr(wheels, "_take_ticks", lambda *_: np.zeros((2, 2)))
    wheels._ask_for_leg(fail_once("12 -5"), 0.0, 1.0, wheels.TAPE_SD, FakeSession().probes[0])


def write(monkeypatch, _folder):
    monkeypatch.setattr(ros_probe.rospy, "wait_for_service", fail)
    ros_probe.RosProbe.write(SimpleNamespace(name="hero_0"), "velocity_gains", [])


def find_robots(monkeypatch, _folder):
    monkeypatch.setattr(ros_probe, "share_drivers", lambda: SimpleNamespace(wait_for_robots=fail))
    ros_probe.find_robots(SimpleNamespace(sleep=None, running=True), None)


CASES = [
    calibrate, save, save_over_another, work_for_each, evaluate_once_more, evaluate_sweep, plan_sweeps, check_places,
    measure_by_tape, write, find_robots,
]  # fmt: skip


@pytest.mark.parametrize("act", CASES)
def test_an_error_that_was_not_foreseen_is_not_taken_for_another(act, monkeypatch, tmp_path):
    with pytest.raises(UnforeseenError):
        act(monkeypatch, tmp_path)
