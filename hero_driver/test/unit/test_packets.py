"""Packets: the same ones come out whatever pieces, noise and errors they came with."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from vectors import GOOD, TIME_REQUEST, VECTORS, build_packet

from hero_driver.rosserial.packets import Packet, PacketReader, RosserialError, encode_packet, sum_bytes

ALL = b"".join(vector.data for vector in VECTORS)
ALL_PACKETS = [Packet(vector.topic_id, vector.payload) for vector in VECTORS]

NOISES = {
    "zeros": bytes(50),
    "text": b"GET / HTTP/1.1\r\nHost: robot\r\n\r\n",
    "half a sync": b"\xff",
    "many half syncs": b"\xff" * 20,
    "sync without packet": b"\xff\xfe",
    "syncs one after another": b"\xff\xfe" * 9,
    "protocol 1": bytes.fromhex("ff ff 00 00 ff 00 00 ff"),
    "wrong length checksum": bytes.fromhex("ff fe 00 00 fe 00 00 ff"),
    "wrong checksum": bytes.fromhex("ff fe 01 00 fe 65 00 01 98"),
    "packet cut in its header": TIME_REQUEST[:5],
    "too long": bytes.fromhex("ff fe 01 10 ee 65 00"),
    "longest length": bytes.fromhex("ff fe ff ff 01 65 00"),
}

by_vector = pytest.mark.parametrize("vector", VECTORS, ids=lambda vector: vector.name)

payloads = st.binary(max_size=600)
topic_ids = st.integers(0, 0xFFFF)
# Bytes of which real starts of packets are made come often.
noise = st.lists(
    st.one_of(st.binary(max_size=20), st.sampled_from([b"\xff", b"\xff\xfe", TIME_REQUEST, TIME_REQUEST[:9]]))
).map(b"".join)


def read_in_pieces(data, cuts):
    reader = PacketReader()
    packets = []
    positions = [0, *sorted(cuts), len(data)]
    for start, end in zip(positions, positions[1:]):
        packets += reader.receive_bytes(data[start:end])
    return packets, reader


def count(reader):
    return reader.packets, reader.bad_packets, reader.skipped_bytes, len(reader.remainder)


@by_vector
def test_a_packet_is_encoded_as_written_by_hand(vector):
    assert encode_packet(vector.topic_id, vector.payload) == vector.data


@by_vector
def test_a_packet_is_read_whole(vector):
    reader = PacketReader()
    assert reader.receive_bytes(vector.data) == [(vector.topic_id, vector.payload)]
    assert (reader.packets, reader.bad_packets, reader.skipped_bytes, len(reader.remainder)) == (1, 0, 0, 0)


@by_vector
def test_a_packet_is_read_byte_by_byte_and_comes_with_its_last_byte(vector):
    reader = PacketReader()
    for position in range(len(vector.data) - 1):
        assert reader.receive_bytes(vector.data[position : position + 1]) == []
        assert len(reader.remainder) == position + 1
    assert reader.receive_bytes(vector.data[-1:]) == [(vector.topic_id, vector.payload)]
    assert (reader.bad_packets, reader.skipped_bytes, len(reader.remainder)) == (0, 0, 0)


@by_vector
def test_a_packet_is_read_from_any_two_pieces(vector):
    for cut in range(len(vector.data) + 1):
        assert read_in_pieces(vector.data, [cut])[0] == [(vector.topic_id, vector.payload)]


def test_packets_back_to_back_are_all_read():
    assert PacketReader().receive_bytes(ALL) == ALL_PACKETS
    assert read_in_pieces(ALL, range(len(ALL)))[0] == ALL_PACKETS


@pytest.mark.parametrize("name", NOISES)
@by_vector
def test_a_packet_is_read_after_noise(vector, name):
    reader = PacketReader()
    packets = reader.receive_bytes(NOISES[name] + vector.data + GOOD.data)
    # A header without its packet waits for the bytes that it promises, so it may swallow what follows it.
    assert packets[-1] == (GOOD.topic_id, GOOD.payload)
    assert packets[:-1] == [(vector.topic_id, vector.payload)]
    assert reader.skipped_bytes == len(NOISES[name])


@pytest.mark.parametrize("missing", range(1, 9))
def test_packets_are_read_again_after_one_that_was_cut_short(missing):
    cut = TIME_REQUEST[:-missing]
    reader = PacketReader()
    packets = reader.receive_bytes(cut + GOOD.data * 3)
    assert packets[-2:] == [(GOOD.topic_id, GOOD.payload)] * 2
    assert reader.skipped_bytes >= len(cut)


@by_vector
def test_a_packet_with_a_flipped_bit_is_counted_and_the_next_is_read(vector):
    for bit in range(8 * len(vector.data)):
        broken = bytearray(vector.data)
        broken[bit // 8] ^= 1 << bit % 8
        reader = PacketReader()
        packets = reader.receive_bytes(bytes(broken) + GOOD.data)
        assert packets == [(GOOD.topic_id, GOOD.payload)], "bit %d" % bit
        assert reader.skipped_bytes == len(vector.data)
        assert reader.bad_packets >= 1 or bit < 16


@by_vector
def test_a_packet_with_any_bit_flipped_is_refused_byte_by_byte_too(vector):
    for bit in range(8 * min(len(vector.data), 80)):
        broken = bytearray(vector.data)
        broken[bit // 8] ^= 1 << bit % 8
        data = bytes(broken) + GOOD.data
        assert read_in_pieces(data, range(len(data)))[0] == [(GOOD.topic_id, GOOD.payload)], "bit %d" % bit


def test_a_good_packet_inside_a_broken_one_is_not_lost():
    broken = build_packet(130, GOOD.data)[:-1] + b"\x00"
    reader = PacketReader()
    assert reader.receive_bytes(broken) == [(GOOD.topic_id, GOOD.payload)]
    assert reader.bad_packets == 1
    assert reader.skipped_bytes == 8


def test_a_payload_over_the_limit_is_bad_as_soon_as_its_header_is_read():
    reader = PacketReader(max_payload_length=100)
    assert reader.receive_bytes(build_packet(125, bytes(100))) == [(125, bytes(100))]
    assert reader.receive_bytes(build_packet(125, bytes(101))[:7]) == []
    assert reader.bad_packets == 1
    assert len(reader.remainder) == 0
    assert reader.receive_bytes(GOOD.data) == [(GOOD.topic_id, GOOD.payload)]


def test_the_robots_own_buffer_length_is_read_by_default():
    assert PacketReader().receive_bytes(build_packet(125, b"\xff" * 4096)) == [(125, b"\xff" * 4096)]


@given(data=st.binary(max_size=3000))
def test_arbitrary_bytes_never_raise_and_every_byte_is_accounted_for(data):
    reader = PacketReader(200)
    packets = reader.receive_bytes(data)
    assert reader.packets == len(packets)
    used = sum(len(packet.payload) + 8 for packet in packets)
    assert used + reader.skipped_bytes + len(reader.remainder) == len(data)


@given(before=noise, sent=st.lists(st.tuples(topic_ids, payloads), max_size=5), between=noise, data=st.data())
def test_any_cut_of_a_stream_gives_the_same_packets_and_counters(before, sent, between, data):
    stream = before + between.join(build_packet(*packet) for packet in sent) + between
    whole, whole_reader = read_in_pieces(stream, [])
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=20))
    pieces, reader = read_in_pieces(stream, cuts)
    assert pieces == whole
    assert count(reader) == count(whole_reader)


@given(chunks=st.lists(st.one_of(noise, st.binary(max_size=2000)), max_size=20), limit=st.integers(0, 300))
def test_at_most_one_packet_waits_in_memory(chunks, limit):
    reader = PacketReader(limit)
    for chunk in chunks:
        reader.receive_bytes(chunk)
        assert len(reader.remainder) < limit + 8


@given(before=st.binary(max_size=300))
def test_packets_are_read_again_after_any_noise(before):
    reader = PacketReader(400)
    packets = reader.receive_bytes(before + GOOD.data * 100)
    assert packets[-40:] == [(GOOD.topic_id, GOOD.payload)] * 40


@given(topic_id=topic_ids, payload=payloads)
def test_what_is_encoded_is_read_back(topic_id, payload):
    data = encode_packet(topic_id, payload)
    assert data == build_packet(topic_id, payload)
    assert PacketReader(65535).receive_bytes(data) == [Packet(topic_id, payload)]
    assert encode_packet(topic_id, bytearray(payload)) == encode_packet(topic_id, memoryview(payload)) == data


@pytest.mark.parametrize("length", [0, 1, 255, 256, 257, 511, 512, 513, 4096, 65535])
def test_the_sum_of_bytes_is_exact_at_every_length(length):
    for data in (b"\xff" * length, bytes(range(256)) * 256):
        assert sum_bytes(data[:length]) == sum(data[:length]) % 256


@given(data=st.binary(max_size=5000))
def test_the_sum_of_any_bytes_is_that_of_python(data):
    expected = sum(data) % 256
    assert sum_bytes(data) == sum_bytes(bytearray(data)) == sum_bytes(memoryview(data)) == expected


@pytest.mark.parametrize("topic_id", [-1, 65536])
def test_an_id_that_does_not_fit_is_an_error_of_ours(topic_id):
    with pytest.raises(RosserialError, match="0..65535"):
        encode_packet(topic_id, b"")


def test_a_payload_that_does_not_fit_is_an_error_of_ours():
    assert len(encode_packet(1, bytes(65535))) == 65543
    with pytest.raises(RosserialError, match="65536"):
        encode_packet(1, bytes(65536))


def test_a_whole_conversation_of_a_real_robot_is_read_without_a_bad_packet(read_capture):
    reader = PacketReader()
    packets = reader.receive_bytes(read_capture("A.robot_to_server.bin"))
    assert len(packets) == 3171
    assert (reader.bad_packets, reader.skipped_bytes, len(reader.remainder)) == (0, 0, 0)
    assert [packet.topic_id for packet in packets].count(129) == 2180
    assert b"".join(build_packet(*packet) for packet in packets) == read_capture("A.robot_to_server.bin")


def test_a_capture_in_pieces_of_odd_sizes_gives_the_same_packets(read_capture):
    data = read_capture("A.robot_to_server.bin")[:60000]
    whole = PacketReader().receive_bytes(data)
    for size in (1, 7, 536, 1460):
        assert read_in_pieces(data, range(0, len(data), size))[0] == whole


def test_what_a_server_sent_to_a_real_robot_is_read_and_encoded_again(read_capture):
    data = read_capture("A.server_to_robot.bin")
    packets = PacketReader().receive_bytes(data)
    assert len(packets) == 42
    assert b"".join(encode_packet(*packet) for packet in packets) == data


@pytest.mark.parametrize("name", ["C_zero_topics.robot_to_server.bin", "E_imu_hat.robot_to_server.bin"])
def test_a_capture_that_ends_in_the_middle_of_a_packet_waits_for_its_end(read_capture, name):
    reader = PacketReader()
    reader.receive_bytes(read_capture(name))
    assert reader.bad_packets == 0
    assert reader.skipped_bytes == 0
    assert 0 < len(reader.remainder) < 735
