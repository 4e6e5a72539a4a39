"""Reads a bag with ROS's rosbag."""

from contextlib import ExitStack
from typing import Dict, Iterator, Sequence, Tuple

import rosbag

from .topics import Message


class Reader(ExitStack):
    """One open bag.

    Attributes:
        unindexed: names of the errors that a bag without index raises.
    """

    unindexed = ("ROSBagUnindexedException",)

    def __init__(self, path: str, skip_index: bool = False) -> None:
        """Open the file; skip_index: only to list topics. Raises: whatever rosbag does."""
        super().__init__()
        self._bag = self.enter_context(rosbag.Bag(path, "r", skip_index=skip_index))

    def list_topics(self) -> Dict[str, Tuple[str, int]]:
        """Return the type of every topic, and the number of its messages."""
        topics = self._bag.get_type_and_topic_info().topics
        return {topic: (info.msg_type, info.message_count) for topic, info in topics.items()}

    def find_span(self) -> Tuple[float, float]:
        """Return the times of the first and the last message, seconds since 1970."""
        return self._bag.get_start_time(), self._bag.get_end_time()

    def read(self, topics: Sequence[str]) -> Iterator[Message]:
        """Yield messages in order of time."""
        for topic, content, time in self._bag.read_messages(topics):
            yield Message(topic, content._type, content, time.to_sec())
