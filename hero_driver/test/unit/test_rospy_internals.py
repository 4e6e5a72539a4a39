"""What the driver changes in rospy: who may connect at once, and what a log line holds."""

import logging
import socket
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
from rospy.impl import rosout
from rospy.impl.masterslave import ROSHandler
from rospy.topics import _SubscriberImpl

from hero_driver.ros import rospy_internals
from hero_driver.ros.rospy_internals import leave_topics_out_of_rosout


class Publisher:
    """What rospy's publisher of /rosout is to the handler."""

    def __init__(self):
        self.lines = []

    def publish(self, line):
        self.lines.append(line)
        logging.getLogger("rosout").warning("to publish logs in turn")


@pytest.fixture(name="rosout_publisher")
def make_rosout_publisher(monkeypatch):
    """Give what publishes /rosout, with rospy's own handler for log lines; what was before comes back."""
    logger, publisher = logging.getLogger("rosout"), Publisher()
    handlers, logger.handlers = logger.handlers, [rosout.RosOutHandler()]
    monkeypatch.setattr(rosout, "_rosout_pub", publisher)
    for name in ("rospy", "get_topic_manager"):
        monkeypatch.setattr(rosout, name, getattr(rosout, name))
    monkeypatch.setattr(rospy_internals.rospy.Time, "now", staticmethod(lambda: rospy_internals.rospy.Time(7)))
    yield publisher
    logger.handlers = handlers


def test_a_log_line_holds_no_names_of_topics_and_is_published_once(rosout_publisher):
    leave_topics_out_of_rosout()
    logging.getLogger("rosout").error("a line about %s", "hero_3")
    [line] = rosout_publisher.lines
    assert (line.msg, line.level, line.topics) == ("a line about hero_3", line.ERROR, [])
    assert line.header.stamp.secs == 7
    asks = rosout.rospy  # by the one or the other, as its version has it
    assert not asks.get_param_cached("/rosout_disable_topics_generation") and not asks.has_param("/use_sim_time")
    logging.getLogger("rosout").error("another line")
    assert [line.msg for line in rosout_publisher.lines] == ["a line about hero_3", "another line"]


@pytest.mark.parametrize("is_there", [True, False])
def test_a_publisher_is_looked_for_again_when_its_connection_ends(monkeypatch, is_there):
    steps, ended, other = [], object(), object()
    pubsub, registration = rospy_internals.tcpros_pubsub, rospy_internals.registration

    def connect(connection, address, port, uri, receive, topic):
        steps.append("connected until it ended")

    # As rospy's own, which this replaces; what was before comes back.
    monkeypatch.setattr(pubsub, "robust_connect_subscriber", create_autospec(connect, side_effect=connect))
    monkeypatch.setattr(
        pubsub,
        "check_if_still_publisher",
        create_autospec(pubsub.check_if_still_publisher, side_effect=lambda topic, uri: is_there),
    )
    impl = create_autospec(_SubscriberImpl, instance=True, connections=[ended, other])
    impl.remove_connection.side_effect = lambda connection: steps.append(connection)
    topics = {"/topic": impl}
    monkeypatch.setattr(registration, "get_topic_manager", lambda: SimpleNamespace(get_subscriber_impl=topics.get))
    manager = create_autospec(registration.RegManager, instance=True)
    manager.handler = create_autospec(ROSHandler, instance=True)
    manager.handler._connect_topic.side_effect = lambda topic, uri: steps.append((topic, uri))
    monkeypatch.setattr(
        registration, "get_registration_listeners", lambda: SimpleNamespace(listeners=[object(), manager])
    )
    monkeypatch.setattr(rospy_internals, "time", SimpleNamespace(sleep=steps.append))
    rospy_internals.keep_publishers_connected()

    def run():
        steps.clear()
        pubsub.robust_connect_subscriber(ended, "10.0.0.2", 40000, "http://10.0.0.2:50000/", None, "/topic")
        return steps[1:]

    again = [("/topic", "http://10.0.0.2:50000/")] if is_there else []
    assert run() == [ended, 0.5, *again]
    impl.connections = [other]
    assert run() == [0.5, *again], "rospy has removed it already"
    monkeypatch.setattr(rospy_internals.rospy, "is_shutdown", lambda: True)
    assert run() == []
    topics.clear()
    assert run() == []


def test_what_is_sent_is_counted_and_what_does_not_fit_comes_back():
    ours, theirs = socket.socketpair()
    with ours, theirs:
        connection = SimpleNamespace(socket=ours, stat_bytes=5, stat_num_msg=7)
        assert rospy_internals.send(connection, b"word") == b""
        assert (connection.stat_bytes, connection.stat_num_msg) == (9, 8)
        large = bytes(1 << 24)
        left = rospy_internals.send(connection, large)
        assert 0 < len(left) < len(large) and connection.stat_bytes == 9 + len(large) - len(left)
        ours.setblocking(True)
        assert rospy_internals.send(connection, left) == left, "it does not wait for room"
