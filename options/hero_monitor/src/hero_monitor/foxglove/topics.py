"""The topics of ROS that exist, as channels of the protocol, and the messages of those that clients want.

The ROS master and publishers are asked in the background, because they may block.
"""

import itertools
import time
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, Dict, Iterable, Iterator, List, NamedTuple, Optional, Set, Tuple

import roslib.message
import rospy

from hero_node import NodeError
from hero_node.ros import ask_master

from ..background import Background
from .streams import Stream, open_stream

LOOK_UP_PERIOD_S = 1.0
WARN_PERIOD_S = 10.0


@dataclass(frozen=True, eq=False)
class Channel:
    """A topic with a type and its full definition; with another type it is another channel."""

    id: int
    topic: str
    type: str
    definition: str
    md5sum: str

    def describe(self) -> Dict[str, Any]:
        """Return the channel as servers advertise it."""
        names = {"id": self.id, "topic": self.topic, "schemaName": self.type, "schema": self.definition}
        return {**names, "encoding": "ros1", "schemaEncoding": "ros1msg"}


class Source(NamedTuple):
    """A node that publishes on a channel."""

    channel: Channel
    node: str


class RosTopics:
    """Topics with a publisher, and a connection to each publisher of those that are wanted.

    Attributes:
        channels: by id; replaced as a whole, never changed.
    """

    def __init__(self, background: Background) -> None:
        self.channels: Dict[int, Channel] = {}
        self._background = background
        self._ids = itertools.count(1)
        self._publishers: Dict[str, Set[str]] = {}  # nodes by topic
        self._streams: Dict[Source, Stream] = {}
        self._latched: Dict[Source, bytes] = {}
        self._look_up: Optional[Future[None]] = None
        self._looked_up_s = -LOOK_UP_PERIOD_S
        self._connecting: Optional[Future[None]] = None

    def look_up(self) -> None:
        """Ask for the topics anew if it is time to; returns at once."""
        now_s = time.monotonic()
        if _is_done(self._look_up) and now_s - self._looked_up_s >= LOOK_UP_PERIOD_S:
            self._looked_up_s, self._look_up = now_s, self._background.submit(self._ask)

    def _ask(self) -> None:
        try:
            published = ask_master("getPublishedTopics", "")
            publishers, _, _ = ask_master("getSystemState")
        except NodeError:
            return  # the known ones remain: their publishers work without a master
        known = {(channel.topic, channel.type): channel for channel in self.channels.values()}
        found = [known.get((topic, kind)) or self._make_channel(topic, kind) for topic, kind in sorted(published)]
        self._publishers = {topic: set(nodes) for topic, nodes in publishers}
        self.channels = {channel.id: channel for channel in found if channel is not None}

    def _make_channel(self, topic: str, type_name: str) -> Optional[Channel]:
        message_class = roslib.message.get_message_class(type_name)
        if message_class is None:
            self._background.warn(f"{topic}: {type_name} is not built here: not offered", WARN_PERIOD_S)
            return None
        return Channel(next(self._ids), topic, type_name, message_class._full_text, message_class._md5sum)

    def want(self, channels: Set[Channel]) -> bool:
        """Have take() return messages of these channels; returns at once whether all are connected to, or closed."""
        wanted = {Source(channel, node) for channel in channels for node in self._publishers.get(channel.topic, ())}
        for source in set(self._streams) - wanted:
            self._close(source)
        missing = wanted - set(self._streams)
        is_idle = _is_done(self._connecting)
        if missing and is_idle:
            self._connecting = self._background.submit(self._connect, sorted(missing, key=lambda one: one.node))
        return is_idle and not missing

    def _connect(self, sources: Iterable[Source]) -> None:
        """Connect to publishers; those of a node that does not answer are tried again with the next call."""
        for node, published in itertools.groupby(sources, lambda source: source.node):
            try:
                uri = ask_master("lookupNode", node)
                for source in published:
                    self._streams[source] = open_stream(source.channel.topic, uri, rospy.get_name())
            except (NodeError, OSError):
                continue

    def _close(self, source: Source) -> None:
        self._streams.pop(source).close()
        self._latched.pop(source, None)

    def take(self) -> Iterator[Tuple[Channel, bytes]]:
        """Yield the messages that have arrived since the last call."""
        for source, stream in list(self._streams.items()):
            messages = stream.read()
            # Bytes of another definition than the one offered would be shown as wrong numbers.
            if messages and stream.header.get("md5sum") == source.channel.md5sum:
                if stream.header.get("latching") == "1":
                    self._latched[source] = messages[-1]
                for content in messages:
                    yield source.channel, content
            if not stream.is_open:
                self._close(source)

    def find_latched(self, channel: Channel) -> List[bytes]:
        """Return the latched messages, which publishers send once: a later client of the channel gets these."""
        return [content for source, content in self._latched.items() if source.channel is channel]


def _is_done(future: Optional["Future[None]"]) -> bool:
    return future is None or future.done()
