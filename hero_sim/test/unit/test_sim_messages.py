import math
import struct

import driver_side
import numpy as np
import pytest

from hero_driver.rosserial import packets, payloads
from hero_node import Pose
from hero_sim.robot import messages
from hero_sim.robot.declarations import STOCK_TOPICS, encode_declarations
from hero_sim.robot.models import MODELS
from hero_test.nonempty import nonempty


def read_packets(data):
    reader = packets.PacketReader()
    result = reader.receive_bytes(data)
    assert reader.bad_packets == 0 and len(reader.remainder) == 0
    return result


def encode_cycle(name="hero_0", ticks=(0, 0)):
    encoder = [float(value) for value in range(11)]
    return messages.CycleMessages(name).encode((7, 8), Pose(1.0, 2.0, 0.5), (0.1, -0.2), ticks, encoder)


def test_a_cycle_is_odom_then_five_transforms_then_the_encoder():
    cycle = read_packets(encode_cycle())
    assert [packet.topic_id for packet in cycle] == [130, 129, 129, 129, 129, 129, 128]
    assert [len(packet.payload) + 8 for packet in cycle] == [735, 115, 126, 127, 119, 121, 126]


def test_names_grow_with_the_id():
    cycle = read_packets(encode_cycle("hero_12"))
    assert [len(packet.payload) + 8 for packet in cycle] == [737, 117, 128, 129, 121, 123, 127]


def test_odom_holds_pose_and_twist_in_single_precision_and_no_covariance():
    odom = read_packets(encode_cycle())[0].payload
    stamp, ids, pose, twist = driver_side.read_odom(odom)
    assert struct.unpack_from("<I", odom)[0] == messages.SEQ_NEVER_COUNTED
    assert stamp == (7, 8)
    assert ids == ("hero_0/odom", "hero_0/base_link")
    assert pose == pytest.approx((1.0, 2.0, math.sin(0.25), math.cos(0.25)))
    assert twist == (0.10000000149011612, -0.20000000298023224)
    values = struct.unpack_from("<85d", odom, len(odom) - 85 * 8)
    assert [index for index, value in enumerate(values) if value] == [0, 1, 5, 6, 43, 48]


def test_wheel_transforms_are_one_tick_ahead_and_turn_back_after_288():
    for ticks, angle_rad in ((0, 1), (287, 288), (288, 1), (-1, 0), (-288, 1)):
        left = read_packets(encode_cycle(ticks=(ticks, 0)))[2].payload
        quaternion = struct.unpack_from("<4d", left, len(left) - 32)
        half_rad = angle_rad * math.pi / 288
        assert quaternion == pytest.approx((0.0, math.sin(half_rad), 0.0, math.cos(half_rad)), abs=1e-7)


def test_a_laser_has_sixteen_ranges_of_which_the_odd_ones_are_averages():
    payload = messages.encode_laser("hero_0", 5, (1, 2), list(range(8)), [10.0] * 8)
    seq, ranges, counts = driver_side.read_laser(payload)
    assert (len(payload) + 8, seq) == (205, 5)
    assert ranges == (0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4, 4.5, 5, 5.5, 6, 6.5, 7, 3.5)
    assert counts == (10.0,) * 16


def test_declarations_have_the_stock_order_names_and_length():
    data = encode_declarations("hero_0", STOCK_TOPICS)
    assert len(data) == 2469
    declared = read_packets(data)
    infos = [payloads.decode_topic_info(packet.payload) for packet in declared]
    assert [info.topic_id for info in infos] == list(range(125, 137)) + list(range(100, 112))
    assert [packet.topic_id for packet in declared] == [0, 2, 0, 0, 0, 0] + [2] * 6 + driver_side.STOCK_SUBSCRIPTIONS
    names = {info.topic_id: info.name for info in infos}
    assert [names[topic_id] for topic_id in (128, 129, 130, 101, 109)] == [
        "/hero_0/encoder", "/tf", "/hero_0/odom", "hero_0/laser_enable", "/hero_0/velocity_controller/cmd_vel"
    ]  # fmt: skip
    assert all(info.name.startswith("/") for info in infos if info.topic_id != 101)
    assert {info.buffer_length for info in infos} == {4096}


@pytest.mark.parametrize(
    "text, length",
    [
        ("Odometry was changed!", 34),
        ("Motor Parameters has been succesfully recorded!", 60),
        ("PID Parameters has been succesfully recorded!", 58),
        ("PID Autotuning!", 28),
        ("IR calibration parameters have been successfully recorded!", 71),
    ],
)
def test_answers_are_as_long_as_the_robots(text, length):
    assert len(messages.encode_answer(True, text)) + 8 == length


@pytest.fixture(scope="module")
def capture(read_capture):
    return packets.PacketReader().receive_bytes(read_capture("A.robot_to_server.bin"))


def test_the_stock_cycles_are_rebuilt_byte_for_byte(capture):
    encoder = messages.CycleMessages("hero_0")
    checked = 0
    for start, packet in enumerate(capture):
        cycle = capture[start : start + 7]
        if packet.topic_id != 130 or len(cycle) < 7:
            continue
        stamp, _, pose, twist = driver_side.read_odom(packet.payload)
        yaw_rad = 2.0 * math.atan2(pose[2], pose[3])
        ticks = []
        for transform in cycle[2:4]:
            values = struct.unpack_from("<4d", transform.payload, len(transform.payload) - 32)
            ticks.append(round(2.0 * math.atan2(values[1], values[3]) * 288 / (2 * math.pi)) - 1)
        data = encoder.encode(
            stamp, Pose(pose[0], pose[1], yaw_rad), twist, ticks, driver_side.read_encoder(cycle[6].payload)
        )
        for ours, theirs in nonempty(zip(read_packets(data), cycle)):
            assert ours.topic_id == theirs.topic_id
            # Angles went through atan2 here, so a last bit of their sines may differ.
            different = sum(a != b for a, b in zip(ours.payload, theirs.payload))
            assert len(ours.payload) == len(theirs.payload) and different <= 6
        checked += 1
    assert checked > 400


def test_the_stock_handshake_and_laser_are_rebuilt_byte_for_byte(capture):
    declared = [packet for packet in capture if packet.topic_id < 4]
    burst = b"".join(packets.encode_packet(*packet) for packet in declared)
    assert burst == encode_declarations("hero_0", STOCK_TOPICS)
    lasers = [packet for packet in capture if packet.topic_id == 125]
    for packet in nonempty(lasers):
        seq, stamp_s, stamp_ns = struct.unpack_from("<III", packet.payload)
        _, ranges_m, counts = driver_side.read_laser(packet.payload)
        ours = messages.encode_laser("hero_0", seq, (stamp_s, stamp_ns), ranges_m[::2], counts[::2])
        assert ours == packet.payload


def read_transform(payload):
    """Return frame ids, and the seven values of a tfMessage with one transform."""
    assert struct.unpack_from("<I", payload) == (1,)
    parent, start = driver_side.read_text(payload, 16)
    child, start = driver_side.read_text(payload, start)
    assert start + 56 == len(payload)
    return parent, child, struct.unpack_from("<7d", payload, start)


def test_transforms_place_the_parts_where_the_stock_robot_has_them():
    cycle = read_packets(encode_cycle("hero_3"))
    found = [read_transform(packet.payload) for packet in cycle[1:6]]
    base = "hero_3/base_link"
    half_rad = math.pi / 288
    wheel = (0.0, math.sin(half_rad), 0.0, math.cos(half_rad))
    expected = [
        ("hero_3/odom", base, (1.0, 2.0, 0.0, 0.0, 0.0, math.sin(0.25), math.cos(0.25))),
        (base, "hero_3/left_wheel_link", (0.0, 0.0315, 0.01548, *wheel)),
        (base, "hero_3/right_wheel_link", (0.0, -0.0315, 0.01548, *wheel)),
        (base, "hero_3/hat_link", (-0.00245, -0.00216, 0.051, 0.0, 0.0, 0.0, 1.0)),
        (base, "hero_3/laser_link", (0.0, 0.0, 0.051, 0.0, 0.0, 0.0, 1.0)),
    ]
    for (parent, child, values), (expected_parent, expected_child, expected_values) in nonempty(zip(found, expected)):
        assert (parent, child) == (expected_parent, expected_child)
        assert values == pytest.approx(expected_values, abs=1e-7), child
    for packet in nonempty(cycle[1:6]):
        assert struct.unpack_from("<II", packet.payload, 8) == (7, 8), "each with the stamp of its cycle"


def test_each_wheel_shows_its_own_ticks():
    cycle = read_packets(encode_cycle(ticks=(71, 143)))
    for packet, ticks in nonempty(zip(cycle[2:4], (71, 143))):
        half_rad = (ticks + 1) * math.pi / 288
        expected = (0.0, math.sin(half_rad), 0.0, math.cos(half_rad))
        assert read_transform(packet.payload)[2][3:] == pytest.approx(expected, abs=1e-7)


def test_an_encoder_message_holds_its_values_behind_stamp_and_frame():
    encoder = read_packets(encode_cycle("hero_3"))[6].payload
    assert struct.unpack_from("<III", encoder) == (messages.SEQ_NEVER_COUNTED, 7, 8)
    assert driver_side.read_text(encoder, 12) == ("hero_3/encoder", len(encoder) - 88)
    assert driver_side.read_encoder(encoder) == tuple(range(11))


def test_hero_plus_sends_how_far_its_counters_are_apart_too():
    plus = MODELS["hero_plus"]
    values = [5.0, -2.0, *range(2, 11)]
    data = messages.CycleMessages("hero_3", plus).encode((7, 8), Pose(0.0, 0.0, 0.0), (0.0, 0.0), (0, 0), values)
    packet = read_packets(data)[6]
    assert packet.topic_id == plus.sent_ids["encoder"]
    assert struct.unpack_from("<12d", packet.payload, len(packet.payload) - 96) == (*values[:6], 7.0, *values[6:])


def test_a_laser_has_the_fields_of_the_stock_scan():
    payload = messages.encode_laser("hero_3", 2**32 + 5, (1, 2), [0.1] * 8, [9.0] * 8)
    assert struct.unpack_from("<III", payload) == (5, 1, 2)
    frame, start = driver_side.read_text(payload, 12)
    assert frame == "hero_3/laser_link"
    fields = struct.unpack_from("<7f", payload, start)
    assert fields == pytest.approx((-math.pi, math.pi, 0.395, 0.0, 0.0, 0.036835, 0.236835))
    assert struct.unpack_from("<I", payload, start + 28) == struct.unpack_from("<I", payload, start + 96) == (16,)


def test_an_imu_message_has_its_values_between_symmetric_covariances():
    payload = messages.encode_imu("hero_3", (7, 8), 2.0, 500.0)
    assert struct.unpack_from("<III", payload) == (messages.SEQ_NEVER_COUNTED, 7, 8)
    frame, start = driver_side.read_text(payload, 12)
    assert frame == "hero_3/hat_link" and len(payload) == start + 37 * 8
    values = struct.unpack_from("<37d", payload, start)
    turn = (0.0, 0.0, math.sin(1.0) * 16383 / 16384, math.cos(1.0) * 16383 / 16384)
    assert values[:4] == pytest.approx(turn, abs=1e-7) and not any(values[4:13])
    assert values[13:16] == (0.0, 0.0, 500.0) and values[25:28] == pytest.approx((0.0, 0.0, 8.192))
    assert np.array(values, dtype=np.float32).tolist() == list(values), "single precision"
    for first, largest in ((16, 1.7157649993896484), (28, 0.002516058273613453)):
        covariance = np.reshape(values[first : first + 9], (3, 3))
        assert (covariance == covariance.T).all() and covariance.max() == largest
        assert (np.linalg.eigvalsh(covariance) > 0.0).all()
