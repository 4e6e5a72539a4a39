"""The time of a session over ROS."""

from types import SimpleNamespace

import pytest
import rospy

from hero_calibration.robots import ros_probe
from hero_calibration.robots.ros_probe import RosSession


def test_motions_last_no_longer_when_the_clock_of_the_pc_is_set_back(monkeypatch):
    clocks = SimpleNamespace(ros_s=5000.0, monotonic_s=70.0, is_wallclock=True)
    monkeypatch.setattr(rospy, "get_time", lambda: clocks.ros_s)
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: clocks.is_wallclock)
    monkeypatch.setattr(ros_probe, "time", SimpleNamespace(monotonic=lambda: clocks.monotonic_s))
    session = RosSession(None, [])
    assert session.now_s == pytest.approx(5000.0)
    clocks.ros_s, clocks.monotonic_s = 1400.0, 72.0
    assert session.now_s == pytest.approx(5002.0)
    clocks.is_wallclock = False
    assert session.now_s == 1400.0, "simulated time is that of the simulation"
