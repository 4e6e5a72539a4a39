"""Connections of the monitor's clients: untrusted ones cannot lock out those who are logged in."""

import pytest

from hero_monitor.serving.client_limits import ClientLimits, group_address

OWNER, UNTRUSTED = "10.0.0.1", "10.0.0.2"


class FakeConnection:
    def __init__(self):
        self.is_closed = False

    def close(self):
        self.is_closed = True

    def closed(self):
        return self.is_closed


def connect(limits, address, count=1, now_s=0.0):
    connections = [FakeConnection() for _ in range(count)]
    for connection in connections:
        assert limits.admit(connection, address, now_s)
    return connections


def count_open(connections):
    return sum(not connection.closed() for connection in connections)


def test_an_address_with_too_many_connections_loses_its_oldest():
    limits = ClientLimits(100, 5)
    connections = connect(limits, UNTRUSTED, 7)
    assert [connection.closed() for connection in connections] == [True] * 2 + [False] * 5


def test_trusted_connections_do_not_count_for_their_address():
    limits = ClientLimits(100, 5)
    own = connect(limits, OWNER, 5)
    for connection in own:
        limits.trust(connection)
    assert count_open(connect(limits, OWNER, 5)) == 5
    assert count_open(own) == 5


def test_where_all_places_are_taken_the_address_with_the_most_loses_one():
    limits = ClientLimits(10, 8)
    own, others = connect(limits, OWNER, 2), connect(limits, UNTRUSTED, 8)
    own += connect(limits, OWNER)
    assert count_open(own) == 3
    assert [connection.closed() for connection in others] == [True] + [False] * 7


def test_a_trusted_connection_is_never_evicted_for_another():
    limits = ClientLimits(10, 50)
    (own,) = connect(limits, OWNER)
    limits.trust(own)
    for number in range(200):
        connect(limits, "10.0.1.%d" % (number % 50), now_s=float(number))
    assert not own.closed()


def test_a_new_connection_is_refused_only_where_all_are_trusted():
    limits = ClientLimits(3, 3)
    own = connect(limits, OWNER, 3)
    for connection in own:
        limits.trust(connection)
    assert not limits.admit(FakeConnection(), OWNER, 1.0)
    own[0].close()
    assert limits.admit(FakeConnection(), OWNER, 1.0)


def test_closed_connections_make_room():
    limits = ClientLimits(10, 3)
    first = connect(limits, UNTRUSTED, 3)
    first[2].close()
    connect(limits, UNTRUSTED)
    assert count_open(first) == 2


@pytest.mark.parametrize(
    ("address", "group"),
    [
        ("10.0.0.1", "10.0.0.1"),
        ("::ffff:10.0.0.1", "10.0.0.1"),
        ("fe80::1%wlan0", "fe80::/64"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("", ""),
    ],
)
def test_an_ipv6_network_counts_as_one_address(address, group):
    assert group_address(address) == group
