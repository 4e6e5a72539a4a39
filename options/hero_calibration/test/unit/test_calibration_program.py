"""The program calibrate from its options to its robots: which are found, asked for, restored, and why it ends."""

import sys
from contextlib import nullcontext
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
from test_calibration_rules import FakeSession

from hero_calibration import calibrate, calibration
from hero_calibration.errors import CalibrationError, EndedError
from hero_calibration.procedures.velocity import calibrate_velocity
from hero_calibration.procedures.wheels import calibrate_wheels
from hero_calibration.robots import ros_probe
from hero_client import RobotNotReadyError
from hero_client.ros import Drivers
from hero_node.files import Calibrations
from hero_node.ros import Program


@pytest.fixture(name="program")
def make_program():
    return create_autospec(Program, instance=True, running=True)


@pytest.fixture(name="drivers")
def make_drivers(monkeypatch):
    """Two drivers: hero_0 is at one, all others at the other, a HeRo+ among them."""
    drivers = create_autospec(Drivers, instance=True)
    drivers.wait_for_robots.return_value = [3, 0]
    drivers.find.side_effect = lambda namespace: "/a" if namespace == "/hero_0" else "/b"
    drivers.is_stopped.return_value = False
    drivers.find_model.side_effect = lambda namespace: "hero_plus" if namespace == "/hero_3" else "hero"
    monkeypatch.setattr(ros_probe, "share_drivers", lambda: drivers)
    probe = create_autospec(ros_probe.RosProbe)
    probe.side_effect = lambda robot_id, model: SimpleNamespace(robot_id=robot_id, model=model, failure="new")
    monkeypatch.setattr(ros_probe, "RosProbe", probe)
    return drivers


def test_robots_are_those_that_are_ready_or_asked_for(drivers, program):
    found = [(probe.robot_id, probe.model, probe.failure) for probe in ros_probe.find_robots(program, None)]
    assert found == [(0, "hero", None), (3, "hero_plus", None)]
    drivers.wait_for_robots.assert_called_once_with(10.0, program.sleep, None)
    found = ros_probe.find_robots(program, [5, 3])
    assert [(probe.robot_id, probe.failure) for probe in found] == [
        (3, None),
        (5, "is not connected to the driver: is it on?"),
    ]


def test_robots_of_any_driver_that_are_stopped_are_to_be_released_first(drivers, program):
    drivers.is_stopped.side_effect = lambda driver: driver == "/b"
    with pytest.raises(CalibrationError, match="release them: rosservice call /b/stop false"):
        ros_probe.find_robots(program, None)
    assert len(ros_probe.find_robots(program, [0])) == 1, "that of its own driver is not"


def test_without_a_robot_the_reason_is_told(drivers, program):
    with pytest.raises(CalibrationError, match="no robot is ready: are they on"):
        ros_probe.find_robots(program, [5])
    drivers.wait_for_robots.side_effect = RobotNotReadyError("no driver")
    with pytest.raises(CalibrationError, match="no driver"):
        ros_probe.find_robots(program, None)
    program.running = False
    with pytest.raises(CalibrationError, match="ended before a robot was found"):
        ros_probe.find_robots(program, None)


@pytest.fixture(name="run")
def make_run(monkeypatch, program, tmp_path):
    """Return a function that runs the program for hero_0 and hero_3, and returns its status."""
    probes = [SimpleNamespace(robot_id=number, name="hero_%d" % number) for number in (0, 3)]
    monkeypatch.setattr(calibrate, "Program", lambda *_, **__: nullcontext(program))
    monkeypatch.setattr(calibrate, "find_robots", create_autospec(calibrate.find_robots, return_value=probes))
    monkeypatch.setattr(calibrate, "RosSession", lambda _, batch: batch)
    for name, returned in (("calibrate_parts", 0), ("restore", 1), ("find_missing", []), ("load_calibrations", {3: 7})):
        monkeypatch.setattr(calibrate, name, create_autospec(getattr(calibrate, name), return_value=returned))

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["calibrate", "--folder", str(tmp_path / "files"), *arguments])
        return calibrate.main()

    run.probes = probes
    return run


def test_only_robots_that_lack_a_part_are_calibrated_on_request(run, capsys):
    calibrate.find_missing.side_effect = [[3], []]
    assert run("wheels", "--missing") == 0
    calibrate.find_missing.assert_called_once_with({}, [0, 3], ["wheels"])
    assert calibrate.calibrate_parts.call_args[0][:2] == ([run.probes[1]], ["wheels"])
    assert run("wheels", "--missing") == 0 and calibrate.calibrate_parts.call_count == 1
    assert "every robot has these parts already" in capsys.readouterr().out


def test_questions_are_asked_in_the_terminal_or_end_the_program(run, program):
    assert run("wheels", "--tape", "--robots", "0 3") == 0
    calibrate.find_robots.assert_called_once_with(program, [0, 3])
    *_, placed, tape = calibrate.calibrate_parts.call_args[0]
    program.ask.return_value = "q"
    assert placed("Enter: ") == tape("Enter: ") == "q"
    program.ask.assert_called_with("Enter: ")
    program.ask.return_value = None
    with pytest.raises(
        CalibrationError, match="no terminal to answer questions: start it in a terminal, or with --yes"
    ):
        placed("Enter: ")
    program.running = False
    with pytest.raises(EndedError):
        placed("Enter: ")
    assert run("infrared", "--yes") == 0 and calibrate.calibrate_parts.call_args[0][3:] == (None, None)


def test_files_are_read_before_robots_are_waited_for(run, program, tmp_path):
    assert run("restore", "a.yaml", "--robots", "3") == 1
    folder = str(tmp_path / "files")
    calibrate.load_calibrations.assert_called_once_with(folder, ["a.yaml"], [3])
    calibrate.find_robots.assert_called_once_with(program, [3])
    calibrate.restore.assert_called_once_with(run.probes, {3: 7})
    calibrate.load_calibrations.side_effect = CalibrationError("no calibration of these robots")
    with pytest.raises(CalibrationError, match="no calibration of these robots"):
        run("restore")
    assert calibrate.find_robots.call_count == 1 and not (tmp_path / "files").exists()


def test_the_status_needs_no_robot(run, monkeypatch, capsys):
    read = create_autospec(calibrate.read_calibrations, return_value=Calibrations({}, {"a.yaml": "no number"}))
    monkeypatch.setattr(calibrate, "read_calibrations", read)
    assert run("status") == 0 and not calibrate.find_robots.called
    assert capsys.readouterr().out.splitlines()[-1] == "a.yaml: no number"


def test_a_file_that_cannot_be_written_fails_a_robot_that_had_not_failed(monkeypatch):
    save = create_autospec(calibration.store.save, side_effect=OSError(28, "No space left on device"))
    monkeypatch.setattr(calibration.store, "save", save)
    late, good = FakeSession().probes
    late.failure = "velocity: turned late"
    assert calibration._save(late, "/c", {}) == calibration._save(good, "/c", {}) == ""
    assert late.failure == "velocity: turned late"
    assert good.failure == "/c/hero_1.yaml cannot be written: No space left on device"


@pytest.mark.parametrize(
    ("calibrate_part", "told"),
    [
        (lambda session: calibrate_velocity(session, {}, {}), "velocity: gains are tried, about a minute\n"),
        (
            lambda session: calibrate_wheels(session, None, {}),
            "wheels: squares to the left and to the right, about 1 min\n",
        ),
    ],
)
def test_users_are_told_how_long_a_part_takes(calibrate_part, told, capsys):
    session = FakeSession(0)
    start_s = session.now_s
    calibrate_part(session)
    assert capsys.readouterr().out.startswith(told) and session.now_s - start_s == pytest.approx(60.0, abs=20.0)
