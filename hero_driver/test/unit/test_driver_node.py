"""The driver's node at its end: rospy has closed its topics, or is about to."""

from types import SimpleNamespace

import pytest
import rospy

from hero_driver.node import DriverNode


def test_a_report_that_meets_closed_topics_is_left_out_at_the_end_only(monkeypatch):
    def publish(status):
        assert status == "status"
        raise rospy.ROSException("publish() to a closed topic")

    node = DriverNode.__new__(DriverNode)
    node._loop = SimpleNamespace(ask=lambda _, limit_s: "status")
    # rosnode kill: rospy closes topics while it is going down, and says that it is down after that.
    monkeypatch.setattr(rospy.core, "_in_shutdown", True)
    assert not rospy.is_shutdown()
    node._report(SimpleNamespace(publish=publish), False)
    monkeypatch.setattr(rospy.core, "_in_shutdown", False)
    with pytest.raises(rospy.ROSException):
        node._report(SimpleNamespace(publish=publish), False)
