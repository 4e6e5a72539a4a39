"""Reads the messages of bag files in order of time; a file that cannot be read is refused in one line."""

import os
from typing import Any, Callable, Dict, List, NamedTuple, Sequence, Tuple

import rosbag
from rosbag.bag import ROSBagUnindexedException
from tqdm import tqdm

from .errors import RecordingError, explain_bag_errors
from .repair import ACTIVE_SUFFIX
from .topics import Message


class RawMessage(NamedTuple):
    """A message as bytes, as it was recorded."""

    topic: str
    header: Dict[str, str]
    """Of the connection: type, md5sum, message_definition; callerid and latching, if the publisher sent them."""
    content: bytes
    time_ns: int
    """When the recorder received it, since 1970."""


class BagSet:
    """The files of one recording, sorted by time. Only one is open at a time: an open bag holds its index in memory.

    Attributes:
        paths: the files, in order.
        topics: every topic and its type.
        start_s, end_s: times of the first and the last message, since 1970.
    """

    def __init__(self, paths: Sequence[str]) -> None:
        """Read the header of every file. Raises: RecordingError."""
        self.topics: Dict[str, str] = {}
        self._counts: Dict[str, Dict[str, int]] = {}
        spans: List[Tuple[float, float, str]] = []
        for path in {os.path.realpath(path): path for path in paths}.values():
            with open_bag(path, skip_index=True) as bag, explain_bag_errors("%s cannot be read" % path):
                topics = bag.get_type_and_topic_info().topics
                self._counts[path] = {topic: info.message_count for topic, info in topics.items()}
                if not any(self._counts[path].values()):
                    continue  # rosbag opens the next file of a split before anything arrives for it
                self.topics.update({topic: info.msg_type for topic, info in topics.items()})
                spans.append((bag.get_start_time(), bag.get_end_time(), path))
        if not spans:
            raise RecordingError("%s: no messages in it" % ", ".join(paths))
        self.paths = [path for _, _, path in sorted(spans)]
        self.start_s = min(start_s for start_s, _, _ in spans)
        self.end_s = max(end_s for _, end_s, _ in spans)

    def read(self, is_wanted: Callable[[str, str], bool], receive: Callable[[Message], None]) -> None:
        """Pass every message whose topic and type is_wanted() accepts to receive. Raises: RecordingError."""
        wanted = [topic for topic, message_type in self.topics.items() if is_wanted(topic, message_type)]
        if not wanted:
            return

        def decode(topic: str, content: Any, time: Any) -> None:
            receive(Message(topic, content._type, content, time.to_sec()))

        self._read(wanted, decode)

    def read_raw(self, receive: Callable[[RawMessage], None]) -> None:
        """Pass every message of every topic to receive, without decoding it. Raises: RecordingError."""

        def pass_on(topic: str, raw: Any, time: Any, header: Dict[str, Any]) -> None:
            texts = {name: value.decode() if isinstance(value, bytes) else value for name, value in header.items()}
            receive(RawMessage(topic, texts, raw[1], time.to_nsec()))

        self._read(list(self.topics), pass_on, raw=True, return_connection_header=True)

    def _read(self, topics: Sequence[str], receive: Callable[..., None], **how: bool) -> None:
        for path in self.paths:
            total = sum(self._counts[path].get(topic, 0) for topic in topics)
            # receive() fails as well where a message definition in the bag is damaged.
            with open_bag(path) as bag, explain_bag_errors("%s cannot be read" % path):
                messages = bag.read_messages(topics, **how)
                # disable=None: no bar in a log.
                for message in tqdm(
                    messages, os.path.basename(path), total, unit=" messages", leave=False, disable=None
                ):
                    receive(*message)

    def describe_topics(self) -> str:
        """Return some of the topics for an error message."""
        return ", ".join(sorted(self.topics)[:8]) or "none"


def open_bag(path: str, skip_index: bool = False) -> rosbag.Bag:
    """Open a bag for reading. Raises: RecordingError with the remedy."""
    repair = "if it was cut off, repair it: rosrun hero_recording record --repair %s" % path
    if path.endswith(ACTIVE_SUFFIX):
        raise RecordingError("%s is still being written; %s" % (path, repair))
    if os.path.isdir(path):
        raise RecordingError("%s is a folder; name the bags in it: %s" % (path, os.path.join(path, "*.bag")))
    try:
        with explain_bag_errors("%s cannot be read" % path):
            return rosbag.Bag(path, "r", skip_index=skip_index)
    except RecordingError as error:
        if isinstance(error.__cause__, ROSBagUnindexedException):
            raise RecordingError("%s has no index, or a damaged one; %s" % (path, repair)) from error
        raise
