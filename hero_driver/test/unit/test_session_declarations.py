"""What a robot may declare, what is refused, and that nothing leaves that was not declared."""

import pytest
from conversation import T0, list_requests, open_declared_session, open_session, receive
from hypothesis import given
from hypothesis import strategies as st
from vectors import (
    FROM_ROBOT,
    HANDSHAKE,
    ODOM_MESSAGE,
    STOCK_TOPICS,
    TWIST_MD5,
    build_declaration,
    build_packet,
)

from hero_driver.rosserial.packets import RosserialError
from hero_driver.rosserial.session import MessagesReceived, Problem, Topic, TopicKind

ODOM = next(topic for topic in STOCK_TOPICS if topic[1] == 130)
CMD_VEL = next(topic for topic in STOCK_TOPICS if topic[1] == 109)


def declare_twist(topic_id, name, frame_id=1, **changes):
    return build_declaration(frame_id, topic_id, name, "geometry_msgs/Twist", TWIST_MD5, **changes)


# What may be declared.


def test_the_stock_robots_topics_are_kept_by_id_with_kind_and_direction():
    session = open_declared_session()
    assert {topic_id: topic.info[:4] for topic_id, topic in session.topics.items()} == {
        topic[1]: topic[1:] for topic in STOCK_TOPICS
    }
    assert [topic_id for topic_id, topic in session.topics.items() if topic.kind.is_from_robot] == FROM_ROBOT
    kinds = {topic_id: topic.kind for topic_id, topic in session.topics.items()}
    assert (kinds[130], kinds[109]) == (TopicKind.PUBLISHER, TopicKind.SUBSCRIBER)
    assert (kinds[131], kinds[103]) == (TopicKind.SERVICE_ANSWERS, TopicKind.SERVICE_REQUESTS)


@pytest.mark.parametrize(
    "frame_id, kind, is_from_robot",
    [
        (0, TopicKind.PUBLISHER, True),
        (1, TopicKind.SUBSCRIBER, False),
        (2, TopicKind.SERVICE_ANSWERS, True),
        (3, TopicKind.SERVICE_REQUESTS, False),
    ],
)
def test_the_id_of_the_declaring_packet_says_the_kind_and_the_direction(frame_id, kind, is_from_robot):
    session = open_session()
    (event,) = receive(session, declare_twist(110, "/hero_0/x", frame_id))
    assert event.kind is kind
    assert kind.is_from_robot is is_from_robot


def test_the_same_declaration_again_is_no_event():
    session = open_declared_session()
    assert receive(session, HANDSHAKE) == []
    assert len(session.topics) == len(STOCK_TOPICS)


def test_ids_redeclared_too_often_are_refused_and_keep_their_name():
    session = open_session(max_topics=3)
    events = []
    for count in range(10):
        events += receive(session, declare_twist(106, "/hero_0/name_%d/cmd_vel" % count))
    assert [type(event) for event in events] == [Topic] * 4 + [Problem] * 6
    assert "more than 3 times (max_topics)" in events[4].text
    assert session.topics[106].info.name == "/hero_0/name_3/cmd_vel"


def test_an_id_that_changes_its_direction_changes_what_may_be_sent():
    session = open_declared_session()
    session.encode_message(109, bytes(48))
    receive(session, declare_twist(109, "/hero_0/twist", frame_id=0))
    with pytest.raises(RosserialError, match="not declared"):
        session.encode_message(109, bytes(48))
    assert isinstance(receive(session, build_packet(109, bytes(48)))[0], MessagesReceived)
    receive(session, declare_twist(130, "/hero_0/odom", frame_id=1))
    assert session.encode_message(130, bytes(48)) == build_packet(130, bytes(48))


# What is refused while everything else works.

BAD_DECLARATIONS = {
    "id of a special packet": (declare_twist(7, "/hero_0/x"), "its id 7 is below 100"),
    "id below the first topic": (declare_twist(99, "/hero_0/x"), "its id 99 is below 100"),
    "empty name": (declare_twist(120, ""), "not a ROS name"),
    "name with a space": (declare_twist(120, "/hero_0/a b"), "not a ROS name"),
    "name with a line break": (declare_twist(120, "/hero_0/a\nb"), "not a ROS name"),
    "name that ends in a line break": (declare_twist(120, "/hero_0/a\n"), "not a ROS name"),
    "name with colors": (declare_twist(120, "/hero_0/\x1b[31m"), "not a ROS name"),
    "name in other letters": (declare_twist(120, "/hero_0/größe"), "not a ROS name"),
    "name that begins with a digit": (declare_twist(120, "/0/x"), "not a ROS name"),
    "name with an empty part": (declare_twist(120, "/hero_0//x"), "not a ROS name"),
    "name that ends in a slash": (declare_twist(120, "/hero_0/"), "not a ROS name"),
    "name that leaves its place": (declare_twist(120, "/hero_0/../hero_1/x"), "not a ROS name"),
    "long name": (declare_twist(120, "/hero_0/" + "x" * 121), "129 characters, more than 128"),
    "type without a package": (
        build_declaration(1, 120, "/hero_0/x", "Twist", TWIST_MD5),
        "not of the form package/Type",
    ),
    "type in two packages": (
        build_declaration(1, 120, "/hero_0/x", "a/b/Twist", TWIST_MD5),
        "not of the form package/Type",
    ),
    "type that ends in a line break": (
        build_declaration(1, 120, "/hero_0/x", "geometry_msgs/Twist\n", TWIST_MD5),
        "not of the form package/Type",
    ),
    "long type": (
        build_declaration(1, 120, "/hero_0/x", "geometry_msgs/T" + "x" * 200, TWIST_MD5),
        "not of the form package/Type",
    ),
    "short md5": (build_declaration(1, 120, "/hero_0/x", "a/B", "9f195f88"), "not 32 hexadecimal digits"),
    "md5 of other letters": (
        build_declaration(1, 120, "/hero_0/x", "a/B", "g" * 32),
        "not 32 hexadecimal digits",
    ),
    "md5 that ends in a line break": (
        build_declaration(1, 120, "/hero_0/x", "a/B", TWIST_MD5 + "\n"),
        "not 32 hexadecimal digits",
    ),
    "any type": (build_declaration(1, 120, "/hero_0/x", "*", "*"), "not of the form package/Type"),
    "no buffer": (declare_twist(120, "/hero_0/x", buffer_length=0), "its buffer_size is 0"),
    "negative buffer": (declare_twist(120, "/hero_0/x", buffer_length=-1), "its buffer_size is -1"),
}


@pytest.mark.parametrize("name", BAD_DECLARATIONS)
def test_a_bad_declaration_is_a_problem_in_one_line_while_the_others_work(name):
    declaration, words = BAD_DECLARATIONS[name]
    session = open_session()
    events = receive(session, build_declaration(*ODOM) + declaration + build_declaration(*CMD_VEL) + ODOM_MESSAGE)
    assert [type(event) for event in events] == [Topic, Problem, Topic, MessagesReceived]
    assert words in events[1].text
    assert "refused" in events[1].text
    assert events[1].text.isprintable()
    assert len(events[1].text) < 300
    assert sorted(session.topics) == [109, 130]


def test_a_bad_declaration_before_all_others_does_not_count_as_an_answer():
    session = open_session()
    receive(session, declare_twist(7, "/hero_0/x"))
    session.poll(T0 + 1.5)
    assert len(list_requests(session)) == 1


def test_topics_beyond_the_limit_are_refused_while_the_first_ones_work():
    session = open_session(max_topics=3)
    events = [receive(session, declare_twist(100 + index, "/hero_0/x%d" % index))[0] for index in range(5)]
    assert [type(event) for event in events] == [Topic] * 3 + [Problem] * 2
    assert "more than 3 topics (max_topics)" in events[4].text
    assert sorted(session.topics) == [100, 101, 102]
    session.encode_message(102, bytes(48))
    with pytest.raises(RosserialError, match="not declared"):
        session.encode_message(103, bytes(48))


def test_an_id_may_be_declared_again_at_the_limit_of_topics():
    session = open_session(max_topics=1)
    receive(session, declare_twist(100, "/hero_0/a"))
    (event,) = receive(session, declare_twist(100, "/hero_0/b"))
    assert type(event) is Topic
    assert session.topics[100].info.name == "/hero_0/b"


# What may be sent.


def test_a_message_fills_the_robots_buffer_and_never_more():
    session = open_session()
    receive(session, declare_twist(100, "/hero_0/x", buffer_length=48))
    assert len(session.encode_message(100, bytes(48))) == 56
    with pytest.raises(RosserialError, match="/hero_0/x.*49 bytes.*48 bytes"):
        session.encode_message(100, bytes(49))


def test_a_robot_that_claims_a_huge_buffer_does_not_break_the_packets():
    session = open_session()
    receive(session, declare_twist(100, "/hero_0/x", buffer_length=2**31 - 1))
    with pytest.raises(RosserialError, match="65536 bytes does not fit a packet"):
        session.encode_message(100, bytes(65536))


@given(
    declared=st.dictionaries(st.integers(0, 300), st.tuples(st.integers(0, 5), st.integers(-10, 60)), max_size=8),
    topic_id=st.integers(-5, 400),
    length=st.integers(0, 80),
)
def test_only_declared_ids_of_the_right_direction_and_length_ever_leave(declared, topic_id, length):
    session = open_session()
    for declared_id, (frame_id, buffer_length) in declared.items():
        receive(session, declare_twist(declared_id, "/hero_0/x", frame_id, buffer_length=buffer_length))
    frame_id, buffer_length = declared.get(topic_id, (0, 0))
    if topic_id >= 100 and frame_id in (1, 3, 5) and buffer_length >= max(1, length):
        assert session.encode_message(topic_id, bytes(length)) == build_packet(topic_id, bytes(length))
    else:
        with pytest.raises(RosserialError):
            session.encode_message(topic_id, bytes(length))


@given(
    frame_id=st.integers(0, 5),
    topic_id=st.integers(0, 65535),
    name=st.text(max_size=40),
    message_type=st.text(max_size=40),
    md5sum=st.text(max_size=40),
)
def test_arbitrary_declarations_are_taken_or_refused_in_one_line(frame_id, topic_id, name, message_type, md5sum):
    session = open_session()
    texts = [text.encode("utf-8", "replace").decode() for text in (name, message_type, md5sum)]
    (event,) = receive(session, build_declaration(frame_id, topic_id, *texts))
    if type(event) is Problem:
        assert event.text.isprintable()
        assert session.topics == {}
    else:
        assert event is session.topics[topic_id]


def test_a_name_and_a_type_may_have_128_characters():
    session = open_session()
    name, message_type = "/hero_0/" + "x" * 120, "geometry_msgs/" + "T" * 114
    (event,) = receive(session, build_declaration(1, 120, name, message_type, TWIST_MD5))
    assert isinstance(event, Topic) and len(name) == len(message_type) == 128
