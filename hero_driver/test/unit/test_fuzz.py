"""Any bytes, texts and parameters: nothing raises, nothing grows without bound, one robot never changes another."""

import sys
import unicodedata

from conversation import T0, TIME_OF_DAY_S, open_session
from hypothesis import given, settings
from hypothesis import strategies as st
from vectors import ENCODER_MESSAGE, GOOD, HANDSHAKE, ODOM_MESSAGE, TIME_REQUEST, VECTORS, build_packet

from hero_driver.config import DriverConfig, read_config
from hero_driver.fleet.log_lines import MAX_TEXT_LENGTH, read_log_line
from hero_driver.fleet.namespaces import identify
from hero_driver.rosserial.packets import DEFAULT_MAX_PAYLOAD_LENGTH, OVERHEAD_LENGTH, PacketReader
from hero_driver.rosserial.session import MessagesReceived, SessionEnded
from hero_node import ProgramError

MAX_TOPICS = 8

STREAM = HANDSHAKE + (ODOM_MESSAGE + ENCODER_MESSAGE) * 3 + TIME_REQUEST
"""What a stock robot says."""

changes = st.lists(
    st.tuples(
        st.sampled_from(("flip", "cut", "repeat", "insert")),
        st.integers(0, len(STREAM)),
        st.integers(1, 200),
        st.integers(1, 255),
    ),
    max_size=12,
)
pieces = st.lists(
    st.one_of(st.binary(max_size=200), st.sampled_from([v.data for v in VECTORS] + [HANDSHAKE, ODOM_MESSAGE])),
    max_size=12,
)


few = settings(max_examples=40)
"""Each example is a whole conversation; script/soak tries millions."""


def change(stream, script):
    """Return stream with bits flipped, parts cut out, said twice or put in."""
    data = bytearray(stream)
    for kind, place, length, value in script:
        if kind == "flip" and place < len(data):
            data[place] ^= value
        elif kind == "cut":
            del data[place : place + length]
        elif kind == "repeat":
            data[place:place] = data[place : place + length]
        elif kind == "insert":
            data[place:place] = bytes((value * step) % 256 for step in range(length))
    return bytes(data)


def talk(session, data, step=97):
    """Give data to session in pieces; return all events."""
    events = []
    for start in range(0, len(data), step):
        now_s = T0 + 1e-4 * start  # a quarter of a robot's speed
        events += session.receive_bytes(data[start : start + step], now_s, TIME_OF_DAY_S)
        events += session.poll(now_s)
    return events


@few
@given(script=changes, step=st.integers(1, 3000))
def test_a_garbled_robot_never_raises_and_never_grows_beyond_its_bounds(script, step):
    session = open_session(max_topics=MAX_TOPICS)
    events = talk(session, change(STREAM, script), step)
    assert len(session.topics) <= MAX_TOPICS
    assert len(session.reader.remainder) < DEFAULT_MAX_PAYLOAD_LENGTH + OVERHEAD_LENGTH
    assert not any(type(event) is SessionEnded for event in events)
    # One answer for each packet that asks for one, and nothing else.
    assert len(session.take_packets()) <= session.reader.packets + 2


@few
@given(script=changes)
def test_after_any_garbage_a_good_packet_is_read_within_one_packet_length(script):
    reader = PacketReader()
    reader.receive_bytes(change(STREAM, script))
    longest = DEFAULT_MAX_PAYLOAD_LENGTH + OVERHEAD_LENGTH
    packets = reader.receive_bytes(GOOD.data * (longest // len(GOOD.data) + 2))
    assert (GOOD.topic_id, GOOD.payload) in [(packet.topic_id, packet.payload) for packet in packets]


@few
@given(bad=pieces)
def test_what_one_robot_sends_never_changes_what_another_one_says(bad):
    alone = talk(open_session(), STREAM)
    good, other = open_session(), open_session()
    together = []
    for index, start in enumerate(range(0, len(STREAM), 97)):
        now_s = T0 + 0.01 * index
        other.receive_bytes(b"".join(bad), now_s, TIME_OF_DAY_S)
        together += good.receive_bytes(STREAM[start : start + 97], now_s, TIME_OF_DAY_S)
        together += good.poll(now_s)
    assert together == alone
    messages = [message for event in together if isinstance(event, MessagesReceived) for message in event.messages]
    assert len(messages) == 6


@given(order=st.permutations(range(12)), ids=st.lists(st.integers(0, 65535), min_size=12, max_size=12))
def test_good_packets_in_any_order_are_all_read(order, ids):
    session = open_session()
    packets = [build_packet(ids[index], bytes([index]) * index) for index in order]
    talk(session, b"".join(packets))
    assert session.reader.packets == len(packets)


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=20)),
    lambda inner: st.one_of(st.lists(inner, max_size=7), st.dictionaries(st.text(max_size=8), inner, max_size=3)),
    max_leaves=8,
)
names = st.sampled_from(sorted(DriverConfig.__dataclass_fields__))


@given(parameters=st.dictionaries(st.one_of(names, names, st.text(max_size=12)), values, max_size=4))
def test_any_parameters_are_taken_or_refused_in_one_line(parameters):
    try:
        config = read_config(parameters)
    except ProgramError as error:
        assert "~" in str(error) and "\n" not in str(error)
    else:
        assert 0 <= config.port <= 65535 and config.max_topics >= 1


@given(text=st.text(max_size=1000))
def test_any_log_text_becomes_one_line_that_moves_no_cursor(text):
    line = read_log_line(text).text
    assert len(line) <= MAX_TEXT_LENGTH
    assert len(line.splitlines()) <= 1
    assert not any(unicodedata.category(character) == "Cc" for character in line), ascii(line)


@given(name=st.text(max_size=60))
def test_any_name_is_a_robot_in_its_own_place_or_none(name):
    identity = identify(name)
    if identity is not None:
        assert identity.namespace == "/hero_%d" % identity.number
        assert 0 <= identity.number < sys.maxsize
