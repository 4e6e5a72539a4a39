"""A ROS topic -> its newest message, read only when somebody asks.

Messages are kept as bytes: a swarm sends far more of them than anybody looks at.
"""

from typing import Any, Optional

import genpy
import rospy


class NewestMessage:
    """A subscription of which only the newest message counts."""

    def __init__(self, topic: str, message_class: Any) -> None:
        """Listen from now on; messages of another layout than message_class's are ignored."""
        self.count = 0
        self._message_class = message_class
        self._bytes: Optional[bytes] = None
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._keep, queue_size=10)

    def _keep(self, message: rospy.AnyMsg) -> None:
        if message._connection_header["md5sum"] == self._message_class._md5sum:
            self._bytes = message._buff
            self.count += 1

    def take(self) -> Any:
        """Return the newest message, None if none that can be read has come since the last call."""
        kept, self._bytes = self._bytes, None
        if kept is None:
            return None
        try:
            return self._message_class().deserialize(kept)
        except genpy.DeserializationError:
            return None

    def close(self) -> None:
        """End the subscription; safe twice."""
        self._subscriber.unregister()
