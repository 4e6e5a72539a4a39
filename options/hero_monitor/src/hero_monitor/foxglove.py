"""Program foxglove: live topics for Foxglove, Lichtblick and PlotJuggler, by Foxglove's own server (foxglove-sdk).

rosrun hero_monitor foxglove            on ws://127.0.0.1:8765; clients read and can send nothing
"""

from types import ModuleType
from typing import Any, Dict, NamedTuple, Optional, Set

import roslib.message
import rospy

from hero_node import NodeError, ProgramError, import_optional, run
from hero_node.parameters import string, whole_number
from hero_node.ros import Program, ask_master, read_parameters

PARAMETERS = {
    "host": string("127.0.0.1", "address on which it listens; there is no login"),
    "port": whole_number(8765, 1, 65535, "", "TCP port"),
}

LOOK_PERIOD_S = 0.5
"""Time between two looks for new topics, and for those that clients want."""

QUEUE_LENGTH = 100
WARN_PERIOD_S = 10.0


class Source(NamedTuple):
    """A topic that is offered: its type, the md5 sum of it that is known here, and the server's channel."""

    kind: str
    md5sum: str
    channel: Any


class TopicServer:
    """Offers all topics with a publisher, and subscribes to those that clients want; message bytes pass unread."""

    def __init__(self, sdk: ModuleType) -> None:
        """Begin without topics. sdk: the module foxglove."""
        self._sdk = sdk
        self._sources: Dict[str, Source] = {}
        self._subscribers: Dict[str, rospy.Subscriber] = {}
        self._latched: Dict[str, bytes] = {}
        self._joined: Set[str] = set()

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Note, on a thread of the server, that a client wants a topic."""
        self._joined.add(channel.topic)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """A client no longer wants a topic: the next look() sees it."""

    def look(self) -> None:
        """Offer new topics; subscribe to those that clients want, and unsubscribe from those that none does."""
        try:
            published = dict(ask_master("getPublishedTopics", ""))
        except NodeError:
            published = {topic: source.kind for topic, source in self._sources.items()}  # publishers work without it
        for topic, source in list(self._sources.items()):
            if published.get(topic) != source.kind:
                self._unsubscribe(topic)
                self._sources.pop(topic).channel.close()
        for topic in sorted(set(published) - set(self._sources)):
            offered = self._offer(topic, published[topic])
            if offered is not None:
                self._sources[topic] = offered
        for topic, source in self._sources.items():
            if not source.channel.has_sinks():
                self._unsubscribe(topic)
            elif topic not in self._subscribers:
                self._subscribers[topic] = rospy.Subscriber(
                    topic, rospy.AnyMsg, self._receive, topic, queue_size=QUEUE_LENGTH, tcp_nodelay=True
                )
        # What is latched comes once to a subscriber: clients that came later have not seen it.
        joined, self._joined = self._joined, set()
        for topic in joined & set(self._latched) & set(self._sources):
            self._sources[topic].channel.log(self._latched[topic])

    def _offer(self, topic: str, kind: str) -> Optional[Source]:
        """Return the source of a topic; None if its type is not known here."""
        message_class = roslib.message.get_message_class(kind)
        if message_class is None:
            return None
        schema = self._sdk.Schema(name=kind, encoding="ros1msg", data=message_class._full_text.encode())
        return Source(kind, message_class._md5sum, self._sdk.Channel(topic, schema=schema, message_encoding="ros1"))

    def _unsubscribe(self, topic: str) -> None:
        if topic in self._subscribers:
            self._subscribers.pop(topic).unregister()
            self._latched.pop(topic, None)

    def _receive(self, message: rospy.AnyMsg, topic: str) -> None:
        source, header = self._sources.get(topic), message._connection_header
        if source is None:
            return
        if header["md5sum"] not in (source.md5sum, "*"):
            text = "%s has another %s than this machine: it is not shown"
            rospy.logwarn_throttle_identical(WARN_PERIOD_S, text % (topic, source.kind))
            return
        if header.get("latching") == "1":
            self._latched[topic] = message._buff
        source.channel.log(message._buff)


def main() -> None:
    """Serve topics until the program is to end. Raises: ProgramError for a wrong parameter, or a port that is taken."""
    with Program("foxglove") as program:
        parameters = read_parameters(PARAMETERS)
        sdk = import_optional("foxglove", "foxglove-sdk")
        topics = TopicServer(sdk)
        place = {"host": parameters["host"], "port": parameters["port"]}
        try:
            server = sdk.start_server(name="ROS topics", server_listener=topics, **place)
        except RuntimeError as error:
            raise ProgramError("ws://{host}:{port} cannot be served: {error}".format(error=error, **place)) from None
        rospy.loginfo("topics for Foxglove, without a login: ws://{host}:{port}".format(**place))
        try:
            while program.sleep(LOOK_PERIOD_S):
                topics.look()
        finally:
            server.stop()


if __name__ == "__main__":
    run(main)
