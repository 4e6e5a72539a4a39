"""The Wi-Fi channel that robots share: airtime, collisions, and robots that wait for it."""

import numpy as np
import pytest
from driver_side import RECEIVED, SENT, VELOCITY, DriverSide

from hero_driver.rosserial import packets
from hero_sim.errors import OptionError
from hero_sim.link.channel import Channel, _find_collisions
from hero_sim.link.wifi import MAX_CHANNELS, build_network, parse_wifi
from hero_sim.stepped.rules import radio_rows, readings
from hero_sim.stepped.swarm import StepSwarm
from hero_test.nonempty import nonempty

BURST_LENGTH, BURSTS_PER_S = 1469, 29.27
"""Length, and rate in Hz, of a stock robot's messages of odometry, transforms and encoder."""


def measure_rates_hz(count, wifi, seconds=10):
    """Return how often the odometry of each robot arrived (count,)."""
    swarm = StepSwarm(count, wifi=wifi)
    arrivals = np.zeros(count)
    swarm.rows.on_cycle.append(lambda rows: np.add.at(arrivals, rows, 1))
    swarm.rows.advance(seconds * 1000)
    return arrivals / seconds


def test_a_stock_robot_alone_takes_four_percent_of_a_channel():
    channel = Channel(np.random.RandomState(0))
    sent_ms, late_ms = channel.carry(0.0, "robot", BURST_LENGTH)
    assert sent_ms * BURSTS_PER_S / 1000.0 == pytest.approx(0.04, abs=0.004)
    assert late_ms == 0.0


def test_frames_of_two_stations_follow_each_other():
    channel = Channel(np.random.RandomState(0))
    first_ms, _ = channel.carry(0.0, "robot", 500)
    second_ms, _ = channel.carry(0.0, "other", 500)
    assert second_ms >= 2 * first_ms
    later_ms, _ = channel.carry(100.0, "robot", 500)
    assert later_ms == pytest.approx(100.0 + first_ms)


def test_frames_collide_more_often_the_more_stations_wait():
    def measure_mean_ms(stations):
        channel = Channel(np.random.RandomState(0))
        return np.mean([channel.carry(0.0, turn % stations, 500)[0] / (turn + 1) for turn in range(500)][250:])

    one, five, forty = map(measure_mean_ms, (1, 5, 40))
    assert one < five < forty
    # Half of the frames of 40 stations collide, and two share the time of each collision.
    assert 1.2 * one < forty < 1.6 * one


@pytest.mark.parametrize("stations", [2, 10, 50])
def test_collisions_are_those_of_bianchis_model_of_saturated_stations(stations):
    collides, window, doubled = _find_collisions(stations), 16, 6
    sends = 2.0 * (1.0 - 2.0 * collides)
    sends /= (1.0 - 2.0 * collides) * (window + 1) + collides * window * (1.0 - (2.0 * collides) ** doubled)
    assert collides == pytest.approx(1.0 - (1.0 - sends) ** (stations - 1))


def test_a_segment_that_collides_eight_times_arrives_a_tick_of_tcp_later():
    channel = Channel(np.random.RandomState(0))
    late = [channel.carry(0.0, turn % 40, 500)[1] for turn in range(5000)]
    assert set(late) == {0.0, 500.0}
    assert 0.002 < np.mean(np.array(late) > 0.0) < 0.05


@pytest.mark.slow
def test_forty_robots_on_a_channel_are_heard_at_half_their_rate():
    assert measure_rates_hz(10, "router") == pytest.approx(29.0, abs=0.5)
    rates_hz = measure_rates_hz(40, "router")
    assert rates_hz.mean() == pytest.approx(14.5, abs=1.5)
    assert rates_hz.min() > 10.0


@pytest.mark.slow
def test_channels_share_the_robots_between_them():
    assert measure_rates_hz(20, "router,channels=2") == pytest.approx(29.0, abs=0.5)
    network = build_network(*parse_wifi("router,channels=2"), range(5))
    assert network[0].channel is network[2].channel is network[4].channel
    assert network[1].channel is network[3].channel is not network[0].channel


@pytest.mark.slow
def test_without_channels_robots_do_not_delay_each_other():
    assert measure_rates_hz(40, "router,channels=0") == pytest.approx(29.0, abs=0.5)
    assert all(radio.channel is None for radio in nonempty(build_network(*parse_wifi("router,channels=0"), range(3))))


def test_worlds_share_no_channel():
    radios = StepSwarm(2, wifi="router", worlds=2).rows._radios._radios
    assert radios[0].channel is radios[1].channel is not radios[2].channel
    assert radios[2].channel is radios[3].channel


def test_a_robot_whose_connection_ends_does_not_wait_for_the_channel():
    (radio,) = build_network(*parse_wifi("router"), [0])
    for _ in range(10):
        radio.up.put(0, bytes(BURST_LENGTH))
    assert radio.is_congested(5)
    radio.clear()
    assert not radio.is_congested(5)


@pytest.mark.parametrize(
    "text, told",
    [
        ("wired", "must be one of ideal, router, hotspot, bad"),
        ("router,channel=2", "unknown key 'channel'; known are channels"),
        ("router,channels=1.5", "must be a whole number"),
        ("router,channels=-1", f"must be 0..{MAX_CHANNELS}"),
        ("router,channels=nan", f"must be 0..{MAX_CHANNELS}"),
        ("ideal,channels=2", "ideal has no channels"),
        ("router,3", "is not KEY=VALUE"),
    ],
)
def test_a_network_that_is_not_known_is_refused(text, told):
    with pytest.raises(OptionError, match=told) as refused:
        StepSwarm(2, wifi=text)
    assert str(refused.value).startswith(f"--wifi '{text}'")


def test_stepped_robots_send_and_are_sent_as_many_bytes_as_others():
    driver = DriverSide("--count", "1")
    driver.start_streaming()
    driver.send(0, RECEIVED["laser_enable"], b"\1")
    driver.run(500)

    def measure(names):
        arrivals = driver.list_packets(0, SENT[names[0]])
        cycle = [packet for packet in driver.arrivals[0] if packet.at_ms == arrivals[-1].at_ms]
        sent = [packet for packet in cycle if packet.topic_id in [SENT[name] for name in names]]
        return sum(len(packets.encode_packet(packet.topic_id, packet.payload)) for packet in sent)

    assert measure(["odom", "tf", "encoder"]) == radio_rows.LENGTHS[readings.WHEELS]
    assert measure(["laser"]) == radio_rows.LENGTHS[readings.SCAN]
    assert len(packets.encode_packet(VELOCITY, bytes(6 * 8))) == radio_rows.COMMAND_LENGTH
