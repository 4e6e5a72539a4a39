"""Reading a joystick: records as the kernel sends them, and a device that is not there, or goes."""

import itertools
import os
import struct
from unittest import mock

import pytest

joy_driver = pytest.importorskip("hero_examples.driving.joy_driver", reason="imports rospy")
from sensor_msgs.msg import Joy  # noqa: E402

from hero_client import Program, ProgramError  # noqa: E402

BUTTON, AXIS, INITIAL = 1, 2, 0x80


def pack(*records):
    """Return records of kind, number and value."""
    return b"".join(struct.pack("=IhBB", 7, value, kind, number) for kind, number, value in records)


def note(joy, *records, deadzone=0.0):
    joy_driver.note_changes(joy, pack(*records), deadzone)
    return joy.axes, joy.buttons


@pytest.fixture(name="joy")
def make_joy():
    return Joy(axes=[], buttons=[])


def test_axes_are_positive_to_the_left_and_up_and_full_at_one(joy):
    initial = [(AXIS | INITIAL, 0, 0), (AXIS | INITIAL, 1, 0), (BUTTON | INITIAL, 0, 0)]
    assert note(joy, *initial) == ([0.0, 0.0], [0])
    assert note(joy, (AXIS, 1, -32767), (AXIS, 0, 32767))[0] == [-1.0, 1.0]
    assert note(joy, (AXIS, 0, -32768))[0] == [1.0, 1.0], "one more than full"


def test_buttons_are_pressed_and_released(joy):
    assert note(joy, (BUTTON | INITIAL, 4, 0))[1] == [0, 0, 0, 0, 0]
    assert note(joy, (BUTTON, 4, 1), (BUTTON, 1, 1))[1] == [0, 1, 0, 0, 1]
    assert note(joy, (BUTTON, 4, 0))[1] == [0, 1, 0, 0, 0]


def test_a_stick_that_rests_off_its_center_does_not_drive(joy):
    axes, _ = note(joy, (AXIS, 0, 3000), (AXIS, 1, -16384), deadzone=0.1)
    assert axes[0] == 0.0
    assert axes[1] == pytest.approx((0.5 - 0.1) / 0.9, abs=0.001)


def test_what_is_neither_axis_nor_button_is_left_out(joy):
    assert note(joy, (0x10, 0, 5), (AXIS, 0, 0)) == ([0.0], [])


class Stage:
    """A program that reads the named pipe at path, in place of a device.

    sent: the axes of each message; stamps_s: when they were sent, as they say.
    """

    def __init__(self, monkeypatch, path):
        self.path, self.sent, self.stamps_s, self.ends = str(path), [], [], []
        os.mkfifo(self.path)
        self.kernel = os.open(self.path, os.O_RDWR)
        now_s = itertools.count(100)
        monkeypatch.setattr(joy_driver.rospy, "Publisher", lambda topic, kind, queue_size: self)
        monkeypatch.setattr(joy_driver.rospy.Time, "now", lambda: joy_driver.rospy.Time(next(now_s)))
        self.program = mock.create_autospec(Program, instance=True, running=True)
        self.program.wait_readable.side_effect = self.wait

    def publish(self, joy):
        self.sent.append(list(joy.axes))
        self.stamps_s.append(joy.header.stamp.to_sec())

    def wait(self, fds, timeout_s):
        """Take the next of what happens."""
        assert timeout_s == pytest.approx(0.05)
        return fds if self.ends.pop(0)() else []

    def run(self, *ends):
        self.ends = list(ends)
        joy_driver.publish(self.program, self.path, 0.0, 20.0)

    def stop(self):
        self.program.running = False


def test_a_device_is_published_at_each_change_and_again_without_one(monkeypatch, tmp_path):
    stage = Stage(monkeypatch, tmp_path / "js0")
    stage.run(lambda: os.write(stage.kernel, pack((AXIS, 0, -32767))), lambda: False, stage.stop)
    assert stage.sent == [[1.0]] * 3 and stage.stamps_s == [100.0, 101.0, 102.0]
    os.close(stage.kernel)


def test_a_joystick_that_is_unplugged_ends_the_program_with_its_name(monkeypatch, tmp_path):
    stage = Stage(monkeypatch, tmp_path / "js0")
    with pytest.raises(ProgramError, match=r"no joystick .*/js0 \(No such device\): plug it in"):
        stage.run(lambda: os.close(stage.kernel) is None)


@pytest.mark.parametrize("error", [FileNotFoundError(2, "No such file"), PermissionError(13, "Permission denied")])
def test_a_device_that_cannot_be_opened_is_named_with_the_remedy(monkeypatch, tmp_path, error):
    stage = Stage(monkeypatch, tmp_path / "js1")
    os.close(stage.kernel)
    monkeypatch.setattr(joy_driver.os, "open", mock.create_autospec(os.open, side_effect=error))
    with pytest.raises(ProgramError, match=r"no joystick .*/js1 \(%s\): .*usermod -a -G input" % error.strerror):
        stage.run()
