"""One conversation with a robot: when the session asks, what it answers, when it gives up."""

import pytest
from conversation import (
    T0,
    list_requests,
    open_declared_session,
    open_session,
    poll_until,
    receive,
)
from hypothesis import given
from hypothesis import strategies as st
from vectors import (
    ENCODER_MESSAGE,
    HANDSHAKE,
    ODOM_MESSAGE,
    REQUEST,
    STOCK_TOPICS,
    TIME_REQUEST,
    TX_STOP,
    VECTORS,
    build_log,
    build_packet,
    build_text,
)

from hero_driver.rosserial.payloads import Log
from hero_driver.rosserial.session import (
    MessagesReceived,
    Problem,
    Session,
    SessionEnded,
    SessionLimits,
    Topic,
    TopicKind,
)

TIME_ANSWER = build_packet(10, (1795240942).to_bytes(4, "little") + (500000000).to_bytes(4, "little"))
HEARTBEAT = build_log(1, "\x1b[96m[/hero_0] Conected at time 1638\x1b[0m")


# Asking for topics.


def test_a_new_session_asks_for_topics_at_once_and_only_once():
    session = Session(SessionLimits(), T0)
    assert session.take_packets() == []
    assert session.poll(T0) == []
    assert session.take_packets() == [REQUEST]
    assert session.take_packets() == []
    session.poll(T0 + 1.4)
    assert session.take_packets() == []


def test_the_request_is_repeated_every_1_5_s_until_a_declaration():
    session = open_session(silence_timeout_s=60.0)
    request_times_s, events = poll_until(session, T0 + 0.05, T0 + 6.5)
    assert request_times_s == pytest.approx([T0 + 1.5, T0 + 3.0, T0 + 4.5, T0 + 6.0])
    assert events == []


def test_nothing_is_asked_any_more_once_a_topic_is_declared():
    session = open_session()
    events = receive(session, HANDSHAKE, T0 + 0.06)
    assert [event.info.topic_id for event in events] == [topic[1] for topic in STOCK_TOPICS]
    assert all(type(event) is Topic for event in events)
    session.take_packets()
    assert poll_until(session, T0 + 0.1, T0 + 5.0) == ([], [])


def test_a_zero_topic_handshake_is_asked_again_after_200_ms():
    session = open_session()
    receive(session, TIME_REQUEST, T0 + 0.06)
    request_times_s, _ = poll_until(session, T0 + 0.06, T0 + 1.0, 0.01)
    assert request_times_s == pytest.approx([T0 + 0.26])


def test_only_the_time_request_of_a_boot_is_followed_after_200_ms():
    session = open_session(silence_timeout_s=60.0)
    request_times_s, _ = poll_until(session, T0 + 0.05, T0 + 1.55)
    receive(session, TIME_REQUEST, T0 + 1.6)
    again_s, _ = poll_until(session, T0 + 1.6, T0 + 2.4, 0.01)
    assert request_times_s + again_s == pytest.approx([T0 + 1.5, T0 + 2.0])


def test_a_peer_that_only_asks_for_the_time_cannot_put_a_request_off():
    session = open_session()
    request_times_s = []
    for step in range(1, 40):
        receive(session, TIME_REQUEST, T0 + step * 0.1)
        session.poll(T0 + step * 0.1)
        request_times_s += [step * 0.1] * len(list_requests(session))
    assert request_times_s == pytest.approx([0.3, 0.8, 1.3, 1.8, 2.3, 2.8, 3.3, 3.8])


def test_undeclared_data_is_answered_by_at_most_two_requests_a_second():
    session = open_session()
    request_times_s = []
    for step in range(1, 200):
        now_s = T0 + step * 0.01
        assert receive(session, ODOM_MESSAGE + ENCODER_MESSAGE, now_s) == []
        session.poll(now_s)
        request_times_s += [now_s] * len(list_requests(session))
    assert request_times_s == pytest.approx([T0 + 0.5, T0 + 1.0, T0 + 1.5])
    assert session.undeclared_messages == 2 * 199
    receive(session, HANDSHAKE, T0 + 2.0)
    assert isinstance(receive(session, ODOM_MESSAGE, T0 + 2.0)[0], MessagesReceived)


def test_a_robot_that_streams_on_a_new_connection_is_asked_at_once():
    session = Session(SessionLimits(), T0)
    receive(session, ODOM_MESSAGE, T0 + 0.02)
    session.poll(T0 + 0.02)
    assert session.take_packets() == [REQUEST]


def test_log_lines_before_any_topic_are_events_and_a_reason_to_ask_again():
    session = open_session()
    (event,) = receive(session, HEARTBEAT, T0 + 0.9)
    assert type(event) is Log
    assert event == (1, "\x1b[96m[/hero_0] Conected at time 1638\x1b[0m")
    session.poll(T0 + 0.9)
    assert session.take_packets() == [REQUEST]


def test_an_undeclared_id_is_reported_and_asked_for_a_few_times_only():
    session = open_declared_session(silence_timeout_s=600.0)
    request_times_s, problems = [], []
    for step in range(2000):
        now_s = T0 + 1.0 + step * 0.01
        problems += receive(session, build_packet(124, b""), now_s)
        session.poll(now_s)
        request_times_s += [now_s] * len(list_requests(session))
    assert len(request_times_s) == 5
    assert all(later - earlier >= 0.5 - 1e-6 for earlier, later in zip(request_times_s, request_times_s[1:]))
    assert len(problems) == len(request_times_s)
    assert all(type(problem) is Problem and "id 124" in problem.text for problem in problems)
    assert session.undeclared_messages == 2000


def test_a_declared_robot_that_only_logs_is_asked_for_topics_again():
    # After 11 s without an answer to its time requests (a PC that slept) a robot sends log lines and nothing
    # else, on the connection that it has; only a new request brings its data back.
    session = open_declared_session()
    request_times_s = []
    for step in range(1, 21):
        receive(session, HEARTBEAT, T0 + step)
        request_times_s += poll_until(session, T0 + step, T0 + step + 0.95)[0]
    assert request_times_s


def test_an_unconfigured_robot_is_asked_at_most_every_half_second():
    session = open_declared_session()
    request_times_s = []
    for step in range(1, 500):
        now_s = T0 + 0.1 + step * 0.02
        receive(session, HEARTBEAT, now_s)
        session.poll(now_s)
        request_times_s += [now_s] * len(list_requests(session))
    assert len(request_times_s) > 2
    assert all(later - earlier >= 0.5 - 1e-6 for earlier, later in zip(request_times_s, request_times_s[1:]))
    receive(session, HANDSHAKE, T0 + 11.0)
    session.take_packets()
    request_times_s = []
    for step in range(20):
        receive(session, HEARTBEAT, T0 + 11.0 + step * 0.1)
        request_times_s += poll_until(session, T0 + 11.0 + step * 0.1, T0 + 11.05 + step * 0.1)[0]
    # One may have been due already; to answer it again costs the robot nothing.
    assert len(request_times_s) <= 1


def test_time_requests_and_data_show_that_the_robot_is_configured():
    for sign_of_life in (TIME_REQUEST, ODOM_MESSAGE):
        session = open_declared_session()
        for step in range(1, 200):
            now_s = T0 + step * 0.1
            receive(session, HEARTBEAT if step % 25 else sign_of_life, now_s)
            session.poll(now_s)
            assert list_requests(session) == []


# Time.


def test_a_time_request_is_answered_with_the_time_at_which_it_arrived():
    session = open_declared_session()
    assert receive(session, TIME_REQUEST) == []
    assert session.take_packets() == [TIME_ANSWER]


def test_a_time_request_of_another_length_is_a_problem_and_not_answered():
    session = open_declared_session()
    (problem,) = receive(session, build_packet(10, bytes(4)))
    assert problem == Problem("Time: has 4 bytes instead of 8")
    assert session.take_packets() == []


# Giving up.


def test_a_session_ends_after_silence_and_not_before():
    session = open_declared_session(silence_timeout_s=6.0)
    assert session.poll(T0 + 6.0) == []
    (ended,) = session.poll(T0 + 6.2)
    assert type(ended) is SessionEnded
    assert ended.reason.startswith("silent for 6.1 s")


def test_bytes_that_make_no_packet_are_silence():
    session = open_declared_session(silence_timeout_s=6.0)
    for number in range(7):
        now_s = T0 + 0.9 * number
        assert session.receive_bytes(b"\xff", now_s, 0.0) == []
        assert session.poll(now_s) == []
    (ended,) = session.poll(T0 + 6.2)
    assert "no whole packet" in ended.reason


def test_silence_counts_only_while_there_are_subscribers():
    session = open_declared_session(silence_timeout_s=6.0)
    session.listening_s = T0 + 60.0
    assert session.poll(T0 + 65.9) == []
    assert session.poll(T0 + 66.1)[0].reason.startswith("silent for 6.1 s")


def test_a_robot_that_only_asks_for_the_time_is_noticed_once():
    session = open_declared_session()
    noticed_s = []

    def ask(start_s):
        for step in range(100):
            receive(session, TIME_REQUEST, start_s + 0.1 * step)
            noticed_s.extend([0.1 * step] * session.begins_to_lack_data())

    ask(T0)
    receive(session, ODOM_MESSAGE, T0 + 20.0)
    assert not session.begins_to_lack_data()
    ask(T0 + 20.0)
    assert noticed_s == pytest.approx([5.1, 5.1])
    session.listening_s = T0 + 100.0
    receive(session, TIME_REQUEST, T0 + 104.0)
    assert not session.begins_to_lack_data(), "while the driver could not read, robots may have sent data"


def test_a_robot_that_is_silent_does_not_lack_data():
    session = open_declared_session()
    receive(session, ODOM_MESSAGE, T0 + 1.0)
    session.poll(T0 + 6.9)
    assert not session.begins_to_lack_data()


# What the robot sends.


def test_a_message_comes_with_its_topic_in_the_order_of_the_wire():
    session = open_declared_session()
    events = receive(session, ODOM_MESSAGE + HEARTBEAT + ENCODER_MESSAGE)
    assert [type(event) for event in events] == [MessagesReceived, Log, MessagesReceived]
    ((topic, payload),) = events[0].messages
    assert topic.info.name == "/hero_0/odom"
    assert topic.kind is TopicKind.PUBLISHER
    assert payload == ODOM_MESSAGE[7:-1]
    assert [topic.info.name for topic, _ in events[2].messages] == ["/hero_0/encoder"]


def test_data_on_an_id_that_the_robot_receives_is_not_passed_on():
    session = open_declared_session()
    (problem,) = receive(session, build_packet(109, bytes(48)))
    assert type(problem) is Problem
    assert session.undeclared_messages == 1


@pytest.mark.parametrize(
    "packet_id, text",
    [(4, "packet of kind 4"), (5, "services or parameters"), (6, "kind 6")],
)
def test_requests_that_only_other_devices_make_are_refused_by_name(packet_id, text):
    session = open_declared_session()
    (problem,) = receive(session, build_packet(packet_id, build_text("~gain")))
    assert text in problem.text
    assert session.undeclared_messages == 0
    assert session.take_packets() == []


@pytest.mark.parametrize("frame_id", [0, 1, 2, 3, 4, 5, 6, 7, 10])
@pytest.mark.parametrize("payload", [b"", b"\x00", b"\xff" * 40], ids=["empty", "one byte", "noise"])
def test_a_broken_payload_of_a_special_packet_is_only_a_problem(frame_id, payload):
    session = open_declared_session()
    (problem,) = receive(session, build_packet(frame_id, payload))
    assert type(problem) is Problem
    assert len(session.topics) == len(STOCK_TOPICS)
    assert isinstance(receive(session, ODOM_MESSAGE)[0], MessagesReceived)


@pytest.mark.parametrize("topic_id", [8, 9, 11, 50, 99, 300, 65535])
def test_an_id_without_a_meaning_is_counted_and_does_no_harm(topic_id):
    session = open_declared_session()
    receive(session, build_packet(topic_id, b"abc") + TX_STOP)
    assert session.undeclared_messages == 2
    assert isinstance(receive(session, ODOM_MESSAGE)[0], MessagesReceived)


@given(chunks=st.lists(st.one_of(st.binary(max_size=100), st.sampled_from([v.data for v in VECTORS]))))
def test_arbitrary_bytes_never_raise(chunks):
    session = Session(SessionLimits(), T0)
    for step, chunk in enumerate(chunks):
        receive(session, chunk, T0 + step * 0.1)
        session.poll(T0 + step * 0.1)
        list_requests(session)


special = st.tuples(st.sampled_from([0, 1, 2, 3, 4, 5, 6, 7, 8, 10, 11, 100, 125]), st.binary(max_size=80))


@given(packets=st.lists(special, max_size=30))
def test_good_packets_with_arbitrary_payloads_never_raise(packets):
    session = open_session()
    for topic_id, payload in packets:
        receive(session, build_packet(topic_id, payload), T0)
    session.poll(T0 + 1.0)


@given(cuts=st.lists(st.integers(0, len(HANDSHAKE) + 1000)))
def test_any_cut_of_a_conversation_gives_the_same_events(cuts):
    stream = HEARTBEAT + HANDSHAKE + ODOM_MESSAGE + ENCODER_MESSAGE + TIME_REQUEST
    whole = receive(open_session(), stream)
    session, events = open_session(), []
    positions = [0, *sorted(cuts), len(stream)]
    for start, end in zip(positions, positions[1:]):
        events += receive(session, stream[start:end])
    assert separate_messages(events) == separate_messages(whole)


def separate_messages(events):
    """Return events with each message by itself, as (topic, payload)."""
    return [part for event in events for part in (event.messages if type(event) is MessagesReceived else [event])]
