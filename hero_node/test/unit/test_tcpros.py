"""Messages in a TCPROS stream, wherever it is cut."""

import pytest

from hero_node.ros_messages import LENGTH, TooLongError, encode_text, find_messages

MESSAGES = [b"first", b"", b"third one"]
STREAM = b"".join(LENGTH.pack(len(message)) + message for message in MESSAGES)


def split(data, length_max=100):
    return [bytes(data[start:end]) for start, end in find_messages(data, length_max)]


def test_all_complete_messages_are_found_wherever_the_stream_is_cut():
    for cut in range(len(STREAM) + 1):
        ends = [end for _, end in find_messages(STREAM[:cut], 100)]
        rest = STREAM[ends[-1] if ends else 0 :]
        assert split(STREAM[:cut]) + split(bytearray(rest)) == MESSAGES, cut


def test_a_message_of_the_greatest_length_is_found():
    assert split(STREAM, len(MESSAGES[2])) == MESSAGES


def test_what_comes_before_a_length_that_no_message_has_is_found():
    found = find_messages(STREAM + LENGTH.pack(101), 100)
    assert [next(found)[1] for _ in MESSAGES][-1] == len(STREAM)
    with pytest.raises(TooLongError, match="a message of 101 bytes; at most 100 are accepted"):
        next(found)


def test_a_text_is_its_length_in_bytes_and_then_utf_8():
    assert encode_text("\u00b5m") == b"\3\0\0\0\xc2\xb5m"
