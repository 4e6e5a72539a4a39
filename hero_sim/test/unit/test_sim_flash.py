import json
import math
import os
import struct

import pytest
from driver_side import RECEIVED, DriverSide

from hero_sim.errors import OptionError
from hero_sim.robot.flash import Flash
from hero_sim.robot.motor_pid import POSITION_GAINS, VELOCITY_GAINS

CENTERS = struct.pack("<2h", 1490, 1512)


def set_centers(*arguments):
    driver = DriverSide(*arguments)
    driver.start_streaming()
    driver.send(0, RECEIVED["motors_parameters"], CENTERS)
    driver.run(200)
    return driver


def test_all_parameters_are_kept_over_a_restart_of_the_simulator(tmp_path):
    driver = set_centers("--flash-dir", str(tmp_path))
    for topic_id, payload in (
        (RECEIVED["ir_calibration"], struct.pack("<8d", *[0.4 + 0.01 * index for index in range(8)])),
        (RECEIVED["velocity_controller/pid_parameters"], struct.pack("<6f", 1, 2, 3, 4, 5, 6)),
        (RECEIVED["position_controller/pid_parameters"], struct.pack("<6f", 7, 8, 9, 10, 11, 12)),
    ):
        driver.send(0, topic_id, payload)
        driver.run(200)
    for topic_id in (126, 132, 133, 135):
        assert [arrival.payload[0] for arrival in driver.list_packets(0, topic_id)] == [1]
    assert os.listdir(str(tmp_path)) == ["hero_0.json"]
    robot = DriverSide("--flash-dir", str(tmp_path)).swarm.robots[0]
    assert robot.flash.ir_calibration_counts_m2 == pytest.approx([0.4 + 0.01 * index for index in range(8)])
    assert robot.motors.motors.centers_us == [1490, 1512]
    assert [tuple(pid.gains) for pid in robot.motors.velocity.pids] == [(1, 2, 3), (4, 5, 6)]
    assert [tuple(pid.gains) for pid in robot.motors.position.pids] == [(7, 8, 9), (10, 11, 12)]


def test_a_reboot_of_a_robot_keeps_what_was_set_without_any_folder():
    driver = set_centers()
    robot = driver.swarm.robots[0]
    robot.switch_on(driver.swarm.now_ms)
    assert robot.motors.motors.centers_us == [1490, 1512]


def test_gains_of_a_wheel_without_a_proportional_one_are_the_programs():
    robot = set_centers().swarm.robots[0]
    robot.flash.velocity_pid, robot.flash.position_pid = [1.0, 0.0, 0.0, 0.0, 2.0, 3.0], [0.0, 4.0, 5.0, 6.0, 0.0, 0.0]
    robot.switch_on(0)
    assert [pid.gains for pid in robot.motors.velocity.pids] == [(1.0, 0.0, 0.0), VELOCITY_GAINS]
    assert [pid.gains for pid in robot.motors.position.pids] == [POSITION_GAINS, (6.0, 0.0, 0.0)]


def test_a_folder_that_goes_away_costs_no_robot_but_is_reported(tmp_path):
    driver = DriverSide("--flash-dir", str(tmp_path / "flash"))
    driver.start_streaming()
    os.rmdir(str(tmp_path / "flash"))
    driver.send(0, RECEIVED["motors_parameters"], CENTERS)
    driver.run(200)
    assert any("cannot be written" in report for report in driver.reports)
    assert driver.swarm.robots[0].motors.motors.centers_us == [1490, 1512]


NAN_GAINS = struct.pack("<6f", math.nan, 2, 3, 4, 5, 6)


@pytest.mark.parametrize(
    "topic_id, payload",
    [
        (RECEIVED["velocity_controller/pid_parameters"], NAN_GAINS),
        (RECEIVED["position_controller/pid_parameters"], NAN_GAINS),
        (RECEIVED["ir_calibration"], struct.pack("<8d", *[0.5] * 7, math.nan)),
        (RECEIVED["ir_calibration"], struct.pack("<8d", *[0.5] * 7, math.inf)),
    ],
    ids=["velocity nan", "position nan", "infrared nan", "infrared inf"],
)
def test_parameters_that_are_not_finite_are_refused_and_not_kept(tmp_path, topic_id, payload):
    driver = DriverSide("--flash-dir", str(tmp_path))
    driver.start_streaming()
    driver.send(0, topic_id, payload)
    driver.run(200)
    (report,) = driver.reports
    assert "with which a real robot would do anything" in report
    assert os.listdir(str(tmp_path)) == []


def write_flash(**changes):
    """Return the text of a good file but for the changes."""
    content = {
        "ir_calibration_counts_m2": [0.5] * 7 + [math.nan],
        "motor_centers_us": [1500, 1510],
        "velocity_pid": [-1.0] * 6,
        "position_pid": [-1.0] * 6,
    }
    return json.dumps({**content, **changes})


def test_a_sensor_that_was_never_calibrated_is_read_as_nan(tmp_path):
    path = tmp_path / "hero_0.json"
    path.write_text(write_flash())
    flash = Flash([0.1] * 8)
    flash.keep_in(str(path))
    assert flash.ir_calibration_counts_m2[:7] == [0.5] * 7 and math.isnan(flash.ir_calibration_counts_m2[7])


def test_a_directory_in_place_of_a_flash_file_is_named(tmp_path):
    (tmp_path / "hero_0.json").mkdir()
    with pytest.raises(OptionError, match="cannot be read: Is a directory; delete it"):
        Flash([0.5] * 8).keep_in(str(tmp_path / "hero_0.json"))


@pytest.mark.parametrize(
    "content, reason",
    [
        ("no JSON", "must hold names and values"),
        ("", "must hold names and values"),
        ("[" * 20000, "more than 20 levels"),
        ("[]", "must hold names and values"),
        ("{}", "ir_calibration_counts_m2 is missing"),
        (write_flash(ir_calibration_counts_m2=[1, 2]), "is a list, but must be a list of 8 numbers"),
        (write_flash(ir_calibration_counts_m2=["x"] * 8), "ir_calibration_counts_m2 is 'x', but must be a number"),
        (write_flash(ir_calibration_counts_m2=[math.inf] * 8), "is 'Infinity', but must be a number"),
        (write_flash(motor_centers_us=[10**400, 1500]), "motor_centers_us is 1000"),
        (write_flash(motor_centers_us=[math.nan, 1500]), "is 'NaN', but must be a number"),
        (write_flash(velocity_pid=[math.nan] * 6), "velocity_pid is 'NaN', but must be a number"),
        (write_flash(position_pid=[1e300] * 6), "but must be a number from -1e+30 to 1e+30"),
        (write_flash(velocity_pid=[True] * 6), "velocity_pid is True, but must be a number"),
    ],
)
def test_a_file_that_is_not_a_flash_is_named_with_the_reason(tmp_path, content, reason):
    path = tmp_path / "hero_0.json"
    path.write_text(content)
    with pytest.raises(OptionError) as caught:
        Flash([0.5] * 8).keep_in(str(path))
    assert reason in str(caught.value) and str(path) in str(caught.value)


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match=r"Not a directory: .*file/flash"):
        DriverSide("--flash-dir", str(tmp_path / "file" / "flash"))
