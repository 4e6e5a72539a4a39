"""Payloads of rosserial's own packets: read from bytes by hand, written back, refused when odd."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from vectors import STOCK_TOPICS, build_declaration

from hero_driver.rosserial.packets import RosserialError
from hero_driver.rosserial.payloads import (
    LOG_DEBUG,
    LOG_ERROR,
    LOG_FATAL,
    LOG_INFO,
    LOG_WARN,
    Log,
    PayloadError,
    TopicInfo,
    WireTime,
    decode_log,
    decode_time,
    decode_topic_info,
    encode_log,
    encode_time,
    encode_topic_info,
    split_seconds,
)
from hero_test.nonempty import nonempty

TF_INFO = TopicInfo(129, "/tf", "tf/tfMessage", "94810edda583a504dfda3829e70d7eec", 4096)
TF_BYTES = (
    bytes.fromhex("8100 03000000 2f7466 0c000000 74662f74664d657373616765 20000000")
    + b"94810edda583a504dfda3829e70d7eec"
    + bytes.fromhex("00100000")
)
LOG_BYTES = bytes.fromhex("02 05000000 1b5b39326d")

DECODERS = [decode_topic_info, decode_log, decode_time]

# What UTF-8 can carry: no surrogates.
texts = st.text(st.characters(blacklist_categories=("Cs",)), max_size=40)
uint32s = st.integers(0, 2**32 - 1)
int32s = st.integers(-(2**31), 2**31 - 1)


def test_a_declaration_is_read_from_bytes_and_written_as_the_same_bytes():
    assert decode_topic_info(TF_BYTES) == TF_INFO
    assert encode_topic_info(TF_INFO) == TF_BYTES


@pytest.mark.parametrize("topic", STOCK_TOPICS, ids=lambda topic: "%d %s" % topic[1:3])
def test_every_declaration_of_the_stock_robot_is_read(topic):
    packet = build_declaration(*topic)
    assert decode_topic_info(packet[7:-1]) == TopicInfo(*topic[1:], 4096)


def test_a_log_line_is_read_with_its_colors():
    assert decode_log(LOG_BYTES) == Log(2, "\x1b[92m")
    assert encode_log(Log(2, "\x1b[92m")) == LOG_BYTES


def test_a_time_is_eight_bytes_seconds_first():
    data = bytes.fromhex("ee17016b 00ca9a3b")
    assert decode_time(data) == WireTime(0x6B0117EE, 1000000000)
    assert encode_time(WireTime(0x6B0117EE, 1000000000)) == data
    assert decode_time(bytes(8)) == (0, 0)


@pytest.mark.parametrize("length", [0, 4, 7, 9, 16])
def test_a_time_of_another_length_is_refused(length):
    with pytest.raises(PayloadError, match="%d bytes instead of 8" % length):
        decode_time(bytes(length))


@pytest.mark.parametrize("time", [(-1, 0), (2**32, 0), (0, -1), (0, 2**32)])
def test_a_time_that_does_not_fit_its_bits_is_an_error_of_ours(time):
    with pytest.raises(PayloadError, match="32-bit"):
        encode_time(WireTime(*time))


def test_seconds_are_split_without_loss():
    assert split_seconds(0.0) == (0, 0)
    assert split_seconds(1795240942.5) == (1795240942, 500000000)
    assert split_seconds(1.9999999999) == (2, 0)


@given(time_s=st.floats(0, 2**32 - 2))
def test_split_seconds_stay_near_and_always_fit(time_s):
    secs, nsecs = split_seconds(time_s)
    assert 0 <= nsecs < 10**9
    assert math.isclose(secs + nsecs / 1e9, time_s, abs_tol=1e-6)
    assert len(encode_time(WireTime(secs, nsecs))) == 8


@pytest.mark.parametrize(
    "decode, data",
    [
        (decode_topic_info, TF_BYTES),
        (decode_log, LOG_BYTES),
        (decode_time, bytes(8)),
    ],
)
def test_a_payload_cut_anywhere_or_with_bytes_behind_it_is_refused(decode, data):
    decode(data)
    for length in nonempty(range(len(data))):
        with pytest.raises(PayloadError):
            decode(data[:length])
    with pytest.raises(PayloadError):
        decode(data + b"\x00")


def test_a_cut_payload_is_refused_in_words_that_say_what_is_wrong():
    with pytest.raises(PayloadError, match="TopicInfo: its texts need more than 60 bytes"):
        decode_topic_info(TF_BYTES[: 2 + 7 + 16 + 4 + 31])
    with pytest.raises(PayloadError, match="Log: 1 bytes follow its text"):
        decode_log(LOG_BYTES + b"\x00")


@pytest.mark.parametrize("decode", DECODERS)
def test_absurd_lengths_are_refused_at_once(decode):
    with pytest.raises(PayloadError):
        decode(b"\xff" * 64)


def test_text_that_is_not_utf8_stays_readable():
    assert decode_log(bytes.fromhex("01 03000000 61ff62")) == Log(1, "a\\xffb")


@pytest.mark.parametrize("decode", DECODERS)
@given(data=st.binary(max_size=200))
def test_arbitrary_bytes_are_read_or_refused_with_a_payload_error(decode, data):
    try:
        decode(data)
    except PayloadError as error:
        assert isinstance(error, RosserialError)
        assert str(error)


@given(topic_id=st.integers(0, 65535), name=texts, message_type=texts, md5sum=texts, buffer_length=int32s)
def test_any_declaration_is_read_back(topic_id, name, message_type, md5sum, buffer_length):
    info = TopicInfo(topic_id, name, message_type, md5sum, buffer_length)
    assert decode_topic_info(encode_topic_info(info)) == info


@given(level=st.integers(0, 255), text=texts)
def test_any_log_line_is_read_back(level, text):
    assert decode_log(encode_log(Log(level, text))) == (level, text)


@given(secs=uint32s, nsecs=uint32s)
def test_any_time_is_read_back(secs, nsecs):
    assert decode_time(encode_time(WireTime(secs, nsecs))) == (secs, nsecs)


def test_levels_of_log_lines_have_the_numbers_of_rosserial_msgs():
    assert (LOG_DEBUG, LOG_INFO, LOG_WARN, LOG_ERROR, LOG_FATAL) == (0, 1, 2, 3, 4)
