import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_sim.link.wifi import PROFILES, Radio


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
    assert all(at_ms % 34 == 0 for at_ms in arrivals)
    assert Radio(PROFILES["ideal"], np.random.RandomState(0)).is_transparent(0)


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


def test_a_bad_network_stalls_for_longer_than_any_recorded_one():
    arrivals, _ = carry("bad", 120)
    assert np.diff(arrivals).max() > 1274


def test_a_narrow_network_delays_what_exceeds_its_bandwidth():
    radio = Radio(
        PROFILES["bad"]._replace(jitter_ms=0.0, spike_every_ms=0.0, stall_every_ms=0.0),
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
