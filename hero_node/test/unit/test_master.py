"""A master that cannot be asked is one line, whatever ROS_MASTER_URI holds."""

import errno
import sys
import xmlrpc.client

import pytest

from hero_node.errors import NodeError
from hero_node.ros import master
from hero_node.ros.master import (
    LimitedTransport,
    ask_master,
    check_master,
    find_running_node,
    read_master_uri,
)

BAD_URIS = (
    *("", "localhost", "localhost:11311", "http://", "http://[::1", "http://localhost", "http://localhost:port"),
    *("http://localhost:99999", "http://localhost:0", "http://a..b:11311", "ftp://localhost:11311", "http://:11311"),
    "http://localhost:\x1b[2J",
)


@pytest.mark.parametrize("uri", BAD_URIS)
def test_a_bad_address_of_the_master_is_one_line_with_the_remedy(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    for act in (read_master_uri, check_master, lambda: ask_master("getPid")):
        with pytest.raises(NodeError) as raised:
            act()
        assert str(raised.value) == "ROS_MASTER_URI is %s, but must be like http://localhost:11311" % ascii(uri)


@pytest.mark.parametrize("uri", ["http://localhost:11311", "http://10.42.0.1:11311/", "http://[::1]:11311"])
def test_an_address_of_a_master_is_taken_as_it_is(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    assert read_master_uri() == uri


@pytest.mark.parametrize("uri", ["http://localhost:99999", "http://a..b:1", "x"])
def test_a_node_without_an_address_does_not_run(monkeypatch, uri):
    monkeypatch.setattr(master, "ask_master", lambda method, name: {"lookupNode": uri}[method])
    assert find_running_node("robot") == ""


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
