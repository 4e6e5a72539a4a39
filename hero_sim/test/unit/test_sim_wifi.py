import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_sim.link.wifi import PROFILES, Radio
from hero_test.nonempty import nonempty


def carry(profile, seconds=60, period_ms=34, length=1500, seed=0):
    """Send numbered pieces up and return when each arrived, looking every millisecond."""
    radio = Radio(PROFILES[profile], np.random.RandomState(seed))
    sent, arrivals, pieces = 0, [], []
    for now_ms in range(seconds * 1000):
        if now_ms % period_ms == 0:
            radio.up.put(now_ms, sent.to_bytes(4, "little") * (length // 4))
            sent += 1
        data = radio.up.take(now_ms)
        for start in range(0, len(data), length // 4 * 4):
            arrivals.append(now_ms)
            pieces.append(int.from_bytes(data[start : start + 4], "little"))
    return arrivals, pieces


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_bytes_arrive_whole_and_in_order(profile):
    _, pieces = carry(profile)
    assert pieces == list(range(len(pieces)))
    assert len(pieces) > 1500


@pytest.mark.parametrize("profile", sorted(PROFILES))
def test_the_same_seed_gives_the_same_delays(profile):
    assert carry(profile, 20, seed=4) == carry(profile, 20, seed=4)


def test_an_ideal_radio_adds_nothing_and_need_not_be_asked():
    arrivals, _ = carry("ideal", 5)
    assert all(at_ms % 34 == 0 for at_ms in nonempty(arrivals))
    assert Radio(PROFILES["ideal"], np.random.RandomState(0)).is_transparent(0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "profile, p95, p99, longest",
    [("hotspot", (42, 55), (48, 125), (148, 1300)), ("router", (36, 48), (40, 60), (60, 160))],
)
def test_gaps_between_odoms_are_like_the_recorded_ones(profile, p95, p99, longest):
    gaps = np.diff(carry(profile, 300)[0])
    assert np.percentile(gaps, 50) == pytest.approx(34, abs=4)
    assert p95[0] <= np.percentile(gaps, 95) <= p95[1]
    assert p99[0] <= np.percentile(gaps, 99) <= p99[1]
    assert longest[0] <= gaps.max() <= longest[1]


@pytest.mark.slow
def test_a_bad_network_stalls_for_longer_than_any_recorded_one():
    arrivals, _ = carry("bad", 120)
    assert np.diff(arrivals).max() > 1274


def test_a_narrow_network_delays_what_exceeds_its_bandwidth():
    radio = Radio(
        PROFILES["bad"]._replace(jitter_ms=0.0, outages_ms=()),
        np.random.RandomState(0),
    )
    for _ in range(100):
        radio.up.put(0, bytes(1000))
    arrived_ms = next(now_ms for now_ms in range(5000) if radio.up.take(now_ms) and not radio.is_carrying)
    assert arrived_ms == pytest.approx(1000 + 5, abs=2)


def test_a_stall_delays_everything_and_then_delivers_everything():
    radio = Radio(PROFILES["ideal"], np.random.RandomState(0))
    radio.stall(100, 500)
    assert not radio.is_transparent(100)
    radio.up.put(150, b"a")
    radio.up.put(300, b"b")
    radio.down.put(300, b"c")
    assert radio.up.take(599) == b"" and radio.down.take(599) == b""
    assert radio.up.take(600) == b"ab" and radio.down.take(600) == b"c"
    assert radio.is_transparent(601)


@settings(max_examples=50)
@given(
    profile=st.sampled_from(sorted(PROFILES)),
    gaps=st.lists(st.integers(0, 400), max_size=60),
    seed=st.integers(0, 9999),
)
def test_nothing_is_lost_whatever_the_pace(profile, gaps, seed):
    radio = Radio(PROFILES[profile], np.random.RandomState(seed))
    now_ms, received = 0, b""
    for number, gap_ms in enumerate(gaps):
        now_ms += gap_ms
        radio.down.put(now_ms, bytes((number,)))
        received += radio.down.take(now_ms)
    received += radio.down.take(now_ms + 60000)
    assert received == bytes(range(len(gaps)))


def make_profile(**changes):
    return PROFILES["ideal"]._replace(**changes)


def test_what_was_sent_later_never_arrives_earlier():
    radio = Radio(make_profile(jitter_ms=200.0), np.random.RandomState(1))
    arrivals_ms = [radio.up.send(now_ms, 10) for now_ms in range(100)]
    assert arrivals_ms == sorted(arrivals_ms)
    assert len(set(arrivals_ms)) < 100, "some wait behind others"
    radio.up.clear()
    assert radio.up.send(100, 10) < arrivals_ms[-1], "not behind an earlier connection's"


def test_a_connection_that_ends_drops_what_is_on_its_way_up_and_down():
    radio = Radio(make_profile(base_ms=50.0), np.random.RandomState(1))
    for direction in (radio.up, radio.down):
        direction.put(0, b"old")
        assert radio.is_carrying and direction.length == 3
        radio.clear()
        assert not radio.is_carrying
        direction.put(10, b"new")
        assert direction.take(59) == b"" and direction.take(60) == b"new"


@pytest.mark.slow
def test_outages_last_as_long_and_come_as_often_as_the_profile_says():
    profile = make_profile(outages_ms=[(500.0, 100.0, 100.0)])
    radio = Radio(profile, np.random.RandomState(1))
    delays_ms = np.array([radio.find_arrival(float(now_ms)) - now_ms for now_ms in range(200000)])
    assert delays_ms.max() == pytest.approx(100.0, abs=1.0)
    assert np.count_nonzero(delays_ms) / 200000 == pytest.approx(100.0 / 600.0, rel=0.15)
    late = Radio(profile, np.random.RandomState(1))
    assert [late.find_arrival(199990.0 + step) - 199990.0 - step for step in range(10)] == list(delays_ms[-10:])


def test_what_was_on_its_way_when_a_stall_began_arrives_when_it_ends():
    radio = Radio(make_profile(base_ms=50.0), np.random.RandomState(0))
    for direction in (radio.up, radio.down):
        direction.put(0, b"before")
    radio.stall(10, 200)
    for direction in (radio.up, radio.down):
        direction.put(20, b", meanwhile")
        assert [direction.take(now_ms) for now_ms in (50, 209, 210, 260)] == [b"", b"", b"before", b", meanwhile"]


def test_what_waits_for_a_stall_to_end_passes_at_the_networks_pace():
    radio = Radio(make_profile(bytes_per_s=1000.0), np.random.RandomState(0))
    radio.stall(0, 500)
    assert [radio.up.send(now_ms, 100) for now_ms in (100, 200)] == [600.0, 700.0]
    assert radio.down.send(2000, 100) == 2100.0
