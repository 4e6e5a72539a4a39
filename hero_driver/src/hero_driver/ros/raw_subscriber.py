"""Subscribes to a topic and passes on raw messages, read by the event loop's thread.

Waking rospy's thread of each publisher, then that of the sockets, would cost several times what a command costs. rospy
registers, shakes hands and hands over the first message; then its thread rests, and the loop reads the publisher's
socket until it ends. After that rospy proceeds by its own rules: it closes, or it connects again.
"""

import fcntl
import functools
import math
import socket
import struct
import termios
import threading
from typing import Any, Callable, FrozenSet, Optional

import rospy
from rospy.exceptions import TransportException, TransportTerminated

from hero_node.ros_messages import LENGTH, TooLongError, find_messages

from ..transport.event_loop import EventLoop, Reader
from .rospy_internals import (
    count_read,
    find_connection,
    is_latched_before,
    list_publishers,
    replace_reading,
    take_socket,
    unregister,
)

READ_LENGTH = 4096
"""Read at once from one publisher: 78 velocities, so that one that floods does not delay the robots."""

BACKLOG_LENGTH = 262144
"""Read at once from a publisher of motion that is ahead: its sockets hold commands for more than a second."""

MESSAGE_LENGTH_MAX = 1 << 20
"""A robot takes messages of 4 kB; a publisher that announces more than this does not speak TCPROS."""

RESUMED_S = 0.5
"""After a pause of the driver rospy's threads pass on within this time what they held."""

_INT = struct.Struct("i")


class RawSubscriber:
    """The messages of one subscribed topic as bytes, read by the loop instead of by a thread of rospy for each."""

    def __init__(
        self,
        receive: Callable[[bytes], None],
        loop: EventLoop,
        on_sender_lost: Callable[[], None] = lambda: None,
        moves: bool = False,
    ) -> None:
        """receive(payload) is called on the loop's thread, on_sender_lost() when the newest one's publisher left.

        moves: of motion commands is_old is wanted, and of a publisher that is ahead only the newest of each read.
        """
        self.receive = receive
        self.on_sender_lost = on_sender_lost
        self.last_sender: Any = None  # connection of the newest message, where this module reads it
        self.is_old = False  # whether the newest message may be from before the subscription, or a pause of the driver
        self._name = ""
        self.moves = moves
        self._earlier: Optional[FrozenSet[str]] = frozenset()
        self._loop = loop
        self._subscriber: Any = None

    def open(self, name: str, raw_class: Any, queue_length: int) -> None:
        """Subscribe to the topic called name; asks the ROS master, so it may block."""
        self._name = name
        if self.moves:
            self._earlier = list_publishers(name, raw_class._type)
        self._subscriber = rospy.Subscriber(name, raw_class, self._take, queue_size=queue_length, tcp_nodelay=True)

    def close(self) -> None:
        """Unsubscribe; asks the ROS master. What the loop still reads is dropped, and ends by itself."""
        self.receive = lambda payload: None
        subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            unregister(subscriber)

    def _take(self, message: Any) -> None:
        """A message came through rospy, on the thread of its publisher's connection."""
        connection = find_connection(self._name, message)
        self._loop.call_soon(functools.partial(self.take, connection, message.data))
        if connection is not None:
            replace_reading(connection, functools.partial(self._hand_over, connection))

    def take(self, connection: Any, payload: bytes) -> None:
        """Pass on the first message that came on connection; on the loop's thread."""
        self.last_sender = connection
        self.is_old = is_latched_before(connection, self._earlier) or self._loop.has_resumed_within(RESUMED_S)
        self.receive(payload)

    def _hand_over(self, connection: Any) -> None:
        """Have the loop read connection; never return, but raise as rospy's own reading does when it ends."""
        sock, remainder = take_socket(connection)
        if sock is None:
            raise TransportTerminated("closed")
        stream = MessageStream(self, connection, sock, remainder)
        if self._loop.has_resumed_within(RESUMED_S):
            stream.resume()
        self._loop.add_reader(stream)
        stream.ended.wait()
        if stream.error is not None:
            raise TransportException(f"read failed: {stream.error}")
        # rospy 1.15.9 (Debian 11) would for ever try to connect again to a publisher that has ended.
        connection.close()
        raise TransportTerminated("closed")


class MessageStream(Reader):
    """The connection of one publisher, while the loop reads it."""

    def __init__(self, subscriber: RawSubscriber, connection: Any, sock: socket.socket, remainder: bytes) -> None:
        """connection is rospy's, for its statistics; remainder is the begun message that rospy has read."""
        self._subscriber = subscriber
        self._connection = connection
        self._socket = sock
        self._remainder = remainder
        self._old_length = -math.inf  # of what is still to be read; below 0: length of what was read behind it
        self._is_ahead = False
        self.ended = threading.Event()
        self.error: Optional[OSError] = None

    def fileno(self) -> int:
        return self._socket.fileno()

    def resume(self) -> None:
        """Take what the socket holds by now for old."""
        answer = bytearray(_INT.size)
        # How much can be read; its number is that of TIOCINQ (tcp(7)).
        fcntl.ioctl(self._socket.fileno(), termios.FIONREAD, answer)
        self._old_length = _INT.unpack(answer)[0]

    def read(self) -> bool:
        """Pass on the messages that have come; return whether the connection is still open."""
        try:
            data = self._socket.recv(BACKLOG_LENGTH if self._is_ahead else READ_LENGTH, socket.MSG_DONTWAIT)
        except (BlockingIOError, InterruptedError):
            return True
        except OSError as error:
            self.error = error
            return False
        if not data:
            return False
        length_read, messages = len(data), 0
        if self._remainder:
            data = self._remainder + data
        subscriber = self._subscriber
        newest_only, self._is_ahead = self._is_ahead, subscriber.moves and length_read >= READ_LENGTH
        newest: Optional[bytes] = None
        # A message that starts before it, behind its length, is old: also one that was begun, and is completed later.
        old_end = self._old_length + len(self._remainder) + LENGTH.size
        self._old_length -= length_read
        end = 0
        try:
            for start, end in find_messages(data, MESSAGE_LENGTH_MAX):
                subscriber.is_old = start < old_end
                messages += 1
                subscriber.last_sender = self._connection
                if newest_only and not subscriber.is_old:  # of old ones stops count, whatever came after them
                    newest = data[start:end]
                else:
                    subscriber.receive(data[start:end])
        except TooLongError:
            return False
        if newest is not None:
            subscriber.receive(newest)
        self._remainder = data[end:]
        count_read(self._connection, length_read, messages)
        return True

    def close(self) -> None:
        """End, and let the thread of rospy that waits in RawSubscriber end the connection."""
        self._socket.close()
        self.ended.set()
        if self._subscriber.last_sender is self._connection:
            self._subscriber.on_sender_lost()
