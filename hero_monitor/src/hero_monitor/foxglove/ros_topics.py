"""The topics that exist, and the bytes of those that clients want; decodes only drivers' reports.

The ROS master is asked in the background, because it may block.
"""

import time
from collections import deque
from concurrent.futures import Future
from io import BytesIO
from typing import Any, Deque, Dict, List, Optional, Set

import roslib.message
import rospy

from hero_msgs.msg import RobotArray
from hero_node.errors import NodeError
from hero_node.ros.master import ask_master

from ..background import Background
from .hub import TopicMessage, TopicType

LOOK_UP_PERIOD_S = 1.0
WAITING_MAX = 20_000
"""Messages between two turns of the web server; the oldest are dropped."""

WARN_PERIOD_S = 10.0

DECODED = {RobotArray._type: RobotArray}
"""Written again as they were: the monitor subscribes to drivers' reports, and rospy gives all subscribers of a topic in
one process the class of the first. As bytes they would be lost to STOP ALL."""


class RosTopics:
    """Topics with a publisher, and a subscription for each that is wanted."""

    def __init__(self, background: Background) -> None:
        self._types: Dict[str, TopicType] = {}
        self._background = background
        self._md5: Dict[str, str] = {}
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        self._messages: Deque[TopicMessage] = deque(maxlen=WAITING_MAX)
        self._look_up: Optional[Future[None]] = None
        self._looked_up_s = -LOOK_UP_PERIOD_S
        self._change: Optional[Future[None]] = None

    def find_types(self) -> Dict[str, TopicType]:
        """Return the topics known, and ask for them anew if it is time to; returns at once."""
        now_s = time.monotonic()
        is_pending = self._look_up is not None and not self._look_up.done()
        if not is_pending and now_s - self._looked_up_s >= LOOK_UP_PERIOD_S:
            self._looked_up_s = now_s
            self._look_up = self._background.submit(self._ask)
        return self._types

    def _ask(self) -> None:
        try:
            published = ask_master("getPublishedTopics", "")
        except NodeError:
            return  # the known ones remain: their publishers go on without a master
        types: Dict[str, TopicType] = {}
        for topic, type_name in published:
            message_class = roslib.message.get_message_class(type_name)
            if message_class is None:
                self._background.warn("%s: %s is not built here: not offered" % (topic, type_name), WARN_PERIOD_S)
                continue
            self._md5[topic] = message_class._md5sum
            types[topic] = TopicType(type_name, message_class._full_text)
        self._types = types

    def want(self, topics: Set[str]) -> bool:
        """Subscribe to these topics and no others; return whether that is done. Returns at once."""
        if self._change is not None and not self._change.done():
            return False
        if topics == set(self._subscribers):
            return True
        self._change = self._background.submit(self._change_subscriptions, topics)
        return False

    def _change_subscriptions(self, topics: Set[str]) -> None:
        for topic in set(self._subscribers) - topics:
            self._subscribers.pop(topic).unregister()
        for topic in topics - set(self._subscribers):
            known = self._types.get(topic)
            message_class = rospy.AnyMsg if known is None else DECODED.get(known.name, rospy.AnyMsg)
            self._subscribers[topic] = rospy.Subscriber(topic, message_class, self._keep, topic, queue_size=100)

    def _keep(self, message: Any, topic: str) -> None:
        header = message._connection_header
        content = message._buff if isinstance(message, rospy.AnyMsg) else _write(message)
        # Bytes of another definition than the one offered would be shown as wrong numbers.
        if header["md5sum"] == self._md5.get(topic):
            latched_by = header["callerid"] if header.get("latching") == "1" else ""
            self._messages.append(TopicMessage(topic, content, time.time_ns(), latched_by))

    def take(self) -> List[TopicMessage]:
        """Return what has arrived since the last call."""
        return [self._messages.popleft() for _ in range(len(self._messages))]


def _write(message: Any) -> bytes:
    buffer = BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()
