"""Requests to a robot's services: absurd ones never reach it."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.commands.service_requests import find_request_error, is_success, read_set_odom_pose
from hero_node import Pose
from hero_test.nonempty import nonempty

GOOD = {
    "hero_msgs/SetOdom": ("<3d", (1.0, 2.0, 0.5)),
    "hero_msgs/SetPID": ("<6f", (200.0, 0.0, 1.5, 200.0, 0.0, 1.5)),
    "hero_msgs/SetMotor": ("<2h", (1500, 1495)),
    "hero_msgs/SetIRCalibration": ("<8d", (0.42,) * 8),
}


@pytest.mark.parametrize("service_type", GOOD)
def test_a_reasonable_request_may_go(service_type):
    layout, values = GOOD[service_type]
    assert find_request_error(service_type, struct.pack(layout, *values)) is None


@pytest.mark.parametrize("service_type", GOOD)
@pytest.mark.parametrize("change", [-1, 1, 8])
def test_a_request_of_another_length_is_refused(service_type, change):
    layout, values = GOOD[service_type]
    request = struct.pack(layout, *values)
    request = request + bytes(change) if change > 0 else request[:change]
    assert "not a " + service_type in find_request_error(service_type, request)


@pytest.mark.parametrize("service_type", ["hero_msgs/SetOdom", "hero_msgs/SetPID", "hero_msgs/SetIRCalibration"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e30, -1e30])
def test_an_absurd_number_anywhere_is_refused(service_type, value):
    layout, values = GOOD[service_type]
    for position in nonempty(range(len(values))):
        changed = [*values[:position], value, *values[position + 1 :]]
        assert find_request_error(service_type, struct.pack(layout, *changed)) is not None


@pytest.mark.parametrize("pulse_us", [-32768, 0, 999, 2001, 32767])
def test_pulses_that_no_servo_knows_are_refused(pulse_us):
    for pulses_us in ((pulse_us, 1500), (1500, pulse_us)):
        fault = find_request_error("hero_msgs/SetMotor", struct.pack("<2h", *pulses_us))
        assert str(pulse_us) in fault
        assert "1000..2000 us" in fault


@pytest.mark.parametrize("gain", [0.0, -0.5])
def test_gains_of_infrared_sensors_are_above_zero(gain):
    request = struct.pack("<8d", *(0.42,) * 7, gain)
    assert "above 0" in find_request_error("hero_msgs/SetIRCalibration", request)


@pytest.mark.parametrize("position", range(6))
def test_a_negative_gain_of_a_controller_is_refused_with_what_it_would_do(position):
    gains = [200.0, 0.0, 1.5, 200.0, 0.0, 1.5]
    gains[position] = -0.001
    fault = find_request_error("hero_msgs/SetPID", struct.pack("<6f", *gains))
    assert "-0.001" in fault
    assert "uses none and stores all" in fault


def test_services_without_a_rule_take_every_request():
    assert find_request_error("std_srvs/Trigger", b"") is None
    assert find_request_error("some_srvs/Other", b"\xff" * 100) is None


def test_the_pose_of_set_odom_has_its_angle_within_half_a_turn():
    assert read_set_odom_pose(struct.pack("<3d", 1.0, -2.0, 0.5)) == Pose(1.0, -2.0, 0.5)
    assert read_set_odom_pose(struct.pack("<3d", 0.0, 0.0, 3.5 * math.pi)).yaw_rad == pytest.approx(-math.pi / 2.0)


def test_the_first_byte_of_an_answer_tells_success():
    assert is_success(bytes.fromhex("01 15000000") + b"Odometry was changed!")
    assert not is_success(bytes.fromhex("00 00000000"))
    assert not is_success(b"")


@given(service_type=st.sampled_from([*GOOD, "std_srvs/Trigger"]), request=st.binary(max_size=80))
def test_any_request_may_go_or_is_refused_in_one_line(service_type, request):
    fault = find_request_error(service_type, request)
    assert fault is None or fault.isprintable()
    if fault is None and service_type == "hero_msgs/SetOdom":
        assert all(map(math.isfinite, read_set_odom_pose(request)))
