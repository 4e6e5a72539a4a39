"""The topics that exist, and the bytes of those that clients want.

The ROS master and publishers are asked in the background, because they may block.
"""

import time
from collections import deque
from concurrent.futures import Future
from typing import Deque, Dict, List, Optional, Set, Tuple

import roslib.message
import rospy

from hero_node import NodeError
from hero_node.ros import ask_master

from ..background import Background
from .hub import TopicMessage, TopicType
from .topic_streams import Source, Stream, StreamSet, open_stream

LOOK_UP_PERIOD_S = 1.0
OPENING_MAX = 3
"""Nodes that are connected to at once: those that hang must leave workers to all else."""

WARN_PERIOD_S = 10.0


class RosTopics:
    """Topics with a publisher, and a connection to each publisher of those that are wanted."""

    def __init__(self, background: Background) -> None:
        self._types: Dict[str, TopicType] = {}
        self._background = background
        self._md5: Dict[str, str] = {}
        self._publishers: Dict[str, Set[str]] = {}  # nodes by topic
        self._wanted: Set[str] = set()
        self._streams = StreamSet()
        self._opened: Deque[Tuple[Source, Stream]] = deque()
        self._opening: Dict[str, Future[None]] = {}  # by node
        self._failed: Set[str] = set()  # nodes, since the last look-up
        self._look_up: Optional[Future[None]] = None
        self._looked_up_s = -LOOK_UP_PERIOD_S

    def find_types(self) -> Dict[str, TopicType]:
        """Return the topics known, and ask for them anew if it is time to; returns at once."""
        now_s = time.monotonic()
        is_pending = self._look_up is not None and not self._look_up.done()
        if not is_pending and now_s - self._looked_up_s >= LOOK_UP_PERIOD_S:
            self._looked_up_s = now_s
            self._look_up = self._background.submit(self._ask)
            self._failed = set()
            self._connect()
        return self._types

    def _ask(self) -> None:
        try:
            published = ask_master("getPublishedTopics", "")
            publishers, _, _ = ask_master("getSystemState")
        except NodeError:
            return  # the known ones remain: their publishers work without a master
        types: Dict[str, TopicType] = {}
        for topic, type_name in published:
            message_class = roslib.message.get_message_class(type_name)
            if message_class is None:
                self._background.warn(f"{topic}: {type_name} is not built here: not offered", WARN_PERIOD_S)
                continue
            self._md5[topic] = message_class._md5sum
            types[topic] = TopicType(type_name, message_class._full_text)
        self._publishers = {topic: set(nodes) for topic, nodes in publishers}
        self._types = types

    def want(self, topics: Set[str]) -> bool:
        """Have take() return messages of these topics from now on; return whether all are connected to, at once."""
        opening = {node: future for node, future in self._opening.items() if not future.done()}
        has_news = topics != self._wanted or len(opening) < len(self._opening)
        self._wanted, self._opening = topics, opening
        while self._opened:
            source, stream = self._opened.popleft()
            if source.topic in topics and source not in self._streams:
                self._streams.add(source, stream)
            else:
                stream.close()
        for source in self._streams:
            if source.topic not in topics:
                self._streams.drop(source)
        if has_news:
            self._connect()
        return not self._opening

    def _connect(self) -> None:
        """Connect to publishers of wanted topics, a node on each worker."""
        missing: Dict[str, List[str]] = {}
        for topic in self._wanted:
            for node in self._publishers.get(topic, ()):
                if node not in {*self._opening, *self._failed} and Source(topic, node) not in self._streams:
                    missing.setdefault(node, []).append(topic)
        for node, topics in sorted(missing.items())[: OPENING_MAX - len(self._opening)]:
            self._opening[node] = self._background.submit(self._open, node, sorted(topics))

    def _open(self, node: str, topics: List[str]) -> None:
        try:
            uri = ask_master("lookupNode", node)
            for topic in topics:
                self._opened.append((Source(topic, node), open_stream(topic, uri, rospy.get_name())))
        except (NodeError, OSError):
            self._failed.add(node)

    def take(self) -> List[TopicMessage]:
        """Return what has arrived since the last call."""
        now_ns = time.time_ns()
        taken = []
        for source, header, messages in self._streams.read():
            # Bytes of another definition than the one offered would be shown as wrong numbers.
            if header.get("md5sum") == self._md5.get(source.topic):
                latched_by = source.node if header.get("latching") == "1" else ""
                taken += [TopicMessage(source.topic, content, now_ns, latched_by) for content in messages]
        return taken
