"""A master that cannot be asked is one line, whatever ROS_MASTER_URI holds."""

import errno
import sys
import xmlrpc.client

import pytest

from hero_node.errors import NodeError
from hero_node.ros.master import LimitedTransport, ask_master

BAD_URIS = (
    *("", "localhost", "http://", "http://[::1", "http://localhost:port", "http://localhost:99999"),
    *("http://a..b:11311", "ftp://localhost"),
)


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


@pytest.mark.parametrize("error", [ConnectionRefusedError(errno.ECONNREFUSED, "refused"), OSError("timed out")])
def test_every_error_of_a_connection_has_a_number(monkeypatch, error):
    def fail(*arguments):
        raise error

    monkeypatch.setattr(xmlrpc.client.Transport, "single_request", fail)
    with pytest.raises(OSError) as raised:
        LimitedTransport().single_request("localhost", "/", b"")
    assert raised.value.errno == (error.errno or errno.ETIMEDOUT)
