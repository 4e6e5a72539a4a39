"""The topics of one robot: the newest message of each, and commands that are not lost silently."""

import math
import threading
import time
from typing import Any, Callable, Dict, Iterable, Mapping, Optional, Tuple, Type

import rospy

from ..values.errors import StaleDataError

CONNECT_S = 3.0
"""A driver that has the robot connects to a new publisher within this time, mostly within 0.1 s; a command before
waits."""

POLL_PERIOD_S = 0.02
"""Time between two looks whether the driver has connected."""


class NewestMessages:
    """Subscriptions to a robot's topics, of which the newest message counts."""

    def __init__(self, namespace: str, message_classes: Mapping[str, Type[Any]]) -> None:
        """message_classes: of each topic below the robot's namespace."""
        self._namespace = namespace
        self._classes = message_classes
        self._newest: Dict[str, Tuple[float, Any]] = {}
        self._counts: Dict[str, int] = {}
        self._arrival = threading.Condition()
        self._subscribers: Dict[str, rospy.Subscriber] = {}

    def subscribe(self, topic: str) -> None:
        """Subscribe to a topic, unless that was done before."""
        if topic not in self._subscribers:
            name = f"{self._namespace}/{topic}"
            self._subscribers[topic] = rospy.Subscriber(
                name, self._classes[topic], self._receive_message, topic, queue_size=1, tcp_nodelay=True
            )

    def _receive_message(self, message: Any, topic: str) -> None:
        with self._arrival:
            self._newest[topic] = (time.monotonic(), message)
            self._counts[topic] = self._counts.get(topic, 0) + 1
            self._arrival.notify_all()

    def age_s(self, topic: str) -> float:
        """Return the seconds since the last message arrived; inf before the first."""
        newest = self._newest.get(topic)
        return math.inf if newest is None else time.monotonic() - newest[0]

    def read(self, topic: str) -> Any:
        """Return the newest message of a topic that has one."""
        return self._newest[topic][1]

    def wait_for_next(self, topic: str, timeout_s: float, count: int = 1) -> None:
        """Wait for the count-th message from now on. Raises: StaleDataError after timeout_s."""
        with self._arrival:
            wanted = self._counts.get(topic, 0) + count
            if not self._arrival.wait_for(lambda: self._counts.get(topic, 0) >= wanted, timeout_s):
                raise StaleDataError(f"no message on {self._namespace}/{topic} within {timeout_s:.1f} s")

    def find_silent(self, topics: Iterable[str], limit_s: float) -> Optional[str]:
        """Return the first of the subscribed topics without a message in the last limit_s; None if all have one."""
        return next((topic for topic in topics if topic in self._subscribers and self.age_s(topic) > limit_s), None)

    def close(self) -> None:
        """Unsubscribe; may be called twice."""
        for subscriber in self._subscribers.values():
            subscriber.unregister()
        self._subscribers = {}


class CommandTopic(rospy.SubscribeListener):
    """A topic on which a robot takes commands."""

    def __init__(self, name: str, message_class: Type[Any], explain_absence: Callable[[], str]) -> None:
        """explain_absence: tells users why nothing subscribes to the topic."""
        super().__init__()
        self.name = name
        self._explain_absence = explain_absence
        self._connect_deadline_s = time.monotonic() + CONNECT_S
        self._has_warned = False
        self._turn = threading.Lock()
        self._waiting: Optional[Any] = None
        self._timer: Optional[threading.Timer] = None
        self._publisher = rospy.Publisher(name, message_class, subscriber_listener=self, queue_size=1)

    @property
    def connected(self) -> bool:
        """Return whether anything subscribes to the topic: the driver does while it knows the robot."""
        return bool(self._publisher.get_num_connections() > 0)

    def publish(self, message: Any, is_stop: bool = False) -> None:
        """Send a command; returns at once. One without a subscriber is warned about, once until there is one again.

        In the first CONNECT_S after the start the newest command waits for the driver's subscription instead. An absent
        robot needs no stop: one is warned about only if it takes the place of a command that waits.
        """
        with self._turn:
            replaced, self._waiting = self._waiting, None
            is_lost = not self.connected and not is_stop
            if not self.connected and time.monotonic() < self._connect_deadline_s:
                self._waiting, is_lost = message, is_stop and replaced not in (None, message)
                if self._timer is None and not is_stop:
                    self._timer = threading.Timer(self._connect_deadline_s - time.monotonic(), self._give_up)
                    self._timer.daemon = True
                    self._timer.start()
            elif not rospy.is_shutdown():
                self._publisher.publish(message)
        if is_lost:
            self._warn()
        elif self.connected:
            self._has_warned = False

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Send the command that waited for this subscription; rospy calls it on its own thread."""
        with self._turn:
            if self._waiting is not None and not rospy.is_shutdown():
                self._publisher.publish(self._waiting)
            self._waiting = None

    def _give_up(self) -> None:
        with self._turn:
            is_lost, self._waiting = self._waiting is not None, None
        if is_lost:
            self._warn()

    def _warn(self) -> None:
        if not self._has_warned and not rospy.is_shutdown():
            self._has_warned = True
            rospy.logwarn("a command is lost: %s", self.describe_absence())

    def wait_until_connected(self) -> None:
        """Wait for the driver's subscription, in the first CONNECT_S after the start."""
        while not self.connected and time.monotonic() < self._connect_deadline_s and not rospy.is_shutdown():
            time.sleep(POLL_PERIOD_S)

    def describe_absence(self) -> str:
        """Return why there is no subscriber, for users."""
        return f"nothing subscribes to {self.name}: {self._explain_absence()}"
