"""What the driver changes in rospy: who may connect at once, and what a log line holds."""

import logging
import socket
from types import SimpleNamespace

import pytest
from rospy.impl import rosout

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
    logging.getLogger("rosout").error("another line")
    assert [line.msg for line in rosout_publisher.lines] == ["a line about hero_3", "another line"]


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
