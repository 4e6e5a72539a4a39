"""Every access of the driver to rospy's internals, each with its reason.

Sources: rospy 1.15 to 1.17 (impl/tcpros_base.py, impl/rosout.py, topics.py).
"""

import socket
import time
from types import SimpleNamespace
from typing import Any, Callable, FrozenSet, Optional, Tuple

import rosgraph
import rospy
from rospy.impl import registration, rosout, tcpros_pubsub

RECONNECT_PAUSE_S = 0.5
"""As rospy waits before it connects again; a publisher that breaks each connection costs no more than this."""

ROSOUT_LOGGER = "rosout"
"""The logger of rospy.loginfo() and the like."""


# Publishers and subscribers.


def keep_publishers_connected() -> None:
    """Connect again to publishers that rospy would overlook for ever; call it before rospy.init_node().

    rospy connects to an announced publisher unless it has a connection to that node. It keeps one that the publisher
    refused, and does not look again when one ends whose publisher has been replaced by another in the same program:
    every later publisher of that program would go unheard, its stops too.
    """
    connect = tcpros_pubsub.robust_connect_subscriber

    def connect_and_look_again(connection: Any, *arguments: Any) -> None:
        connect(connection, *arguments)
        _, _, uri, _, topic = arguments
        subscriber = registration.get_topic_manager().get_subscriber_impl(topic)
        if subscriber is None or rospy.is_shutdown():
            return
        if connection in subscriber.connections:
            subscriber.remove_connection(connection)
        time.sleep(RECONNECT_PAUSE_S)
        if tcpros_pubsub.check_if_still_publisher(topic, uri):
            for listener in registration.get_registration_listeners().listeners:
                if isinstance(listener, registration.RegManager):
                    listener.handler._connect_topic(topic, uri)

    tcpros_pubsub.robust_connect_subscriber = connect_and_look_again


NO_CONNECTIONS = SimpleNamespace(connections=())
"""Stands for what open_publisher() returns, where a topic is not registered."""


def open_publisher(name: str, raw_class: Any) -> Tuple[Any, Any]:
    """Register a topic, which may block; return its publisher, and what holds the `connections` of its subscribers.

    Any thread may read that list, which rospy replaces and never changes. With a queue rospy would start a thread for
    each subscriber, which costs as much as the rest of the driver.
    """
    publisher = rospy.Publisher(name, raw_class, queue_size=1, tcp_nodelay=True)
    publisher.impl.set_queue_size(None)
    return publisher, publisher.impl


def send(connection: Any, data: bytes) -> bytes:
    """Return what a socket did not take, where write_data() would wait; a broken connection takes all and is closed."""
    sock = connection.socket
    if sock is None:
        return b""
    try:
        sent = sock.send(data, socket.MSG_DONTWAIT)
    except (BlockingIOError, InterruptedError):
        return data
    except OSError:
        connection.close()
        return b""
    connection.stat_bytes += sent
    connection.stat_num_msg += 1
    return data[sent:]


def list_publishers(name: str, message_type: str) -> Optional[FrozenSet[str]]:
    """Register as a subscriber, before rospy does; return the URIs of publishers, None if unknown. May block."""
    try:
        uris = rosgraph.Master(rospy.get_name()).registerSubscriber(name, message_type, rospy.get_node_uri())
    except (rosgraph.MasterException, OSError):
        return None
    return frozenset(uris)


def is_latched_before(connection: Any, earlier: Optional[FrozenSet[str]]) -> bool:
    """Return whether the first message on a connection may have been latched before list_publishers() gave earlier."""
    return connection is not None and connection.is_latched and (earlier is None or connection.endpoint_id in earlier)


def find_connection(name: str, message: Any) -> Any:
    """Return a message's connection; None where rospy has to read it on, as for statistics (/enable_statistics)."""
    impl = registration.get_topic_manager().get_subscriber_impl(name)
    if impl is None or impl.statistics_logger is not None:
        return None
    for connection in impl.connections:
        if connection.header is message._connection_header:
            return connection
    return None


def read_caller(connection: Any) -> str:
    """Return the name of the node at the other end of a connection that find_connection() found; empty for None."""
    return "" if connection is None else str(connection.header.get("callerid", ""))


def replace_reading(connection: Any, read: Callable[[], Any]) -> None:
    """Make rospy's thread call read(), which raises at the end, once it has passed on what it has read."""
    connection.receive_once = read


def take_socket(connection: Any) -> Tuple[Any, bytes]:
    """Return a socket of one's own for a connection (None: closed), and the begun message that rospy has read.

    rospy may close its own at any time, and shuts the connection down with it, so that this one ends too.
    """
    sock, buffer = connection.socket, connection.read_buff
    if sock is None or buffer is None:
        return None, b""
    return sock.dup(), buffer.getvalue()[: buffer.tell()]


def count_read(connection: Any, length: int, messages: int) -> None:
    """Count what was read instead of rospy, for rosnode info and the like."""
    connection.stat_bytes += length
    connection.stat_num_msg += messages


def unregister(topic: Any) -> None:
    """Unregister a publisher or subscriber and give back its file; asks the ROS master, so it may block.

    rospy's poller refers to itself: a dozen files for each robot that left would stay open until a garbage collection.
    """
    impl = topic.impl
    topic.unregister()
    if impl is not None:
        # From here on rospy lets no connection in: it looks at impl.closed under the same lock.
        with impl.c_lock:
            impl.connection_poll.poller.close()


# Log lines.


def leave_topics_out_of_rosout() -> None:
    """Publish log lines on /rosout without the names of this node's topics, and without asking the ROS master.

    rospy puts all into each line, 2,400 with 100 robots, which keeps Python's one lock for milliseconds.
    """
    rosout.rospy = SimpleNamespace(names=rospy.names, get_param_cached=lambda *_: False, has_param=lambda _: False)
    rosout.get_topic_manager = lambda: SimpleNamespace(get_topics=list)


# The end.


def call_before_shutdown(call: Callable[[], None]) -> None:
    """Call when ROS wants this node to end, before its topics are closed: rospy.on_shutdown() comes after that."""
    rospy.core.add_preshutdown_hook(lambda reason: call())
