"""One conversation with one robot: bytes in and events out, commands in and packets out.

It asks for the robot's topics until it has them, answers its time requests, and never sends an undeclared topic id.
Time enters as `now_s` (monotonic) and `time_of_day_s` (ROS). A peer's mistake is a Problem event or a counter.
Source: ros_lib node_handle.h (negotiateTopics, requestSyncTime, spinOnce) and the stock robot as measured.
"""

import enum
import re
from dataclasses import dataclass, field
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple, Union

from hero_node import shorten
from hero_node.parameters import declare, number, whole_number

from . import packets, payloads
from .packets import Bytes, PacketReader, RosserialError, encode_packet
from .payloads import Log, PayloadError, TopicInfo

REQUEST_INTERVAL_S = 1.5
"""Time between two requests for topics while none were declared: the robot's boot takes 1.07 s (LEDStatus.ino:93)."""

TIME_WITHOUT_TOPICS_S = 0.2
"""Time limit for topics after a time request, which they follow at once (node_handle.h:301), or never."""

REPEAT_INTERVAL_S = 0.5
"""Time between two requests for topics when a peer proves that it runs but declared nothing."""

DATA_SILENCE_S = 5.0
"""A robot that has declared topics sends data 29 times in a second."""

UNCONFIGURED_S = 3.0
"""A robot that only logs for this long has lost its configuration (node_handle.h:193): a new request restores it."""

UNDECLARED_REPEATS = 5
"""Requests that undeclared ids may cause while the robot has declared something else."""

NAME_LENGTH_MAX = 128
"""Length limit of names of topics and types, bytes."""

# \Z, because $ would let a line break at the end through.
_MESSAGE_TYPE = re.compile(r"[a-zA-Z][a-zA-Z0-9_]*/[a-zA-Z][a-zA-Z0-9_]*\Z")
_MD5SUM = re.compile(r"[0-9a-f]{32}\Z")
_NAME = re.compile(r"[/~]?[a-zA-Z][a-zA-Z0-9_/]*\Z")


class TopicKind(enum.Enum):
    """Topic or service of a declared id, seen from the robot; the value is the id of the declaring packet."""

    PUBLISHER = packets.ID_PUBLISHER
    SUBSCRIBER = packets.ID_SUBSCRIBER
    SERVICE_ANSWERS = packets.ID_SERVICE_SERVER_PUBLISHER
    SERVICE_REQUESTS = packets.ID_SERVICE_SERVER_SUBSCRIBER

    @property
    def is_from_robot(self) -> bool:
        """Return whether the robot sends this id (else it receives it)."""
        return self in (TopicKind.PUBLISHER, TopicKind.SERVICE_ANSWERS)


_KIND_BY_PACKET_ID = {kind.value: kind for kind in TopicKind}


@dataclass
class Topic:
    """One declared id of this conversation; receive: what takes its payloads and their arrival (ns)."""

    info: TopicInfo
    kind: TopicKind
    receive: Callable[[bytes, int], None] = field(default=lambda *_: None, compare=False, repr=False)


class MessagesReceived(NamedTuple):
    """The robot sent payloads on topics that it declared: one event for all of a read, 200 messages per second."""

    messages: List[Tuple[Topic, bytes]]


class Problem(NamedTuple):
    """The robot sent something that cannot be used; text says what and why. Nothing else is affected."""

    text: str


class SessionEnded(NamedTuple):
    """The conversation is useless and should be closed; reason says why."""

    reason: str


Event = Union[MessagesReceived, Topic, Log, Problem, SessionEnded]
"""A Topic is one that the robot declared: new, or another than what it had declared under this id."""


@dataclass(frozen=True)
class SessionLimits:
    """Parameters that limit one peer."""

    max_topics: int = declare(whole_number(64, 1, 1000, "", "topic ids that one robot may declare"))
    max_payload_length: int = declare(whole_number(4096, 64, 65535, "bytes", "longest payload from a robot"))
    silence_timeout_s: float = declare(number(6.0, 3.0, 600.0, "s", "silence after which a connection is closed"))


class Session:
    """The state of one conversation, one per connection: topics by id, and outgoing packets for take_packets().

    last_receive_s: when a whole packet came last, or the conversation began.
    """

    def __init__(self, limits: SessionLimits, now_s: float) -> None:
        """Begin at now_s (monotonic), when the connection was opened; the robot is asked for its topics at once."""
        self.topics: Dict[int, Topic] = {}
        self._messages: Dict[int, Topic] = {}  # those of which messages come
        self._receivers: Dict[int, Topic] = {}  # those that the robot receives
        self.reader = PacketReader(limits.max_payload_length)
        self.undeclared_messages = 0
        self.opened_s = now_s
        self.last_receive_s = now_s
        self.listening_s = now_s  # since when silence counts: before that nothing could be received
        self._limits = limits
        self.outgoing: List[bytes] = []
        self._last_request_s: Optional[float] = None
        self._asks_again = False  # it has declared topics, but seems to have forgotten them
        self._request_due_s = now_s  # while it is asked
        self._undeclared_repeats = 0
        self._changes = 0
        self._requests = 0
        self._last_configured_s = now_s
        self._last_message_s = now_s
        self._lacks_data = False

    def receive_bytes(self, data: Bytes, now_s: float, time_of_day_s: float) -> List[Event]:
        """Return the events that data causes, in order. Never raises, whatever data holds."""
        received = self.reader.receive_pairs(data)
        if not received:
            return []
        self.last_receive_s = now_s
        topics = self._messages
        try:
            # Most reads hold messages only.
            messages = [(topics[topic_id], payload) for topic_id, payload in received]
        except KeyError:
            return self._receive_mixed(received, now_s, time_of_day_s)
        self._last_configured_s = self._last_message_s = now_s
        return [MessagesReceived(messages)]

    def _receive_mixed(self, received: List[Tuple[int, bytes]], now_s: float, time_of_day_s: float) -> List[Event]:
        events: List[Event] = []
        messages: Optional[List[Tuple[Topic, bytes]]] = None
        for topic_id, payload in received:
            # What came before in this read may have declared it.
            topic = self._messages.get(topic_id)
            if topic is not None:
                if messages is None:
                    messages = []
                    events.append(MessagesReceived(messages))
                    self._last_configured_s = self._last_message_s = now_s
                messages.append((topic, payload))
                continue
            try:
                event = self._receive_special(topic_id, payload, now_s, time_of_day_s)
            except PayloadError as error:
                event = Problem(str(error))
            if event is not None:
                events.append(event)
                messages = None
        return events

    def poll(self, now_s: float) -> List[Event]:
        """Do what is due by now_s; call it at least a few times per second."""
        silent_s = now_s - max(self.last_receive_s, self.listening_s)
        if silent_s > self._limits.silence_timeout_s:
            return [SessionEnded(f"silent for {silent_s:.1f} s: no whole packet came")]
        if (self._asks_again or not self.topics) and now_s >= self._request_due_s:
            self.outgoing.append(encode_packet(packets.ID_PUBLISHER, b""))
            self._last_request_s = now_s
            self._requests += 1
            self._request_due_s = now_s + REQUEST_INTERVAL_S
            self._asks_again = False
        return []

    def begins_to_lack_data(self) -> bool:
        """Return whether a robot that answers has now sent none of its topics for DATA_SILENCE_S; True once."""
        lacked, since_s = self._lacks_data, max(self._last_message_s, self.listening_s)
        self._lacks_data = bool(self._messages) and self.last_receive_s - since_s > DATA_SILENCE_S
        return self._lacks_data and not lacked

    def take_packets(self) -> List[bytes]:
        """Return the packets that the session itself wants to send, and forget them."""
        outgoing, self.outgoing = self.outgoing, []
        return outgoing

    def encode_message(self, topic_id: int, payload: Bytes) -> bytes:
        """Return the packet that sends payload to the robot.

        Raises: RosserialError unless this connection declared topic_id as received, with a buffer for the payload: the
        robot checks neither (node_handle.h:326, 232).
        """
        topic = self._receivers.get(topic_id)
        if topic is None:
            raise RosserialError("id %d was not declared as something that this robot receives" % topic_id)
        if len(payload) > topic.info.buffer_length:
            text = "%s: a message of %d bytes does not fit the robot's buffer of %d bytes"
            raise RosserialError(text % (topic.info.name, len(payload), topic.info.buffer_length))
        return encode_packet(topic_id, payload)

    def _receive_special(self, topic_id: int, payload: bytes, now_s: float, time_of_day_s: float) -> Optional[Event]:
        if topic_id in _KIND_BY_PACKET_ID:
            return self._declare(_KIND_BY_PACKET_ID[topic_id], payload)
        if topic_id == packets.ID_TIME:
            payloads.decode_time(payload)
            self._last_configured_s = now_s
            answer = payloads.encode_time(payloads.split_seconds(time_of_day_s))
            self.outgoing.append(encode_packet(packets.ID_TIME, answer))
            if not self.topics:
                due_s = now_s + TIME_WITHOUT_TOPICS_S
                # Only the first time is it the handshake of a boot; a peer may answer each request like this.
                self._ask_by(due_s if self._requests < 2 else max(due_s, self._earliest_repeat_s(now_s)))
            return None
        if topic_id == packets.ID_LOG:
            log = payloads.decode_log(payload)
            if not self.topics or now_s - self._last_configured_s > UNCONFIGURED_S:
                self._ask_by(self._earliest_repeat_s(now_s))
            return log
        if packets.ID_SERVICE_SERVER_SUBSCRIBER < topic_id < packets.ID_LOG:
            return Problem(f"sends a packet of kind {topic_id}; robots cannot use services or parameters of ROS")
        return self._receive_undeclared(topic_id, now_s)

    def _receive_undeclared(self, topic_id: int, now_s: float) -> Optional[Event]:
        self.undeclared_messages += 1
        if not self.topics:
            self._ask_by(self._earliest_repeat_s(now_s))
            return None
        if self._undeclared_repeats >= UNDECLARED_REPEATS or self._asks_again:
            return None
        self._undeclared_repeats += 1
        self._ask_by(self._earliest_repeat_s(now_s))
        return Problem("sends id %d, which it did not declare; asked again for its topics" % topic_id)

    def _earliest_repeat_s(self, now_s: float) -> float:
        return now_s if self._last_request_s is None else max(now_s, self._last_request_s + REPEAT_INTERVAL_S)

    def _ask_by(self, due_s: float) -> None:
        """Ask for the topics at due_s, or when that was to be done anyway: until there are some, and once more then."""
        if not self.topics or self._asks_again:
            due_s = min(due_s, self._request_due_s)
        self._request_due_s = due_s
        self._asks_again = bool(self.topics)

    def _declare(self, kind: TopicKind, payload: bytes) -> Optional[Event]:
        info = payloads.decode_topic_info(payload)
        fault = self._find_error(info)
        if fault is not None:
            return Problem(f"topic {shorten(info.name)} refused: {fault}")
        topic = Topic(info, kind)
        if self.topics.get(info.topic_id) == topic:
            return None
        if info.topic_id not in self.topics and len(self.topics) >= self._limits.max_topics:
            return Problem("topic %s refused: more than %d topics (max_topics)" % (info.name, self._limits.max_topics))
        if info.topic_id in self.topics:
            # A robot with other topics is one that was restarted, and that dials again.
            self._changes += 1
            if self._changes > self._limits.max_topics:
                text = "topic %s refused: ids were declared as something else more than %d times (max_topics)"
                return Problem(text % (info.name, self._limits.max_topics))
        for topics, holds in (
            (self.topics, True),
            (self._messages, kind.is_from_robot),
            (self._receivers, not kind.is_from_robot),
        ):
            topics.pop(info.topic_id, None)
            if holds:
                topics[info.topic_id] = topic
        return topic

    def _find_error(self, info: TopicInfo) -> Optional[str]:
        """Return what is wrong with a declaration, or None."""
        if len(info.name) > NAME_LENGTH_MAX:
            return "its name has %d characters, more than %d" % (len(info.name), NAME_LENGTH_MAX)
        if not _NAME.match(info.name) or "//" in info.name or info.name.endswith("/"):
            return "its name is not a ROS name"
        if len(info.message_type) > NAME_LENGTH_MAX or not _MESSAGE_TYPE.match(info.message_type):
            return f"its type {shorten(info.message_type)} is not of the form package/Type"
        if not _MD5SUM.match(info.md5sum):
            return f"its md5 {shorten(info.md5sum)} is not 32 hexadecimal digits"
        if info.topic_id < packets.FIRST_TOPIC_ID:
            return "its id %d is below %d" % (info.topic_id, packets.FIRST_TOPIC_ID)
        if info.buffer_length < 1:
            return "its buffer_size is %d" % info.buffer_length
        return None
