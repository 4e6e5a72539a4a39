import struct

import pytest
from driver_side import POSITION, RECEIVED, SENT, DriverSide, read_laser
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_driver.rosserial import packets


def test_laser_enable_stops_and_starts_the_laser_and_a_restart_forgets_it():
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, RECEIVED["laser_enable"], b"\x00")
    driver.run(100)
    since_ms = driver.swarm.now_ms
    driver.run(1000)
    assert not driver.list_packets(0, SENT["laser"], since_ms)
    driver.send(0, RECEIVED["laser_enable"], b"\x01")
    driver.run(1000)
    assert len(driver.list_packets(0, SENT["laser"], since_ms)) >= 4


def test_the_laser_sees_the_wall_in_front():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.2, 0.0, 8000, POSITION)
    _, ranges, counts = read_laser(driver.list_packets(0, SENT["laser"])[-1].payload)
    assert ranges[8] == pytest.approx(0.0368 + 0.021, abs=0.01)
    assert counts[8] > 900
    assert ranges[0] > 0.23


def test_the_light_is_blue_at_the_start_then_as_commanded_for_15_s():
    driver = DriverSide()
    robot = driver.swarm.robots[0]

    def light():
        return robot.sensing.show_light(robot.to_millis(driver.swarm.now_ms))

    driver.run(2500)
    assert light() == (0.0, 0.0, 1.0, 1.0)
    driver.send(0, RECEIVED["led"], struct.pack("<4f", 1, 0.5, 0, 1))
    driver.run(14900)
    assert light() == (1.0, 0.5, 0.0, 1.0)
    driver.run(300)
    assert light() == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("topic_id", [12, 99, 125, 130, 60000])
def test_an_id_outside_its_table_kills_a_robot(topic_id):
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, topic_id, b"1234")
    driver.run(100)
    assert "id %d" % topic_id in driver.swarm.robots[0].crash_reason


def test_an_id_in_an_empty_slot_is_ignored():
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, 120, b"1234")
    driver.run(100)
    assert driver.swarm.robots[0].crash_reason is None


def test_a_packet_in_two_pieces_is_lost_unless_both_arrive_in_one_spin():
    driver = DriverSide()
    driver.start_streaming()
    packet = packets.encode_packet(RECEIVED["laser_enable"], b"\x00")
    driver.send_bytes(0, packet[:5])
    driver.run(60)
    driver.send_bytes(0, packet[5:])
    driver.run(200)
    assert driver.swarm.robots[0].sensing.laser_enabled
    driver.send_bytes(0, packet[:5])
    driver.send_bytes(0, packet[5:])
    driver.run(200)
    assert not driver.swarm.robots[0].sensing.laser_enabled


def test_garbage_from_the_server_does_no_harm():
    driver = DriverSide()
    driver.start_streaming()
    driver.send_bytes(0, bytes(range(256)) * 4)
    driver.run(200)
    driver.send_bytes(0, b"\xff\xfe\xff\xff\x01" + b"x" * 50)
    driver.run(200)
    driver.send(0, RECEIVED["laser_enable"], b"\x00")
    driver.run(100)
    assert not driver.swarm.robots[0].sensing.laser_enabled


@settings(max_examples=25)
@given(st.lists(st.tuples(st.integers(0, 124), st.binary(max_size=80)), max_size=8), st.binary(max_size=60))
def test_a_robot_survives_whatever_a_server_sends(sent, noise):
    driver = DriverSide()
    driver.start_streaming()
    driver.send_bytes(0, noise)
    for topic_id, payload in sent:
        driver.send(0, topic_id, payload)
    driver.run(400)
    driver.send_bytes(0, noise)
    driver.send(0, packets.ID_PUBLISHER)
    driver.run(400)
    if driver.swarm.robots[0].crash_reason is None:
        assert driver.list_packets(0, packets.ID_PUBLISHER)
    else:
        assert any(12 <= topic_id <= 99 or topic_id in (2, 3, 4, 5, 7, 8, 9, 1) for topic_id, _ in sent)


@pytest.mark.slow
def test_a_service_is_answered_in_its_time_and_later_if_it_is_slow():
    driver = DriverSide("--count", "12")
    driver.start_streaming()
    waits_ms = []
    for robot in driver.swarm.robots:
        robot.answer_delay_ms = 300 * (robot.robot_id % 2)
    sent_ms = driver.swarm.now_ms
    for index in range(12):
        driver.send(index, RECEIVED["set_odom"], struct.pack("<3d", 1.0, 2.0, 0.5))
    driver.run(500)
    for index in range(12):
        (answer,) = driver.list_packets(index, SENT["set_odom"], sent_ms)
        waits_ms.append(answer.at_ms - sent_ms - 300 * (index % 2))
    assert min(waits_ms) >= 42 and max(waits_ms) <= 76 and len(set(waits_ms)) > 5


def test_the_light_goes_out_at_its_millisecond_and_searching_is_red():
    driver = DriverSide()
    sensing = driver.swarm.robots[0].sensing
    sensing.set_light(1000, (0.1, 0.2, 0.3, 0.4))
    assert sensing.show_light(16000) == (0.1, 0.2, 0.3, 0.4) and sensing.show_light(16001) == (0.0, 0.0, 0.0, 0.0)
    sensing.begin(500)
    assert sensing.show_light(2500) == (0.0, 0.0, 1.0, 1.0) and sensing.show_light(2501) == (0.0, 0.0, 0.0, 0.0)
    sensing.show_searching()
    assert sensing.show_light(10**9) == (1.0, 0.0, 0.0, 1.0)
