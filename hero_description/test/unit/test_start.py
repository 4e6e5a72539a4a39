"""Nodes that cannot reach a ROS master end in one line."""

import pytest

from hero_description.start import start_node


@pytest.mark.parametrize("uri", ["localhost", "http://", "http://localhost:99999", "ftp://x", "http://127.0.0.1:1"])
def test_without_a_master_a_node_ends_with_one_line(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(SystemExit) as end:
        start_node("lights")
    assert str(end.value).startswith("lights: no ROS master at %r" % uri)
    assert "\n" not in str(end.value)
