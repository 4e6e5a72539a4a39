import struct

import pytest
from driver_side import DriverSide, read_laser
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_driver.rosserial import packets
from hero_sim.robot import declarations as ids


def test_laser_enable_stops_and_starts_the_laser_and_a_restart_forgets_it():
    driver = DriverSide()
    driver.start_streaming()
    driver.send(0, ids.ID_LASER_ENABLE, b"\x00")
    driver.run(100)
    since_ms = driver.swarm.now_ms
    driver.run(1000)
    assert not driver.list_packets(0, ids.ID_LASER, since_ms)
    driver.send(0, ids.ID_LASER_ENABLE, b"\x01")
    driver.run(1000)
    assert len(driver.list_packets(0, ids.ID_LASER, since_ms)) >= 4


def test_the_laser_sees_the_wall_in_front():
    driver = DriverSide("--perfect")
    driver.start_streaming()
    driver.drive(0, 0.2, 0.0, 8000, ids.ID_POSITION_CMD_VEL)
    _, ranges, counts = read_laser(driver.list_packets(0, ids.ID_LASER)[-1].payload)
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
    driver.send(0, ids.ID_LED, struct.pack("<4f", 1, 0.5, 0, 1))
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
    packet = packets.encode_packet(ids.ID_LASER_ENABLE, b"\x00")
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
    driver.send(0, ids.ID_LASER_ENABLE, b"\x00")
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
