"""The simulator's node at a ROS master that ends and is started again, in virtual time."""

import pytest

from hero_node import NodeError
from hero_sim import node


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
