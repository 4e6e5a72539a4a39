"""Messages at fixed offsets: headers, odometry, transforms and scans as bytes in, bytes out."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from robot_messages import (
    MS,
    NOW_NS,
    build_encoder,
    build_header,
    build_laser,
    build_odometry,
    build_text,
    build_transform,
    build_transform_message,
    read_odometry,
    read_scan,
    read_seq,
    read_stamp_ns,
    read_transform,
)
from sensor_msgs.msg import Range

from hero_driver.corrections import message_layouts
from hero_node.ros_messages import LENGTH, encode_list, encode_pose, encode_text
from hero_test.nonempty import nonempty

POSE_DIAGONAL = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
TWIST_DIAGONAL = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0)


def make_diagonal(values):
    return tuple(values[row] if row == column else 0.0 for row in range(6) for column in range(6))


def make_writer():
    return message_layouts.OdometryWriter(POSE_DIAGONAL, TWIST_DIAGONAL)


# Another model.


def test_an_encoder_of_hero_plus_becomes_the_stock_one():
    payload = build_encoder(NOW_NS, 10.0, 7.0)
    plus = payload[:-40] + struct.pack("<d", 3.0) + payload[-40:]
    assert message_layouts.drop_tick_difference(plus) == payload
    assert message_layouts.read_encoder(message_layouts.drop_tick_difference(plus[:-1])) is None
    assert message_layouts.read_encoder(message_layouts.drop_tick_difference(b"")) is None


@pytest.mark.parametrize(
    "distance_m, shown_m", [(0.25, 0.25), (3.5, math.inf), (0.01, -math.inf), (math.nan, math.nan)]
)
def test_a_distance_becomes_a_range_by_rep_117(distance_m, shown_m):
    message = Range()
    message.deserialize(message_layouts.make_range(struct.pack("<f", distance_m), 3, NOW_NS + 5, "hero_0/hat_link"))
    assert (message.header.seq, message.header.stamp.to_nsec()) == (3, NOW_NS + 5)
    assert (message.header.frame_id, message.radiation_type) == ("hero_0/hat_link", Range.INFRARED)
    assert message.range == pytest.approx(shown_m, nan_ok=True)
    assert message.min_range < 0.1 < 2.0 < message.max_range and 0.1 < message.field_of_view < 0.5
    assert message_layouts.make_range(b"12345", 0, 0, "") is None


# Headers.


def test_a_new_stamp_changes_sequence_number_and_stamp_and_nothing_else():
    payload = build_encoder(NOW_NS, 1.0, 2.0)
    stamped = message_layouts.restamp(payload, 7, NOW_NS + 3)
    assert (read_seq(stamped), read_stamp_ns(stamped)) == (7, NOW_NS + 3)
    assert stamped[12:] == payload[12:]
    assert message_layouts.restamp(payload, 2**32 + 1, NOW_NS)[:4] == b"\x01\x00\x00\x00"
    assert message_layouts.read_stamp_ns(stamped) == NOW_NS + 3


def test_a_stamp_is_read_alone_where_a_header_can_be():
    payload = build_header(NOW_NS + 5, "")
    assert message_layouts.read_stamp_ns(payload) == NOW_NS + 5
    assert message_layouts.read_stamp_ns(payload[:-1]) is None
    assert message_layouts.read_stamp_ns(b"") is None


# Encoder.


def test_the_ticks_are_the_first_two_numbers():
    assert message_layouts.read_encoder(build_encoder(NOW_NS, 12.0, -34.0)) == (NOW_NS, 12.0, -34.0)


@pytest.mark.parametrize("change", [-88, -8, -1, 1, 8])
def test_an_encoder_message_of_another_length_has_no_ticks(change):
    payload = build_encoder(NOW_NS, 12.0, -34.0)
    payload = payload + bytes(change) if change > 0 else payload[:change]
    assert message_layouts.read_encoder(payload) is None
    assert message_layouts.read_encoder(payload[:80]) is None


# Odometry.


def test_odometry_gets_covariances_and_keeps_the_robots_estimate():
    payload = build_odometry(NOW_NS, 1.0, 2.0, 0.5, 0.1, -0.3)
    written = make_writer().rewrite(payload, 4, NOW_NS + MS, None)
    assert len(written) == len(payload)
    assert (read_seq(written), read_stamp_ns(written)) == (4, NOW_NS + MS)
    frame_id, child_frame_id, *numbers = read_odometry(written)
    assert (frame_id, child_frame_id) == ("hero_0/odom", "hero_0/base_link")
    assert numbers[:5] == pytest.approx([1.0, 2.0, 0.5, 0.1, -0.3])
    assert numbers[5:] == [make_diagonal(POSE_DIAGONAL), make_diagonal(TWIST_DIAGONAL)]


def test_odometry_takes_another_estimate():
    estimate = (encode_pose(7.0, 8.0, -2.0), 0.2, 3.0)
    written = make_writer().rewrite(build_odometry(NOW_NS, 1.0, 2.0, 0.5, 0.1, -0.3), 4, NOW_NS, estimate)
    assert read_odometry(written)[2:7] == pytest.approx((7.0, 8.0, -2.0, 0.2, 3.0))


def test_odometry_of_a_wrong_length_is_refused():
    writer, payload = make_writer(), build_odometry(NOW_NS)
    broken = [payload[:length] for length in range(len(payload))] + [payload + b"\x00"]
    for offset in (12, 12 + 4 + len("hero_0/odom")):
        for length in (0, 5, 4000000000):
            broken.append(payload[:offset] + struct.pack("<I", length) + payload[offset + 4 :])
    # Once as the first message of a robot, once after a good one.
    for _ in range(2):
        assert [len(data) for data in broken if writer.rewrite(data, 0, NOW_NS, None) is not None] == []
        assert writer.rewrite(payload, 0, NOW_NS, None) is not None


@given(payload=st.binary(max_size=800))
def test_any_bytes_are_odometry_or_none(payload):
    written = make_writer().rewrite(payload, 0, NOW_NS, None)
    assert written is None or len(written) == len(payload)


# Transforms.


def test_transforms_are_read_one_by_one():
    tails = [struct.pack("<7d", *(float(number + index) for index in range(7))) for number in range(3)]
    transforms = [
        build_transform(NOW_NS + number, "hero_0/base_link", "hero_0/link_%d" % number, struct.unpack("<7d", tail))
        for number, tail in enumerate(tails)
    ]
    read = message_layouts.read_transforms(build_transform_message(*transforms))
    assert [stamp_ns for stamp_ns, _, _ in read] == [NOW_NS, NOW_NS + 1, NOW_NS + 2]
    assert [message_layouts.split_frames(frames) for _, frames, _ in read] == [
        (b"hero_0/base_link", b"hero_0/link_%d" % number) for number in range(3)
    ]
    assert [tail for _, _, tail in read] == tails


def test_a_transform_that_was_read_is_packed_as_the_same_bytes():
    transform = build_transform(NOW_NS + 5, "hero_0/odom", "hero_0/base_link")
    message = build_transform_message(transform, transform)
    packed = [
        message_layouts.pack_transform_head(stamp_ns, frames) + tail
        for stamp_ns, frames, tail in message_layouts.read_transforms(message)
    ]
    assert packed == [transform, transform]
    assert encode_list(packed) == message
    assert encode_list([]) == bytes(4)


def test_a_tail_is_the_pose():
    frames = encode_text("hero_0/odom") + encode_text("hero_0/base_link")
    assert frames == build_text("hero_0/odom") + build_text("hero_0/base_link")
    tail = encode_pose(1.0, -2.0, 3.0)
    transform = message_layouts.pack_transform_head(NOW_NS, frames) + tail
    assert read_transform(transform) == (
        NOW_NS,
        "hero_0/odom",
        "hero_0/base_link",
        1.0,
        -2.0,
        pytest.approx(3.0),
    )


def test_no_transforms_are_an_empty_message():
    assert message_layouts.read_transforms(bytes(4)) == []


def test_a_message_of_transforms_that_is_cut_or_too_long_is_refused():
    message = build_transform_message(build_transform(NOW_NS, "a", "b"), build_transform(NOW_NS, "a", "c"))
    for length in nonempty(range(len(message))):
        assert message_layouts.read_transforms(message[:length]) is None
    assert message_layouts.read_transforms(message + b"\x00") is None
    assert message_layouts.read_transforms(b"\xff\xff\xff\xff" + message[4:]) is None


@given(payload=st.binary(max_size=400))
def test_any_bytes_are_transforms_or_none(payload):
    read = message_layouts.read_transforms(payload)
    if read is not None:
        assert message_layouts.read_transforms(payload[:-1]) is None


@given(frame_id=st.binary(max_size=30), child_frame_id=st.binary(max_size=30))
def test_frames_are_split_as_they_were_joined(frame_id, child_frame_id):
    frames = b"".join(LENGTH.pack(len(name)) + name for name in (frame_id, child_frame_id))
    assert message_layouts.split_frames(frames) == (frame_id, child_frame_id)


# Proximity.


def make_proximity(ranges_m, intensities=(10.0,) * 16):
    return message_layouts.make_proximity(build_laser(NOW_NS, ranges_m, intensities), 3, NOW_NS + MS, 0.2)


def float32(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def test_proximity_has_eight_beams_at_the_true_angles():
    scan = make_proximity([0.1] * 16)
    frame_id, numbers, ranges_m, intensities = read_scan(scan)
    assert frame_id == "hero_0/laser_link"
    assert (read_seq(scan), read_stamp_ns(scan)) == (3, NOW_NS + MS)
    angle_min_rad, angle_max_rad, increment_rad, time_increment_s, scan_time_s, range_min_m, range_max_m = numbers
    assert angle_min_rad == pytest.approx(-math.pi)
    assert increment_rad == pytest.approx(math.pi / 4.0)
    assert angle_max_rad == pytest.approx(angle_min_rad + 7.0 * increment_rad, abs=1e-6)
    assert angle_min_rad + 4.0 * increment_rad == pytest.approx(0.0, abs=1e-6)
    assert (time_increment_s, scan_time_s) == (0.0, float32(0.2))
    assert (range_min_m, range_max_m) == (float32(0.046835), float32(0.236835))
    assert len(ranges_m) == len(intensities) == 8


def test_only_measured_beams_are_taken_and_the_fifth_points_forward():
    stock = [0.10 + 0.005 * index for index in range(16)]
    readings = [float(index) for index in range(16)]
    _, _, ranges_m, intensities = read_scan(make_proximity(stock, readings))
    assert ranges_m == tuple(float32(stock[index]) for index in range(0, 16, 2))
    assert intensities == (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0)
    assert ranges_m[4] == float32(stock[8])


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 1e308])
def test_odometry_of_the_robot_itself_with_absurd_numbers_is_none(number):
    for changed in ({"x_m": number}, {"linear_m_s": number}):
        payload = build_odometry(NOW_NS, y_m=1e308, **changed)
        assert make_writer().rewrite(payload, 0, NOW_NS, None) is None
        estimate = (encode_pose(0.0, 0.0, 0.0), 0.0, 0.0)
        assert make_writer().rewrite(payload, 0, NOW_NS, estimate) is not None, "they are not used"


@pytest.mark.parametrize(
    "stock_m, reading, expected_m",
    [
        (0.0368 + 0.22, 10.0, math.inf),  # the firmware's clamp: nothing there
        (0.2368, 10.0, math.inf),
        (0.2360, 12.0, 0.2360),
        (0.1, 300.0, 0.1),
        (0.0480, 900.0, 0.0480),
        (0.0368 + 0.01, 950.0, -math.inf),  # the firmware's other clamp: too near to tell
        (0.0, 950.0, -math.inf),
        (-1.0, 950.0, -math.inf),
        (math.inf, 10.0, math.inf),
        (-math.inf, 950.0, -math.inf),
        (math.nan, 60.0, math.nan),  # erased calibration
        (math.nan, 0.0, math.nan),  # whatever the reading: it would look free at random
        (math.nan, -1.0, math.nan),
        (math.nan, math.nan, math.nan),
    ],
)
@pytest.mark.parametrize("beam", range(8))
def test_ranges_say_by_rep_117_what_is_known(stock_m, reading, expected_m, beam):
    stock, readings = [0.1] * 16, [50.0] * 16
    stock[2 * beam], readings[2 * beam] = stock_m, reading
    _, _, ranges_m, _ = read_scan(make_proximity(stock, readings))
    assert ranges_m[beam] == pytest.approx(expected_m, nan_ok=True)
    assert [ranges_m[other] for other in range(8) if other != beam] == [float32(0.1)] * 7


@given(stock=st.lists(st.floats(width=32), min_size=16, max_size=16))
def test_every_finite_range_lies_within_the_limits_that_the_message_states(stock):
    _, numbers, ranges_m, _ = read_scan(make_proximity(stock))
    assert all(not math.isfinite(range_m) or numbers[5] <= range_m <= numbers[6] for range_m in ranges_m)


@pytest.mark.parametrize("counts", [(8, 16), (16, 8), (0, 0), (15, 17), (17, 15), (16, 15)])
def test_a_scan_with_other_numbers_of_beams_is_not_the_stock_one(counts):
    payload = build_laser(NOW_NS, [0.1] * counts[0], [1.0] * counts[1])
    assert message_layouts.make_proximity(payload, 0, NOW_NS, 0.2) is None


def test_a_scan_that_is_cut_or_too_long_is_refused():
    payload = build_laser(NOW_NS, [0.1] * 16, [1.0] * 16)
    assert len(payload) == 205 - 8
    for length in nonempty(range(len(payload))):
        assert message_layouts.make_proximity(payload[:length], 0, NOW_NS, 0.2) is None
    assert message_layouts.make_proximity(payload + b"\x00", 0, NOW_NS, 0.2) is None
    frame_too_long = payload[:12] + b"\xff\xff\xff\xff" + payload[16:]
    assert message_layouts.make_proximity(frame_too_long, 0, NOW_NS, 0.2) is None


def test_numbers_of_messages_begin_anew_after_the_largest():
    payload = build_odometry(NOW_NS)
    for seq, expected in ((2**32 - 1, 2**32 - 1), (2**32, 0), (2**32 + 7, 7)):
        rewritten = make_writer().rewrite(payload, seq, NOW_NS, None)
        for written in (message_layouts.restamp(payload, seq, NOW_NS), rewritten):
            assert struct.unpack_from("<I", written) == (expected,)


def test_the_speed_of_odometry_is_of_all_three_axes_each():
    twist = slice(-48 - 288, -288)
    for index in range(6):
        components = [0.0] * 6
        components[index] = -0.5
        payload = bytearray(build_odometry(NOW_NS))
        payload[twist] = struct.pack("<6d", *components)
        expected = (0.5, 0.0) if index < 3 else (0.0, 0.5)
        assert message_layouts.read_odometry_velocity(bytes(payload)) == expected
    assert message_layouts.read_odometry_velocity(bytes(payload[-680:])) == (0.0, 0.5)
    assert message_layouts.read_odometry_velocity(bytes(payload[-679:])) is None


def test_a_writer_of_odometry_keeps_the_frames_until_others_come():
    writer = make_writer()
    frames = []
    for prefix in ("hero_0", "hero_1", "hero_1", "hero_0"):
        payload = build_odometry(NOW_NS).replace(b"hero_0", prefix.encode())
        frames.append(read_odometry(writer.rewrite(payload, 0, NOW_NS, None))[0])
    assert frames == ["hero_0/odom", "hero_1/odom", "hero_1/odom", "hero_0/odom"]
