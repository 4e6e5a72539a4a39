"""The simulator's node at a ROS master that ends and is started again, in virtual time."""

import re

import pytest

from hero_node.errors import NodeError
from hero_sim import node
from hero_sim.errors import OptionError


class LooksThenEnd:
    """Stands for the event that ends the watch, and for MasterWatch: each wait is followed by one look."""

    def __init__(self, outcomes):
        self.outcomes = list(outcomes)
        self.waited_s = 0.0

    def wait(self, timeout_s):
        self.waited_s += timeout_s
        return not self.outcomes

    def look(self):
        outcome = self.outcomes.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome


@pytest.mark.parametrize("failure", [NodeError("no answer"), OSError("refused"), node.xmlrpc.client.Error()])
def test_a_master_that_is_started_again_is_registered_with(monkeypatch, failure):
    looks, warnings = LooksThenEnd(["", failure, failure, "registered again", ""]), []
    monkeypatch.setattr(node, "MasterWatch", lambda: looks)
    monkeypatch.setattr(node.rospy, "logwarn", warnings.append)
    node.watch_master(looks)
    assert warnings == ["registered again"]
    assert looks.waited_s == 6 * node.MASTER_WATCH_S


def test_an_address_at_which_no_master_can_ever_be_is_refused(monkeypatch):
    for uri in ("localhost", "http://", "http://localhost:99999", "ftp://localhost:11311", "http://[::1"):
        monkeypatch.setenv("ROS_MASTER_URI", uri)
        with pytest.raises(OptionError, match="ROS_MASTER_URI is %s, but" % re.escape(repr(uri))):
            node.check_environment()
    monkeypatch.setenv("ROS_MASTER_URI", "http://localhost:11311")
    node.check_environment()
