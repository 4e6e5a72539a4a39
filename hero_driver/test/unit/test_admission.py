"""Who may connect, how many at once, and how much one of them may send."""

import ipaddress

import pytest

from hero_driver.fleet.admission import (
    ARRIVALS_PER_S,
    GARBAGE_LENGTH_MAX,
    GARBAGE_REST_LENGTH,
    HOLD_S,
    PASSERS_MAX,
    PASSERS_PER_S,
    STAY_S,
    Admission,
    AdmissionLimits,
    RateGuard,
)

ROBOT = "10.42.0.17"


def make_admission(*networks, **limits):
    return Admission(AdmissionLimits(allow=tuple(map(ipaddress.ip_network, networks)), **limits))


@pytest.mark.parametrize("host", [ROBOT, "127.0.0.1", "::1", "fe80::1%wlan0"])
def test_every_address_may_come_by_default(host):
    assert make_admission().admit(host) is None


@pytest.mark.parametrize("host", [ROBOT, "10.42.0.255", "::ffff:10.42.0.17", "fe80::1%wlan0", "192.168.4.1"])
def test_addresses_of_the_allowed_networks_may_come(host):
    assert make_admission("10.42.0.0/24", "fe80::/10", "192.168.4.1").admit(host) is None


@pytest.mark.parametrize(
    "host", ["10.42.1.17", "192.168.4.2", "::ffff:10.42.1.17", "2001:db8::1", "127.0.0.1"]
)
def test_other_addresses_are_refused_with_the_name_of_the_parameter(host):
    admission = make_admission("10.42.0.0/24", "fe80::/10", "192.168.4.1")
    assert "~allow" in admission.admit(host)
    assert admission.unidentified == 0


def test_connections_beyond_the_total_are_refused_until_one_leaves():
    admission = make_admission(max_connections=2)
    assert admission.admit("10.0.0.1") is None
    assert admission.admit("10.0.0.2") is None
    assert "more than 2 connections (~max_connections)" in admission.admit("10.0.0.3")
    admission.release("10.0.0.1")
    assert admission.admit("10.0.0.3") is None


def test_where_all_places_are_taken_the_address_with_the_most_gives_one_up():
    admission = make_admission("10.0.0.0/24", max_connections=4, max_connections_per_address=3)
    for host in ("10.0.0.1", "10.0.0.2", "10.0.0.2"):
        admission.admit(host)
    assert admission.find_largest("10.0.0.3") is None, "there is room"
    admission.admit("10.0.0.2")
    for host in ("10.0.0.1", "10.0.0.2", "10.0.0.3"):
        admission.note_identified(host)
    assert admission.find_largest("10.0.0.3") == "10.0.0.2"
    assert admission.find_largest("10.0.0.1") == "10.0.0.2"
    assert admission.find_largest("10.0.0.2") is None, "its own newcomer has to wait"
    assert admission.find_largest("10.0.1.1") is None, "it may not come anyway"


def test_addresses_that_have_the_same_share_do_not_take_places_from_each_other():
    admission = make_admission(max_connections=4)
    for host in ("10.0.0.1", "10.0.0.1", "10.0.0.2", "10.0.0.2"):
        admission.admit(host)
    assert admission.find_largest("10.0.0.1") is None
    assert admission.find_largest("10.0.0.3") in ("10.0.0.1", "10.0.0.2")


def test_connections_of_one_address_are_limited_each_on_its_own():
    admission = make_admission(max_connections_per_address=1)
    assert admission.admit("10.0.0.1") is None
    assert "~max_connections_per_address" in admission.admit("10.0.0.1")
    assert admission.admit("10.0.0.2") is None
    admission.release("10.0.0.1")
    assert admission.admit("10.0.0.1") is None


def test_connections_that_say_nothing_are_limited():
    admission = make_admission(max_unidentified=1)
    assert admission.admit("10.0.0.1") is None
    assert "~max_unidentified" in admission.admit("10.0.0.2")
    admission.note_identified("10.0.0.1")
    assert admission.admit("10.0.0.2") is None


def test_where_too_many_say_nothing_the_address_with_the_most_of_them_makes_room():
    admission = make_admission("10.0.0.0/24", max_unidentified=4)
    for host in ("10.0.0.1", "10.0.0.2", "10.0.0.2"):
        admission.admit(host)
    assert admission.find_crowd("10.0.0.3") is None, "there is room"
    admission.admit("10.0.0.2")
    assert admission.find_crowd("10.0.0.3") == "10.0.0.2"
    assert admission.find_crowd("10.0.0.1") == "10.0.0.2"
    assert admission.find_crowd("10.0.0.2") is None, "its own newcomer has to wait"
    assert admission.find_crowd("10.9.9.9") is None, "it may not come at all"


def test_an_address_with_one_silent_connection_never_makes_room():
    admission = make_admission(max_unidentified=3)
    for number in range(3):
        admission.admit("10.0.0.%d" % number)
    assert admission.find_crowd("10.0.0.9") is None


def test_a_refused_connection_counts_nowhere():
    admission = make_admission(max_connections=1)
    admission.admit("10.0.0.1")
    for _ in range(10):
        admission.admit("10.0.0.2")
    admission.release("10.0.0.1")
    assert admission.admit("10.0.0.2") is None
    assert admission.unidentified == 2


def test_addresses_that_left_are_forgotten():
    admission = make_admission()
    for number in range(256):
        host = "10.0.0.%d" % number
        assert admission.admit(host) is None
        admission.note_identified(host)
        admission.release(host)
    assert len(admission._by_host) == len(admission._unidentified) == 0


# Rates.


def test_a_stock_robot_stays_far_below_the_limits():
    guard = RateGuard(5000, 2000000, 0.0)
    for step in range(1000):
        assert guard.judge(7 * step, 1500 * step, step * 0.034) is None


def test_too_many_packets_within_a_second_are_too_much():
    guard = RateGuard(100, 10**6, 0.0)
    assert guard.judge(100, 800, 0.5) is None
    assert guard.judge(101, 808, 0.9) == "more than 100 packets per second (~max_packets_per_s)"


def test_too_many_bytes_within_a_second_are_too_much():
    guard = RateGuard(100, 10000, 0.0)
    assert guard.judge(1, 10000, 0.5) is None
    assert guard.judge(2, 10001, 0.9) == "more than 10000 bytes per second (~max_bytes_per_s)"


def test_a_new_second_begins_anew():
    guard = RateGuard(100, 10000, 0.0)
    for second in range(5):
        assert guard.judge(100 * (second + 1), 10000 * (second + 1), float(second)) is None


def test_a_pause_is_no_credit():
    guard = RateGuard(100, 10000, 0.0)
    assert guard.judge(100, 10000, 100.0) is None
    assert guard.judge(101, 10008, 100.5) is not None


def test_bytes_without_a_good_packet_end_it_however_slowly_they_come():
    guard = RateGuard(5000, 2000000, 0.0)
    received = 0
    while received + 1000 <= GARBAGE_LENGTH_MAX:
        received += 1000
        assert guard.judge(0, received, received * 0.01) is None
    refusal = guard.judge(0, received + 1000, received * 0.01)
    assert refusal == "%d bytes without one good packet: this does not speak rosserial" % (received + 1000)


def test_a_good_packet_forgives_the_garbage_before_it():
    guard = RateGuard(5000, 2000000, 0.0)
    for step in range(100):
        received = 60008 * step
        assert guard.judge(step, received + 60000, step * 2.0) is None
        assert guard.judge(step + 1, received + 60008, step * 2.0 + 1.0) is None


def test_a_read_without_a_good_packet_is_garbage_and_what_is_left_of_a_packet_is_not():
    guard = RateGuard(5000, 2000000, 0.0)
    guard.judge(1, 10000, 0.1)
    guard.judge(1, 10000 + GARBAGE_REST_LENGTH - 1, 0.2)
    assert not guard.hears_garbage
    guard.judge(1, 10000 + GARBAGE_REST_LENGTH, 0.2)
    assert guard.hears_garbage
    guard.judge(2, 10000 + GARBAGE_REST_LENGTH, 0.3)
    assert not guard.hears_garbage


def test_an_address_that_comes_under_ever_new_names_has_to_wait():
    admission = make_admission(max_connections_per_address=10)
    assert [admission.admit_arrival(ROBOT, 5.0) for _ in range(10)] == [None] * 10
    assert "more than 10 new robots of one address" in admission.admit_arrival(ROBOT, 5.0)
    let_in = sum(admission.admit_arrival(ROBOT, 5.0 + 0.02 * step) is None for step in range(1, 501))
    assert let_in == pytest.approx(10 * ARRIVALS_PER_S, abs=1)
    assert admission.admit_arrival("10.42.0.18", 15.0) is None
    assert [admission.admit_arrival(ROBOT, 100.0) for _ in range(10)] == [None] * 10


def test_a_hundred_simulated_robots_started_again_and_again_all_join_at_once():
    admission = make_admission(max_connections_per_address=400)
    for start in range(100):
        assert not any(admission.admit_arrival("127.0.0.1", 30.0 * start) for _ in range(100))


def test_addresses_that_come_once_are_forgotten():
    admission = make_admission(max_connections_per_address=4)
    for number in range(10000):
        assert admission.admit_arrival("10.%d.%d.1" % divmod(number, 200), 0.01 * number) is None
        admission.note_departure("10.%d.%d.1" % divmod(number, 200), 0.1, 0.01 * number)
    assert len(admission._arrivals._left) <= 1001
    assert len(admission._passers._left) <= 1001


def test_after_some_that_left_at_once_the_robots_of_an_address_have_to_stay_before_they_get_topics():
    admission = make_admission()
    for _ in range(PASSERS_MAX):
        assert admission.find_hold_s(ROBOT, 5.0) == 0.0
        admission.note_departure(ROBOT, 0.02, 5.0)
    assert admission.find_hold_s(ROBOT, 5.0) == HOLD_S
    assert admission.find_hold_s("10.42.0.18", 5.0) == 0.0
    for second in range(100):
        admission.note_departure(ROBOT, 0.02, 5.0 + second)
    assert admission.find_hold_s(ROBOT, 105.0) == HOLD_S
    assert admission.find_hold_s(ROBOT, 105.0 + 2.0 / PASSERS_PER_S) == 0.0


def test_robots_that_stayed_and_leave_together_are_not_held():
    admission = make_admission()
    for _ in range(200):
        admission.note_departure(ROBOT, STAY_S, 5.0)
    assert admission.find_hold_s(ROBOT, 5.0) == 0.0
