"""Stamps of robots: kept where they can be true, replaced where not, always growing."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.corrections.stamps import NS_PER_S, STEP_NS, StampFilter

NOW_NS = 1795240942 * NS_PER_S
MS = 10**6
TOPIC = "/hero_0/odom"


@pytest.mark.parametrize("ahead_ms", [-5000, -1290, -30, 0, 2])
def test_a_stamp_within_the_limits_is_kept(ahead_ms):
    stamps = StampFilter()
    assert stamps.correct(TOPIC, NOW_NS + ahead_ms * MS, NOW_NS) == NOW_NS + ahead_ms * MS
    assert stamps.corrected == 0


@pytest.mark.parametrize("ahead_ms", [3, 13, 50])
def test_a_clock_that_is_ahead_as_its_request_came_late_is_no_fault(ahead_ms):
    stamps = StampFilter()
    assert stamps.correct(TOPIC, NOW_NS + ahead_ms * MS, NOW_NS) == NOW_NS
    assert stamps.corrected == 0


@pytest.mark.parametrize("late_ms", [1, 11, 20])
def test_what_was_read_at_once_keeps_one_stamp_when_it_comes_in_two_reads(late_ms):
    stamps = StampFilter()
    assert stamps.correct(TOPIC, NOW_NS + 13 * MS, NOW_NS) == NOW_NS
    assert stamps.correct("/tf", NOW_NS + 13 * MS, NOW_NS + late_ms * MS) == NOW_NS
    assert stamps.correct(TOPIC, NOW_NS + 47 * MS, NOW_NS + 34 * MS) == NOW_NS + 34 * MS
    assert stamps.corrected == 0


@pytest.mark.parametrize("ahead_ms", [-5001, 51, 10**9])
def test_a_stamp_outside_the_limits_is_replaced_by_its_arrival_and_counted(ahead_ms):
    stamps = StampFilter()
    assert stamps.correct(TOPIC, NOW_NS + ahead_ms * MS, NOW_NS) == NOW_NS
    assert stamps.corrected == 1


def test_stamps_since_boot_are_replaced_until_the_robot_has_the_time():
    stamps = StampFilter()
    for message in range(9):
        arrival_ns = NOW_NS + message * 34 * MS
        assert stamps.correct(TOPIC, 2 * NS_PER_S + message * 34 * MS, arrival_ns) == arrival_ns
    assert stamps.corrected == 9
    arrival_ns = NOW_NS + 9 * 34 * MS
    assert stamps.correct(TOPIC, arrival_ns - MS, arrival_ns) == arrival_ns - MS
    assert stamps.corrected == 9


def test_a_zero_stamp_is_replaced():
    assert StampFilter().correct(TOPIC, 0, NOW_NS) == NOW_NS


def test_a_stamp_that_goes_back_comes_right_behind_the_one_before_it():
    stamps = StampFilter()
    stamps.correct(TOPIC, NOW_NS, NOW_NS)
    assert stamps.correct(TOPIC, NOW_NS - 40 * MS, NOW_NS + MS) == NOW_NS + STEP_NS
    assert stamps.correct(TOPIC, NOW_NS, NOW_NS + MS) == NOW_NS + 2 * STEP_NS
    assert stamps.corrected == 2
    assert stamps.correct(TOPIC, NOW_NS + 34 * MS, NOW_NS + 34 * MS) == NOW_NS + 34 * MS


def test_topics_grow_each_on_its_own():
    stamps = StampFilter()
    stamps.correct("/a", NOW_NS, NOW_NS)
    assert stamps.correct("/b", NOW_NS - MS, NOW_NS) == NOW_NS - MS


def test_stamps_follow_a_restart_of_ros_time():
    stamps = StampFilter()
    stamps.correct("/a", NOW_NS, NOW_NS)
    stamps.correct("/b", NOW_NS, NOW_NS)
    early_ns = 10 * NS_PER_S
    assert stamps.correct("/a", early_ns, early_ns) == early_ns
    assert stamps.correct("/b", early_ns, early_ns) == early_ns


@pytest.mark.parametrize("step_s", [0.2, 1, 4.9, 60])
def test_stamps_are_not_in_the_future_after_the_pcs_clock_is_set_back(step_s):
    stamps = StampFilter()
    stamps.correct(TOPIC, NOW_NS, NOW_NS)
    back_ns = NOW_NS - int(step_s * NS_PER_S)
    for message in range(3):
        arrival_ns = back_ns + message * 34 * MS
        # The robot learns the new time with its next request only; until then it is ahead by the step.
        stamp_ns = NOW_NS + message * 34 * MS
        assert stamps.correct(TOPIC, stamp_ns, arrival_ns) <= arrival_ns + 2 * MS + 2 * STEP_NS


offsets_ms = st.one_of(st.integers(-6000, 200), st.sampled_from([-51, -50, 49, 50, 51, -(10**9), 10**9]))
messages = st.lists(st.tuples(st.sampled_from(["/a", "/b"]), st.integers(1, 3000), offsets_ms), min_size=1, max_size=50)


@given(script=messages)
def test_stamps_always_grow_and_hardly_lie_in_the_future(script):
    stamps = StampFilter()
    arrival_ns, last_ns = NOW_NS, {}
    for topic, pause_ms, ahead_ms in script:
        arrival_ns += pause_ms * MS
        stamp_ns = stamps.correct(topic, arrival_ns + ahead_ms * MS, arrival_ns)
        assert arrival_ns - 5 * NS_PER_S <= stamp_ns <= arrival_ns + 2 * MS + STEP_NS
        assert stamp_ns > last_ns.get(topic, 0)
        last_ns[topic] = stamp_ns


@given(script=messages)
def test_messages_that_arrive_in_one_read_have_stamps_of_their_own(script):
    stamps = StampFilter()
    last_ns = {}
    for topic, _, ahead_ms in script:
        stamp_ns = stamps.correct(topic, NOW_NS + ahead_ms * MS, NOW_NS)
        assert last_ns.get(topic, 0) < stamp_ns <= NOW_NS + 2 * MS + len(script) * STEP_NS
        last_ns[topic] = stamp_ns


@given(
    stamps_ns=st.lists(st.integers(0, 2**32 * NS_PER_S)),
    arrivals_ns=st.lists(st.integers(0, 2**32 * NS_PER_S)),
)
def test_any_stamp_and_any_clock_give_a_stamp(stamps_ns, arrivals_ns):
    stamps = StampFilter()
    for stamp_ns, arrival_ns in zip(stamps_ns, arrivals_ns):
        assert stamps.correct(TOPIC, stamp_ns, arrival_ns) >= 0


@pytest.mark.parametrize(("ahead_ns", "follows_arrival"), [(51 * MS, False), (51 * MS + 1, True)])
def test_ros_time_went_back_where_no_stamp_that_passed_is_so_far_ahead(ahead_ns, follows_arrival):
    stamps = StampFilter()
    stamps.correct(TOPIC, NOW_NS, NOW_NS)
    arrival_ns = NOW_NS - ahead_ns
    assert stamps.correct(TOPIC, arrival_ns, arrival_ns) == (arrival_ns if follows_arrival else NOW_NS + 1000)
    assert stamps.corrected == (not follows_arrival)
