"""Who may connect, how many at once, and how much one of them may send."""

import ipaddress

import pytest

from hero_driver.fleet.admission import (
    GARBAGE_BURST_LENGTH,
    GARBAGE_PER_S,
    NEW_ROBOTS_PER_S,
    Admission,
    AdmissionLimits,
    RateLimit,
)

ROBOT = "10.42.0.17"


def make_admission(*networks, **limits):
    return Admission(AdmissionLimits(allow=tuple(map(ipaddress.ip_network, networks)), **limits))


def connect(admission, *hosts):
    """Return the connections of these hosts, all of which are admitted."""
    connections = [object() for _ in hosts]
    assert [admission.admit(*each) for each in zip(connections, hosts)] == [None] * len(hosts)
    return connections


def try_to_connect(admission, host):
    """Return why a connection is refused."""
    return admission.admit(object(), host)


@pytest.mark.parametrize("host", [ROBOT, "127.0.0.1", "::1", "fe80::1%wlan0"])
def test_every_address_may_come_by_default(host):
    assert try_to_connect(make_admission(), host) is None


@pytest.mark.parametrize("host", [ROBOT, "10.42.0.255", "::ffff:10.42.0.17", "fe80::1%wlan0", "192.168.4.1"])
def test_addresses_of_the_allowed_networks_may_come(host):
    assert try_to_connect(make_admission("10.42.0.0/24", "fe80::/10", "192.168.4.1"), host) is None


@pytest.mark.parametrize("host", ["10.42.1.17", "192.168.4.2", "::ffff:10.42.1.17", "2001:db8::1", "127.0.0.1"])
def test_other_addresses_are_refused_with_the_name_of_the_parameter(host):
    admission = make_admission("10.42.0.0/24", "fe80::/10", "192.168.4.1")
    assert "~allow" in try_to_connect(admission, host)
    assert len(admission._unidentified) == 0


def test_connections_beyond_the_total_are_refused_until_one_leaves():
    admission = make_admission(max_connections=2)
    first, _ = connect(admission, "10.0.0.1", "10.0.0.2")
    assert "more than 2 connections (~max_connections)" in try_to_connect(admission, "10.0.0.3")
    admission.release(first)
    connect(admission, "10.0.0.3")


def test_where_all_places_are_taken_the_address_with_the_most_gives_one_up():
    admission = make_admission("10.0.0.0/24", max_connections=4, max_connections_per_address=3)
    first, *of_the_largest = connect(admission, "10.0.0.1", "10.0.0.2", "10.0.0.2")
    assert admission.find_eviction("10.0.0.3") is None, "there is room"
    of_the_largest += connect(admission, "10.0.0.2")
    admission.note_identified(first)
    admission.note_identified(of_the_largest[0])
    assert admission.find_eviction("10.0.0.3") == (of_the_largest[1], "~max_connections"), "the oldest unidentified"
    for connection in of_the_largest:
        admission.note_identified(connection)
    assert admission.find_eviction("10.0.0.3") == (of_the_largest[2], "~max_connections"), "the newest"
    assert admission.find_eviction("10.0.0.1") == (of_the_largest[2], "~max_connections")
    assert admission.find_eviction("10.0.0.2") is None, "its own newcomer has to wait"
    assert admission.find_eviction("10.0.1.1") is None, "it may not come anyway"


def test_addresses_with_equal_shares_do_not_evict_each_other():
    admission = make_admission(max_connections=4)
    connections = connect(admission, "10.0.0.1", "10.0.0.1", "10.0.0.2", "10.0.0.2")
    assert admission.find_eviction("10.0.0.1") is None
    assert admission.find_eviction("10.0.0.3")[0] in connections


def test_connections_of_one_address_are_limited_each_on_its_own():
    admission = make_admission(max_connections_per_address=1)
    (first,) = connect(admission, "10.0.0.1")
    assert "~max_connections_per_address" in try_to_connect(admission, "10.0.0.1")
    connect(admission, "10.0.0.2")
    admission.release(first)
    connect(admission, "10.0.0.1")


def test_connections_that_say_nothing_are_limited():
    admission = make_admission(max_unidentified=1)
    (first,) = connect(admission, "10.0.0.1")
    assert "~max_unidentified" in try_to_connect(admission, "10.0.0.2")
    admission.note_identified(first)
    connect(admission, "10.0.0.2")


def test_at_the_unidentified_cap_the_largest_address_makes_room():
    admission = make_admission("10.0.0.0/24", max_unidentified=4)
    _, oldest, _ = connect(admission, "10.0.0.1", "10.0.0.2", "10.0.0.2")
    assert admission.find_eviction("10.0.0.3") is None, "there is room"
    connect(admission, "10.0.0.2")
    assert admission.find_eviction("10.0.0.3") == (oldest, "~max_unidentified")
    assert admission.find_eviction("10.0.0.1") == (oldest, "~max_unidentified")
    assert admission.find_eviction("10.0.0.2") is None, "its own newcomer has to wait"
    assert admission.find_eviction("10.9.9.9") is None, "it may not come at all"


def test_an_address_with_one_silent_connection_never_makes_room():
    admission = make_admission(max_unidentified=3)
    connect(admission, *("10.0.0.%d" % number for number in range(3)))
    assert admission.find_eviction("10.0.0.9") is None


def test_a_refused_connection_counts_nowhere():
    admission = make_admission(max_connections=1)
    (first,) = connect(admission, "10.0.0.1")
    for _ in range(10):
        assert try_to_connect(admission, "10.0.0.2") is not None
    admission.release(first)
    connect(admission, "10.0.0.2")
    assert len(admission._unidentified) == 1


# Rates.


def make_rate_limit(max_packets_per_s, max_bytes_per_s):
    return RateLimit(AdmissionLimits(max_packets_per_s=max_packets_per_s, max_bytes_per_s=max_bytes_per_s), 0.0)


def test_a_stock_robot_stays_far_below_the_rate_limits():
    limit = make_rate_limit(5000, 2000000)
    for step in range(1000):
        assert limit.admit(7, 1500, step * 0.034) is None


def test_too_many_packets_per_second_are_refused():
    limit = make_rate_limit(100, 10**6)
    assert limit.admit(100, 800, 0.0) is None
    assert limit.admit(51, 408, 0.5) == "more than 100 packets per second (~max_packets_per_s)"


def test_too_many_bytes_per_second_are_refused():
    limit = make_rate_limit(100, 10000)
    assert limit.admit(1, 10000, 0.0) is None
    assert limit.admit(1, 5001, 0.5) == "more than 10000 bytes per second (~max_bytes_per_s)"


def test_the_permitted_rate_can_be_sent_for_ever():
    limit = make_rate_limit(100, 10000)
    for second in range(5):
        assert limit.admit(100, 10000, float(second)) is None


def test_a_pause_earns_no_more_than_one_second_of_tokens():
    for packets_per_s, bytes_per_s in ((100, 10**6), (10**6, 10000)):
        limit = make_rate_limit(packets_per_s, bytes_per_s)
        assert limit.admit(100, 10000, 100.0) is None
        assert limit.admit(1, 8, 100.0) is not None


def test_an_address_may_send_only_so_many_bytes_outside_of_packets():
    admission = make_admission()
    assert admission.admit_garbage(ROBOT, GARBAGE_BURST_LENGTH, 0.0) is None
    assert "this does not speak rosserial" in admission.admit_garbage(ROBOT, 4096, 0.1)
    assert admission.admit_garbage("10.42.0.18", 4096, 0.1) is None, "another address has its own"
    assert admission.admit_garbage(ROBOT, 4096, 0.1 + 4096 / GARBAGE_PER_S) is None


def test_new_robot_names_are_rate_limited_per_address():
    admission = make_admission(max_connections_per_address=10)
    assert [admission.admit_new_robot(ROBOT, 5.0) for _ in range(10)] == [None] * 10
    assert "more than 10 new robots from one address" in admission.admit_new_robot(ROBOT, 5.0)
    let_in = sum(admission.admit_new_robot(ROBOT, 5.0 + 0.02 * step) is None for step in range(1, 501))
    assert let_in == pytest.approx(10 * NEW_ROBOTS_PER_S, abs=1)
    assert admission.admit_new_robot("10.42.0.18", 15.0) is None
    assert [admission.admit_new_robot(ROBOT, 100.0) for _ in range(10)] == [None] * 10


def test_a_hundred_simulated_robots_restarted_repeatedly_join_at_once():
    admission = make_admission(max_connections_per_address=400)
    for start in range(100):
        assert not any(admission.admit_new_robot("127.0.0.1", 30.0 * start) for _ in range(100))


def test_addresses_that_come_once_are_forgotten():
    admission = make_admission(max_connections_per_address=4)
    for number in range(10000):
        assert admission.admit_new_robot("10.%d.%d.1" % divmod(number, 200), 0.01 * number) is None
    assert len(admission._new_robots._buckets) <= 1000
