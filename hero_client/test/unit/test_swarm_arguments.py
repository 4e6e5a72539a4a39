"""What a Swarm is made of: numbers of robots, or an error that says so before anything is connected."""

import pytest

pytest.importorskip("rospy", reason="Swarm imports rospy")
from hero_client.swarm import Swarm


@pytest.mark.parametrize("wrong", [3, "012", True, None])
def test_a_swarm_of_no_list_is_refused_with_what_to_write(wrong):
    with pytest.raises(ValueError, match=r"such as \[0, 1, 2\] or range\(3\), not by %r" % (wrong,)):
        Swarm(wrong)
