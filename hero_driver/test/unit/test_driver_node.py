"""The driver's node: addresses at which it cannot listen, and its end, when rospy closes its topics."""

from types import SimpleNamespace

import pytest
import rospy

from hero_driver.config import read_config
from hero_driver.node import DriverNode
from hero_driver.transport.event_loop import EventLoop
from hero_node import ProgramError


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


@pytest.mark.parametrize(
    ("host", "words"),
    [
        ("192.0.2.1", "~host 192.0.2.1, ~port 0 is not an address of this machine"),
        ("10.42.0..1", "'10.42.0..1' cannot be found"),
    ],
)
def test_a_host_that_is_not_this_machine_is_named_with_a_remedy(host, words):
    node = DriverNode.__new__(DriverNode)
    node._config, node._gateway = read_config({"host": host, "port": 0}), None
    node._loop = EventLoop(host, 0, 10.0)
    with pytest.raises(ProgramError) as caught:
        node.open()
    assert words in str(caught.value) and "`ip address` shows" in str(caught.value)
