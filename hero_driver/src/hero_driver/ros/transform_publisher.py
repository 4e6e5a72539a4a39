"""Publishes the transforms of all robots: those that arrive within PERIOD_S as one message. Thread of the sockets.

One message for each, as robots send them, would be 150 per robot and second for every listener.
"""

from typing import Callable, List

from tf2_msgs.msg import TFMessage

from hero_node import encode_list

from ..transport.event_loop import CallLater
from .message_types import make_raw_class
from .raw_publisher import RawPublisher

PERIOD_S = 0.01
QUEUE_LENGTH = 200
"""Two seconds of messages for a listener that is slow."""

TRANSFORMS_MAX = 500
"""A message holds at most this many transforms: 50 kB, about 3 s of one robot, 30 ms of a hundred."""


class TransformPublisher:
    """The publisher of /tf: add(geometry_msgs/TransformStamped as bytes), then schedule() unless is_scheduled."""

    def __init__(self, call_later: CallLater) -> None:
        self._call_later = call_later
        self._publisher = RawPublisher(QUEUE_LENGTH, call_later)
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
            self._call_later(PERIOD_S, self._publish)

    def _publish(self) -> None:
        self.is_scheduled = False
        if self._publisher.is_wanted:
            for start in range(0, len(self._transforms), TRANSFORMS_MAX):
                part = self._transforms[start : start + TRANSFORMS_MAX]
                self._publisher.publish(encode_list(part))
        self._transforms.clear()
