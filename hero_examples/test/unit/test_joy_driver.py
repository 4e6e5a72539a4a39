"""Reading a joystick: a named pipe sends what the kernel's device would."""

import contextlib
import os
import struct

import pytest

from hero_client import ProgramError
from hero_examples.driving.joy_driver import JoystickDevice

BUTTON, AXIS, INITIAL = 1, 2, 0x80


@contextlib.contextmanager
def plug_in(folder, deadzone=0.0):
    """Yield a joystick, and a function that sends a record of kind, number and value."""
    path = str(folder / "js0")
    os.mkfifo(path)
    keep = os.open(path, os.O_RDWR)
    with contextlib.closing(JoystickDevice(path, deadzone)) as device:

        def send(*records):
            os.write(keep, b"".join(struct.pack("=IhBB", 7, value, kind, number) for kind, number, value in records))
            device.read(1.0)

        yield device, send
    os.close(keep)


def test_axes_are_positive_to_the_left_and_up_and_full_at_one(tmp_path):
    with plug_in(tmp_path) as (device, send):
        send((AXIS | INITIAL, 0, 0), (AXIS | INITIAL, 1, 0), (BUTTON | INITIAL, 0, 0))
        assert device.axes == [0.0, 0.0] and device.buttons == [0]
        send((AXIS, 1, -32767), (AXIS, 0, 32767))
        assert device.axes == [-1.0, 1.0]
        send((AXIS, 0, -32768))  # one more than full
        assert device.axes == [1.0, 1.0]


def test_buttons_are_pressed_and_released(tmp_path):
    with plug_in(tmp_path) as (device, send):
        send((BUTTON | INITIAL, 4, 0))
        assert device.buttons == [0, 0, 0, 0, 0]
        send((BUTTON, 4, 1), (BUTTON, 1, 1))
        assert device.buttons == [0, 1, 0, 0, 1]
        send((BUTTON, 4, 0))
        assert device.buttons == [0, 1, 0, 0, 0]


def test_a_stick_that_rests_off_its_center_does_not_drive(tmp_path):
    with plug_in(tmp_path, deadzone=0.1) as (device, send):
        send((AXIS, 0, 3000), (AXIS, 1, -16384))
        assert device.axes[0] == 0.0
        assert device.axes[1] == pytest.approx((0.5 - 0.1) / 0.9, abs=0.001)


def test_what_is_neither_axis_nor_button_is_left_out(tmp_path):
    with plug_in(tmp_path) as (device, send):
        send((0x10, 0, 5), (AXIS, 0, 0))
        assert device.axes == [0.0] and device.buttons == []


def test_without_a_change_the_state_stays(tmp_path):
    with plug_in(tmp_path) as (device, send):
        send((AXIS, 0, -32767))
        device.read(0.0)
        assert device.axes == [1.0]


def test_a_joystick_that_is_unplugged_ends_the_program_with_its_name(tmp_path):
    path = tmp_path / "js0"
    os.mkfifo(str(path))
    keep = os.open(str(path), os.O_RDWR)
    with contextlib.closing(JoystickDevice(str(path))) as device:
        os.close(keep)
        with pytest.raises(ProgramError, match="js0 has gone: plug it in"):
            device.read(1.0)


@pytest.mark.parametrize(
    "error, told", [(PermissionError, "usermod -a -G input"), (OSError(5, "Input/output error"), "Input/output error")]
)
def test_a_device_that_cannot_be_opened_names_the_remedy(monkeypatch, error, told):
    def refuse(path, flags):
        assert path == "/dev/input/js1"
        raise error

    monkeypatch.setattr("hero_examples.driving.joy_driver.os.open", refuse)
    with pytest.raises(ProgramError, match=told):
        JoystickDevice("/dev/input/js1")


def test_a_joystick_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ProgramError, match="no joystick .*js9: plug it in; ls /dev/input/js"):
        JoystickDevice(str(tmp_path / "js9"))
