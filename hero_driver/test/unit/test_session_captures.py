"""Sessions over the bytes of a real robot."""

from collections import Counter

from conversation import T0, list_messages, list_requests, open_session, receive
from vectors import FROM_ROBOT, HANDSHAKE, STOCK_TOPICS

from hero_driver.rosserial.payloads import Log
from hero_driver.rosserial.session import MessagesReceived, Topic

SEGMENT_LENGTH = 1460


def run(session, data):
    """Feed data as it comes over a network, 44 kB/s, and poll as the driver does; return events and requests."""
    events, request_times_s = [], []
    for start in range(0, len(data), SEGMENT_LENGTH):
        now_s = T0 + start / 44051.0
        events += receive(session, data[start : start + SEGMENT_LENGTH], now_s)
        events += session.poll(now_s)
        request_times_s += [now_s] * len(list_requests(session))
    return events, request_times_s


def test_a_whole_conversation_has_the_topics_data_and_logs_of_the_robot(read_capture):
    session = open_session()
    events, request_times_s = run(session, read_capture("A.robot_to_server.bin"))
    assert request_times_s == []
    kinds = Counter(type(event) for event in events if type(event) is not MessagesReceived)
    assert kinds == {Log: 20, Topic: 24}
    declared = [event.info[:4] for event in events if type(event) is Topic]
    assert declared == [topic[1:] for topic in STOCK_TOPICS]
    counts = Counter(topic.info.name for topic, _ in list_messages(events))
    assert counts == {
        "/hero_0/laser": 68,
        "/hero_0/encoder": 436,
        "/tf": 2180,
        "/hero_0/odom": 436,
        "/hero_0/set_odom": 1,
    }
    assert session.undeclared_messages == 0
    assert (session.reader.packets, session.reader.bad_packets) == (3171, 0)


def test_the_handshake_by_hand_is_that_of_the_real_robot(read_capture):
    assert HANDSHAKE in read_capture("A.robot_to_server.bin")


def test_a_robot_that_declared_nothing_is_asked_again_and_then_understood(read_capture):
    session = open_session()
    capture = read_capture("C_zero_topics.robot_to_server.bin")
    events, request_times_s = run(session, capture)
    assert len(request_times_s) == 1
    assert {type(event) for event in events} == {Log}
    assert session.undeclared_messages == 140
    assert session.topics == {}

    session = open_session()
    run(session, capture[: len(capture) - 53] + HANDSHAKE)  # 53 bytes of the last packet are missing
    assert sorted(session.topics) == sorted(topic[1] for topic in STOCK_TOPICS)
    events, _ = run(session, capture)
    messages = list_messages(events)
    assert len(messages) == 140
    assert {topic.info.topic_id for topic, _ in messages} <= set(FROM_ROBOT)


def test_a_robot_with_the_imu_hat_publishes_it(read_capture):
    session = open_session()
    events, request_times_s = run(session, read_capture("E_imu_hat.robot_to_server.bin"))
    assert request_times_s == []
    counts = Counter(topic.info.name for topic, _ in list_messages(events))
    assert counts["/hero_12/imu"] == counts["/hero_12/odom"] == 63
    assert session.undeclared_messages == 0
