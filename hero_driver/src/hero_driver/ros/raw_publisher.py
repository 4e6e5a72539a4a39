"""Publishes raw messages to all subscribers of a topic, without waiting for a slow one.

Waking rospy's thread of each subscriber would cost as much as the rest of the driver. Here the thread of the sockets
writes itself and never waits: what a slow socket does not take is kept, whole messages only, up to a limit, then the
oldest goes. rospy does the rest: registration, handshakes, statistics, shutdown.
"""

import collections
from typing import Any, Callable, Deque, Dict, List

from tf2_msgs.msg import TFMessage

from hero_node.ros_messages import LENGTH, encode_list

from ..transport.event_loop import CallLater
from .message_types import make_raw_class
from .rospy_internals import NO_CONNECTIONS, open_publisher, send, unregister

RETRY_S = 0.01
"""Delay before a subscriber whose socket was full is tried again."""

TRANSFORMS_PERIOD_S = 0.01
TRANSFORMS_QUEUE_LENGTH = 200
"""Two seconds of messages for a listener that is slow."""

TRANSFORMS_MAX = 500
"""A message holds at most this many transforms: 50 kB, about 3 s of one robot, 30 ms of a hundred."""


class RawPublisher:
    """Publisher of one topic; open() may be called by any thread, the rest only by the thread of the sockets."""

    def __init__(self, queue_length: int, call_later: CallLater) -> None:
        """Keep queue_length messages for each slow subscriber; call_later(delay_s, call) is the loop's."""
        self._queue_length = queue_length
        self._call_later = call_later
        self._publisher: Any = None
        self._impl: Any = NO_CONNECTIONS  # rospy's, of the topic
        self._backlogs: Dict[Any, Deque[bytes]] = {}
        self.raw_class: Any = None
        self.dropped = 0

    def open(self, name: str, raw_class: Any) -> None:
        """Register the topic called name; asks the ROS master, so it may block."""
        self.raw_class = raw_class
        self._publisher, self._impl = open_publisher(name, raw_class)

    def release(self) -> List[Callable[[], None]]:
        """Publish no more; return what unregisters the topic, to be called where blocking is allowed."""
        publisher, self._publisher = self._publisher, None
        self._impl = NO_CONNECTIONS
        self._backlogs.clear()
        return [] if publisher is None else [lambda: unregister(publisher)]

    @property
    def is_open(self) -> bool:
        """Return whether the topic is registered."""
        return self._publisher is not None

    @property
    def is_wanted(self) -> bool:
        """Return whether there is a subscriber."""
        return bool(self._impl.connections)

    def publish(self, payload: bytes) -> None:
        """Send payload to all subscribers."""
        connections = self._impl.connections
        if not connections:
            return
        data = LENGTH.pack(len(payload)) + payload
        for connection in connections:
            backlog = self._backlogs.get(connection) if self._backlogs else None
            if backlog is not None:
                self._keep(backlog, data)
                continue
            remainder = send(connection, data)
            if remainder:
                if not self._backlogs:
                    self._call_later(RETRY_S, self._retry)
                self._backlogs[connection] = collections.deque((remainder,))

    def _keep(self, backlog: Deque[bytes], data: bytes) -> None:
        if len(backlog) > self._queue_length:
            # The first one is on its way in part and has to be finished; the second is the oldest whole one.
            del backlog[1]
            self.dropped += 1
        backlog.append(data)

    def _retry(self) -> None:
        connections = self._impl.connections or ()
        for connection, backlog in list(self._backlogs.items()):
            if connection not in connections:
                del self._backlogs[connection]
                continue
            while backlog:
                remainder = send(connection, backlog[0])
                if remainder:
                    backlog[0] = remainder
                    break
                backlog.popleft()
            if not backlog:
                del self._backlogs[connection]
        if self._backlogs:
            self._call_later(RETRY_S, self._retry)


class TransformPublisher:
    """The transforms of all robots on /tf: those that arrive within TRANSFORMS_PERIOD_S as one message.

    One message for each, as robots send them, would be 150 per robot and second for every listener.
    """

    def __init__(self, call_later: CallLater) -> None:
        """Collect what add() takes, a geometry_msgs/TransformStamped as bytes; call_later is the loop's."""
        self._call_later = call_later
        self._publisher = RawPublisher(TRANSFORMS_QUEUE_LENGTH, call_later)
        self._transforms: List[bytes] = []
        self.add: Callable[[bytes], None] = self._transforms.append
        self.is_scheduled = False

    def open(self) -> None:
        """Advertise /tf; asks the ROS master."""
        self._publisher.open("/tf", make_raw_class(TFMessage))

    def schedule(self) -> None:
        """Publish what was added within the period; for after each read, unless is_scheduled."""
        if self._transforms:
            self.is_scheduled = True
            self._call_later(TRANSFORMS_PERIOD_S, self._publish)

    def _publish(self) -> None:
        self.is_scheduled = False
        if self._publisher.is_wanted:
            for start in range(0, len(self._transforms), TRANSFORMS_MAX):
                part = self._transforms[start : start + TRANSFORMS_MAX]
                self._publisher.publish(encode_list(part))
        self._transforms.clear()
