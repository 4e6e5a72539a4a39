"""A node that cannot start says why in one line, whatever ROS_MASTER_URI holds."""

import subprocess
import sys

import pytest

from hero_client.ros_node import ask_master
from hero_client.values.errors import NodeError

BAD_URIS = ("", "localhost", "http://", "http://[::1", "http://localhost:port", "http://a..b:11311", "ftp://localhost")


@pytest.mark.parametrize("uri", BAD_URIS)
def test_a_bad_address_of_the_master_is_one_error(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(NodeError, match="no ROS master at ") as raised:
        ask_master("getPid")
    assert repr(uri) in str(raised.value)


def test_a_malformed_remapping_of_the_master_is_one_error(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["program", "__master:="])
    with pytest.raises(NodeError, match="__master"):
        ask_master("getPid")


@pytest.mark.parametrize("statement", ["Robot(0)", "Swarm([0, 1])", "Swarm.discover()"])
def test_a_plain_script_without_a_master_ends_with_one_line(monkeypatch, statement):
    monkeypatch.setenv("ROS_MASTER_URI", "localhost")
    script = "from hero_client import Robot, Swarm; %s" % statement
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False)
    assert ended.returncode == 1
    (line,) = ended.stderr.decode().splitlines()
    assert "no ROS master at 'localhost'" in line
