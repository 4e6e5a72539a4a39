"""Addresses that only programs on this PC can reach, and its own."""

import pytest

from hero_node.addresses import find_source_address, is_loopback


@pytest.mark.parametrize("host", ["127.0.0.1", "127.3.2.1", "::1", "[::1]", "localhost"])
def test_loopback_is_this_machine_alone(host):
    assert is_loopback(host)


@pytest.mark.parametrize(
    "host", ["0.0.0.0", "::", "[::]", "192.168.1.5", "10.42.0.1", "", "pc", "robots.lan", "localhost.evil.example"]
)
def test_everything_else_is_reached_from_outside(host):
    assert not is_loopback(host)


def test_the_source_address_is_that_of_the_route_and_empty_without_one():
    assert find_source_address("127.0.0.9") == "127.0.0.1"
    assert find_source_address("255.255.255.255") == ""  # sockets may not send to all
