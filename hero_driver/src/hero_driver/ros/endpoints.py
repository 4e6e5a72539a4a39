"""Registers the publishers, subscribers and services of one robot with the ROS master: jobs of the registrar.

What a robot declares again with another type or md5 is unregistered first: programs made for the previous one must
not reach the other.
"""

import functools
from typing import Any, Callable, Dict, NamedTuple, Optional, Sequence, Tuple

import rospy

from hero_node.ros_messages import MD5SUMS

from . import message_types
from .message_types import MessageTypeError
from .raw_publisher import RawPublisher
from .raw_subscriber import RawSubscriber

QUEUE_LENGTH = 50
"""Messages that wait for a slow subscriber, or for a slow robot: more than a second of odometry."""


class Layout(NamedTuple):
    """Declared type of a topic or service."""

    message_type: str
    md5sums: Tuple[str, ...]  # of a service: of its request and of its answer
    is_alias: bool = False  # not declared by the robot


class Endpoints:
    """The endpoints of one robot that are registered with the ROS master."""

    def __init__(self, label: str, log: Callable[[str, str, str], None]) -> None:
        """label is the robot's name in log lines; log(level, throttle key, text)."""
        self._label = label
        self._log = log
        self._open: Dict[Tuple[str, str], Tuple[Layout, Callable[[], None]]] = {}  # what closes each kind and name
        self._errors: Dict[str, str] = {}
        self._closed = False

    @property
    def last_error(self) -> str:
        """The newest problem about a declared topic that still holds, empty if there is none (any thread)."""
        return next(reversed(list(self._errors.values())), "")

    def report_error(self, name: str, text: str) -> None:
        """Log once what is wrong with a topic or service (any thread)."""
        if self._errors.get(name) != text:
            self._errors.pop(name, None)
            self._errors[name] = text
            self._log("error", self._label + name + text, f"{self._label}: {text}")

    def end(self) -> None:
        """Register nothing more (thread of the sockets); close() has to follow."""
        self._closed = True

    def advertise(
        self,
        name: str,
        layout: Layout,
        publishers: Sequence[Tuple[str, str, RawPublisher]],
        replaced: Sequence[RawPublisher],
    ) -> None:
        """Register the topics that the messages of a declared one become; what was there instead goes first."""
        for publisher in replaced:
            for call in publisher.release():
                call()
        message_class = self._find_class("topic", name, layout) if publishers else None
        if message_class is None:
            return
        for publisher_name, message_type, publisher in publishers:
            derived_class = message_class
            if message_type != layout.message_type:
                derived = Layout(message_type, (MD5SUMS[message_type],))
                derived_class = self._find_class("topic", publisher_name, derived)
            if derived_class is not None and not publisher.is_open:
                publisher.open(publisher_name, message_types.make_raw_class(derived_class))

    def subscribe(self, name: str, layout: Layout, make_subscriber: Callable[[str], RawSubscriber]) -> bool:
        """Subscribe to a topic with the subscriber that make_subscriber(type) gives; return whether it can be used."""

        def open_subscriber(message_class: Any) -> Callable[[], None]:
            subscriber = make_subscriber(message_class._type)
            subscriber.open(name, message_types.make_raw_class(message_class), QUEUE_LENGTH)
            return subscriber.close

        return self._register("topic", name, layout, open_subscriber)

    def unsubscribe(self, name: str) -> None:
        """Undo subscribe(); does nothing where there was none."""
        if ("topic", name) in self._open:
            self._open.pop(("topic", name))[1]()

    def serve(self, name: str, layout: Layout, call: Callable[[bytes], bytes]) -> bool:
        """Offer a service, whose answers call(request) gives; return whether it can be used."""

        def open_service(service_class: Any) -> Callable[[], None]:
            raw_class = message_types.make_raw_service(service_class)
            server = rospy.Service(name, raw_class, lambda request: raw_class._response_class(call(request.data)))
            return functools.partial(server.shutdown, "the robot left, or declared it with another type")

        return self._register("service", name, layout, open_service)

    def _register(self, kind: str, name: str, layout: Layout, open_it: Callable[[Any], Callable[[], None]]) -> bool:
        """Open what takes a topic or service, unless it is open; open_it(its class) returns what closes it again."""
        known = self._open.get((kind, name))
        if known is not None and known[0] != layout:
            del self._open[kind, name]
            known[1]()
        found = self._find_class(kind, name, layout)
        if found is not None and (kind, name) not in self._open:
            self._open[kind, name] = layout, open_it(found)
        return found is not None

    def close(self, released: Sequence[Callable[[], None]], publishers: Sequence[RawPublisher]) -> None:
        """Take everything down: what was released, and what a job before this one has opened of publishers."""
        calls = [*released, *(call for publisher in publishers for call in publisher.release())]
        calls += [close for _, close in self._open.values()]
        self._open.clear()
        for call in calls:
            try:
                call()
            except Exception as error:  # noqa: BLE001 - one that cannot be unregistered must not keep the others
                kind = type(error).__name__
                text = f"{self._label}: a topic or service could not be unregistered: {kind}: {error}"
                self._log("error", "unregister " + kind, text)

    def _find_class(self, kind: str, name: str, layout: Layout) -> Optional[Any]:
        """Return the class of a topic or service; None, after one clear problem, if it cannot be used."""
        if self._closed:
            return None
        find = message_types.find_service_class if kind == "service" else message_types.find_message_class
        try:
            found = find(layout.message_type, *layout.md5sums)
        except MessageTypeError as error:
            self.report_error(name, f"{kind} {name} refused: {error}")
            return None
        self._errors.pop(name, None)
        return found
