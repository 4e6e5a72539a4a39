"""Which client gets which topic: channels as topics appear and vanish, subscriptions, a queue per client. Pure."""

import json
from collections import defaultdict, deque
from typing import Any, Callable, DefaultDict, Deque, Dict, Iterable, List, NamedTuple, Optional, Set, Tuple, Union

from hero_node import shorten
from hero_node.parameters import is_whole_number

from .protocol import WARNING, Channel, describe_channel, encode_message

QUEUE_BYTES_MAX = 4_000_000
"""Queue limit of one client: about a second of a large swarm with a camera's images."""

SUBSCRIPTIONS_MAX = 10_000


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

    def __init__(self, send_text: Callable[[str], None]) -> None:
        self.send_text = send_text
        self.refusal = ""  # of its last request; said once in a row
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


class Hub:
    """All clients and channels."""

    def __init__(self) -> None:
        self.clients: Set[Client] = set()
        self._channels: Dict[str, Channel] = {}
        self._latched: Dict[str, Dict[str, TopicMessage]] = {}
        self._next_id = 1

    @property
    def wanted_topics(self) -> Set[str]:
        """Topics that a client subscribes to."""
        return {channel.topic for client in self.clients for channel in client.subscriptions.values()}

    def add(self, client: Client) -> None:
        """Greet a client."""
        self.clients.add(client)
        client.send("serverInfo", name="hero_monitor", metadata={}, supportedEncodings=["ros1"], capabilities=[])
        if self._channels:
            client.send("advertise", channels=list(map(describe_channel, self._channels.values())))

    def remove(self, client: Client) -> None:
        """Forget a client; may be called twice."""
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
        try:
            refusal = self._carry_out(client, {"op": "publish"} if isinstance(message, bytes) else json.loads(message))
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            refusal = f"invalid request: {type(error).__name__}"
        if refusal and refusal != client.refusal:
            client.warn(refusal)
        client.refusal = refusal

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
        else:
            return f"{shorten(op)}: clients of this server only read"
        return ""

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
