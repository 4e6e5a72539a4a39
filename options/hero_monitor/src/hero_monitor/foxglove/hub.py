"""Which client gets which topic: channels as topics appear and vanish, subscriptions, a queue per client. Pure."""

import json
from collections import defaultdict, deque
from typing import Any, Callable, DefaultDict, Deque, Dict, Iterable, List, NamedTuple, Optional, Set, Tuple, Union

from hero_node import shorten
from hero_node.parameters import is_whole_number

from ..serving.lesson import TEACHER, User
from .protocol import WARNING, Channel, describe_channel, encode_message, read_message

QUEUE_BYTES_MAX = 4_000_000
"""Queue limit of one client: about a second of a large swarm with a camera's images."""

SUBSCRIPTIONS_MAX = 10_000
PUBLISHED_MAX = 1_000

NO_PUBLISHING = "this server takes no messages: start the monitor with foxglove_publish:=true"


class TopicType(NamedTuple):
    """Type of a topic and its full definition."""

    name: str
    definition: str


class TopicMessage(NamedTuple):
    """A message as it arrived."""

    topic: str
    content: bytes
    time_ns: int
    latched_by: str
    """The publisher, if it latches the topic; empty otherwise."""


class Client:
    """One connection: its subscriptions, and what waits to be sent; beyond QUEUE_BYTES_MAX the oldest is dropped."""

    def __init__(self, send_text: Callable[[str], None], number: int = 0) -> None:
        """number: no other client's, and no page's."""
        self.send_text = send_text
        self.number = number
        self.published: Dict[int, Channel] = {}
        self.refusal = ""  # why the last message was refused; said once
        self.user, self.who = User("", TEACHER), "a Foxglove client"
        self.heard_ms = 0  # the monitor's clock, as the client had heard it when it sent what came last
        self.presses: Dict[str, Tuple[int, int]] = {}  # of robots that it drives (client_commands)
        self.subscriptions: Dict[int, Channel] = {}
        self._queue: Deque[bytes] = deque()
        self._queued_bytes = 0
        self._has_dropped = False

    def send(self, operation: str, **fields: Any) -> None:
        """Send a text of the protocol."""
        self.send_text(json.dumps({"op": operation, **fields}))

    def warn(self, text: str) -> None:
        """Send a line for the users of the client."""
        self.send("status", level=WARNING, message=text)

    def put(self, subscription: int, message: TopicMessage) -> None:
        """Queue a message for a subscription."""
        frame = encode_message(subscription, message.time_ns, message.content)
        self._queue.append(frame)
        self._queued_bytes += len(frame)
        while self._queued_bytes > QUEUE_BYTES_MAX and len(self._queue) > 1:
            self._queued_bytes -= len(self._queue.popleft())
            if not self._has_dropped:
                self._has_dropped = True
                self.warn("this client is slower than its topics: old messages are dropped")

    def take(self) -> List[bytes]:
        """Return all frames that wait, oldest first, and forget them."""
        frames = list(self._queue)
        self._queue.clear()
        self._queued_bytes = 0
        return frames


class Publisher(NamedTuple):
    """Receiver of clients' messages; all return at once."""

    open_client: Callable[[int], None]
    publish: Callable[[Client, str, str, bytes], str]
    """Takes topic, type and content of a message; returns why it is refused, empty if it is not."""
    close_client: Callable[[int], None]


class Hub:
    """All clients and channels."""

    def __init__(self, publisher: Optional[Publisher] = None) -> None:
        """publisher: takes messages of clients; None: they only read."""
        self._publisher = publisher
        self.clients: Set[Client] = set()
        self._channels: Dict[str, Channel] = {}
        self._latched: Dict[str, Dict[str, TopicMessage]] = {}
        self._next_id = 1

    @property
    def takes_messages(self) -> bool:
        """Return whether clients may publish."""
        return self._publisher is not None

    @property
    def wanted_topics(self) -> Set[str]:
        """Topics that a client subscribes to."""
        return {channel.topic for client in self.clients for channel in client.subscriptions.values()}

    def add(self, client: Client) -> None:
        """Greet a client."""
        self.clients.add(client)
        capabilities = ["clientPublish"] if self.takes_messages else []
        info = {"name": "hero_monitor", "metadata": {}, "supportedEncodings": ["ros1"], "capabilities": capabilities}
        client.send("serverInfo", **info)
        if self._channels:
            client.send("advertise", channels=list(map(describe_channel, self._channels.values())))
        if self._publisher is not None:
            self._publisher.open_client(client.number)

    def remove(self, client: Client) -> None:
        """Forget a client; may be called twice."""
        if client in self.clients and self._publisher is not None:
            self._publisher.close_client(client.number)
        self.clients.discard(client)

    def update_topics(self, topics: Dict[str, TopicType]) -> None:
        """Offer the topics that appeared, and withdraw those that vanished or changed their type."""
        gone = [known for known in self._channels.values() if topics.get(known.topic) != (known.type, known.definition)]
        for channel in gone:
            del self._channels[channel.topic]
            self._latched.pop(channel.topic, None)
            for client in self.clients:
                kept = {number: known for number, known in client.subscriptions.items() if known is not channel}
                client.subscriptions = kept
        new = []
        for topic in sorted(set(topics) - set(self._channels)):
            new.append(Channel(self._next_id, topic, *topics[topic]))
            self._channels[topic] = new[-1]
            self._next_id += 1
        for client in self.clients:
            if gone:
                client.send("unadvertise", channelIds=sorted(channel.id for channel in gone))
            if new:
                client.send("advertise", channels=list(map(describe_channel, new)))

    def receive(self, client: Client, message: Union[str, bytes]) -> None:
        """Carry out a client's request, or tell it why not."""
        if isinstance(message, bytes):
            refusal = self._pass_on(client, message)
        else:
            try:
                refusal = self._carry_out(client, json.loads(message))
            except (ValueError, TypeError, KeyError, RecursionError) as error:
                refusal = f"invalid request: {type(error).__name__}"
        if refusal:
            client.warn(refusal)

    def _carry_out(self, client: Client, request: Any) -> str:
        """Carry out a request as the protocol names its fields; return why not, empty if it is done.

        Raises: ValueError, TypeError or KeyError for other fields.
        """
        op = request["op"]
        if op == "subscribe":
            channels = {channel.id: channel for channel in self._channels.values()}
            pairs = [(each["id"], channels.get(each["channelId"])) for each in request["subscriptions"]]
            refused = [number for number, channel in pairs if not self._subscribe(client, number, channel)]
            return f"subscriptions refused: {shorten(refused)}" if refused else ""
        if op == "unsubscribe":
            for number in request["subscriptionIds"]:
                client.subscriptions.pop(number, None)
        elif self._publisher is None:
            return NO_PUBLISHING
        elif op == "advertise":
            for each in request["channels"]:
                topic, kind, encoding = (str(each[name]) for name in ("topic", "schemaName", "encoding"))
                if encoding != "ros1":
                    return f"{shorten(topic)}: this server takes messages as ros1, not as {shorten(encoding)}"
                if len(client.published) < PUBLISHED_MAX:
                    client.published[each["id"]] = Channel(each["id"], topic, kind, "")
        elif op == "unadvertise":
            for number in request["channelIds"]:
                client.published.pop(number, None)
        else:
            return f"this server does not know {shorten(op)}"
        return ""

    def _pass_on(self, client: Client, frame: bytes) -> str:
        """Pass a message on; return why not, said once."""
        channel_id, content = read_message(frame)
        channel = client.published.get(channel_id)
        if self._publisher is None:
            refusal = NO_PUBLISHING
        elif channel is None:
            refusal = "channel %d is not advertised" % channel_id
        else:
            refusal = self._publisher.publish(client, channel.topic, channel.type, content)
        is_said, client.refusal = refusal == client.refusal, refusal
        return "" if is_said else refusal

    def _subscribe(self, client: Client, number: Any, channel: Optional[Channel]) -> bool:
        is_free = is_whole_number(number, 0, 2**32 - 1) and number not in client.subscriptions
        if channel is None or not is_free or len(client.subscriptions) >= SUBSCRIPTIONS_MAX:
            return False
        client.subscriptions[number] = channel
        # ROS sends a latched message once per node: a later client gets it from here.
        for message in self._latched.get(channel.topic, {}).values():
            client.put(number, message)
        return True

    def deliver(self, messages: Iterable[TopicMessage]) -> None:
        """Queue messages for the clients that subscribe to their topics."""
        subscribers: DefaultDict[str, List[Tuple[Client, int]]] = defaultdict(list)
        for client in self.clients:
            for number, channel in client.subscriptions.items():
                subscribers[channel.topic].append((client, number))
        for message in messages:
            if message.topic not in self._channels:
                continue
            if message.latched_by:
                self._latched.setdefault(message.topic, {})[message.latched_by] = message
            for client, number in subscribers[message.topic]:
                client.put(number, message)

    def forget_latched(self) -> None:
        """Keep latched messages only of topics that are wanted; those of others will come anew with the topic."""
        wanted = self.wanted_topics
        self._latched = {topic: kept for topic, kept in self._latched.items() if topic in wanted}
