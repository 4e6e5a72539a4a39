"""measure_delay with a robot in virtual time whose delays are known."""

import contextlib
import math
import sys
from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="the program imports rospy")
from nav_msgs.msg import Odometry
from rospy import Time

from hero_client import ProgramError
from hero_examples.driving import measure_delay
from hero_node import wrap_angle


class Stage:
    """A robot that turns delay_s after a command; its odometry of every 10 ms has noise, and arrives 15 ms late."""

    def __init__(self, monkeypatch, delay_s=0.1, yaw_rad=3.1, ends_s=1e9):
        self.now_s, self.delay_s, self.ends_s = 100.0, delay_s, ends_s
        self.yaw_rad, self.commands, self.stopped, self.receive = yaw_rad, [], 0, None
        self.noise_rad, self.set_s = 0.003, 0.0
        rospy = measure_delay.rospy
        self.ahead_s = 0.0  # of ROS
        monkeypatch.setattr(rospy, "get_time", lambda: self.now_s + self.ahead_s)
        monkeypatch.setattr(measure_delay, "read_duration_clock_s", lambda: self.now_s)
        monkeypatch.setattr(rospy, "Subscriber", self.subscribe)

    def subscribe(self, topic, kind, receive, tcp_nodelay):
        assert (topic, kind, tcp_nodelay) == ("/hero_3/odom", Odometry, True)
        self.receive = receive
        return SimpleNamespace(unregister=lambda: setattr(self, "receive", None))

    def drive(self, linear_m_s, angular_rad_s):
        assert linear_m_s == 0.0
        self.commands.append((self.now_s, angular_rad_s))
        self.ahead_s += self.set_s

    def stop(self):
        self.stopped += 1

    def sleep(self, duration_s):
        for _ in range(max(1, round(duration_s / 0.01))):
            self.now_s += 0.01
            told = [speed for time_s, speed in self.commands if time_s + self.delay_s <= self.now_s]
            self.yaw_rad = wrap_angle(self.yaw_rad + 0.01 * (told[-1] if told else 0.0))
            message = Odometry()
            message.header.stamp = Time.from_sec(self.now_s + self.ahead_s - 0.015)
            orientation = message.pose.pose.orientation
            self.noise_rad = -self.noise_rad
            half_rad = (self.yaw_rad + self.noise_rad) / 2.0
            orientation.z, orientation.w = math.sin(half_rad), math.cos(half_rad)
            self.receive(message)
        return self.now_s < self.ends_s

    def measure(self, turns):
        robot = SimpleNamespace(namespace="/hero_3", drive=self.drive, stop=self.stop)
        return measure_delay.measure(self, robot, turns)


@pytest.mark.parametrize("yaw_rad", [math.pi, -3.1, 0.0])
def test_delays_of_messages_and_motions_are_measured_to_both_sides(monkeypatch, yaw_rad):
    stage = Stage(monkeypatch, yaw_rad=yaw_rad)
    found = stage.measure(4)
    # It turns at 2 rad/s: 0.03 rad more take 20 ms, and one of the readings every 10 ms tells.
    assert len(found["command to motion"]) == 4
    assert found["command to motion"] == pytest.approx([115.0] * 4, abs=11.0)
    assert set(map(round, found["message delay"])) == {15}
    assert [speed for _, speed in stage.commands] == [0.0, 2.0, 0.0, -2.0] * 2
    rests_s = [after - before for (before, speed), (after, _) in zip(stage.commands, stage.commands[1:]) if not speed]
    assert rests_s == pytest.approx([1.0] * 4)
    assert stage.stopped == 1 and stage.receive is None


@pytest.mark.parametrize("set_s", [-20.0, 3600.0])
def test_setting_the_clock_changes_no_measured_delay(monkeypatch, set_s):
    stage = Stage(monkeypatch)
    stage.set_s = set_s  # at each command
    stage.now_s = 1000.0
    found = stage.measure(4)
    assert found["command to motion"] == pytest.approx([115.0] * 4, abs=11.0)
    assert set(map(round, found["message delay"])) == {15}


def test_a_robot_that_does_not_move_is_given_two_seconds(monkeypatch):
    stage = Stage(monkeypatch, delay_s=9.0)
    assert stage.measure(1)["command to motion"] == [] and stage.now_s == pytest.approx(103.0, abs=0.02)
    ended = Stage(monkeypatch, ends_s=100.5)
    assert ended.measure(3)["command to motion"] == [] and ended.commands == [(100.0, 0.0)] and ended.stopped == 1
    silent = Stage(monkeypatch)
    silent.receive, silent.sleep = None, lambda duration_s: True
    assert silent.measure(3) == {"message delay": [], "command to motion": []}


def test_without_matplotlib_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.setattr(measure_delay, "Program", lambda name: contextlib.nullcontext())
    monkeypatch.setattr(measure_delay, "read_parameters", lambda declared: {})
    with pytest.raises(ProgramError, match="apt install python3-matplotlib"):
        measure_delay.main()
