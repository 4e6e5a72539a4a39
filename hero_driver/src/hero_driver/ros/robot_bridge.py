"""Turns a robot's declaration into a publisher, subscriber or service. ROS begins here.

    declare() -> _choose_publishers(), _subscribe() or _declare_service_half() -> Endpoints

Methods without a comment run on the thread of the sockets and never block; what needs the ROS master is a job for the
registrar. Endpoints stay up when the connection goes and are there again when the robot returns.
"""

import functools
from typing import Any, Callable, Dict, List, Optional, Set, Tuple

from hero_node.ros_messages import MD5SUMS

from ..commands.command_queue import CommandSettings
from ..commands.service_requests import is_success, read_set_odom_pose
from ..commands.velocity_shaper import STOP_PAYLOADS
from ..corrections import message_layouts
from ..corrections.correction_settings import CorrectionSettings
from ..corrections.robot_corrections import TRANSFORMS, RobotCorrections
from ..fleet.namespaces import Identity
from ..rosserial.session import Topic, TopicKind
from ..transport.call_queue import Worker
from ..transport.event_loop import EventLoop
from . import message_types
from .endpoints import QUEUE_LENGTH, Endpoints, Layout
from .log_relay import LogRelay
from .raw_publisher import RawPublisher, TransformPublisher
from .robot_commands import Owner, RobotCommands
from .services import RobotService

VELOCITY_CONTROLLER = "/velocity_controller/cmd_vel"
VELOCITY_ALIAS = "/cmd_vel"
"""Topic of teleop_twist_keyboard and the like, an alias of VELOCITY_CONTROLLER: the newest command wins."""

ENCODER_TYPE = "hero_msgs/Encoder"
TRANSFORM_TYPE = "tf2_msgs/TFMessage"
TWIST_TYPE = "geometry_msgs/Twist"
SET_ODOM_TYPE = "hero_msgs/SetOdom"


class RobotBridge:
    """The endpoints of one robot; ids: under which it receives topics and services now, by their names."""

    def __init__(
        self,
        identity: Identity,
        owner: Owner,
        loop: EventLoop,
        log: LogRelay,
        transforms: TransformPublisher,
        registrar: Worker,
        corrections: CorrectionSettings,
        commands: CommandSettings,
        max_names: int,
    ) -> None:
        """Begin without a connection: see attach(); max_names: topics and services of the robot over all of them."""
        self.identity = identity
        self.label = identity.namespace.lstrip("/")
        self.commands = RobotCommands(identity.namespace, owner, loop, log, commands)
        self._loop = loop
        self._service_timeout_s = commands.service_timeout_s
        self._max_names = max_names
        self._registrar = registrar
        self.endpoints = Endpoints(self.label, log.log_throttled)
        self._closed = False
        self._connection = 0
        self._publishers: Dict[str, RawPublisher] = {}
        self.corrections = RobotCorrections(identity.namespace, corrections, transforms.add)
        self._services: Dict[str, RobotService] = {}
        self._service_halves: Dict[Tuple[str, TopicKind], Topic] = {}
        self.ids: Dict[str, int] = {}
        self._layouts: Dict[str, Layout] = {}  # as declared last, of what the robot takes
        self._publisher_layouts: Dict[str, Layout] = {}  # and of what it sends
        self._names: Set[str] = set()

    # The connection's life.

    def attach(self, peer: Any) -> None:
        """A connection is open, a Peer; its topics are declared next."""
        self._connection += 1
        self.ids.clear()
        self._service_halves.clear()
        self.commands.attach(peer)

    def detach(self, reason: str) -> None:
        """The connection is closed; endpoints remain, pending calls fail now, pending commands are dropped."""
        self._connection += 1  # what waits for the ROS master is left out
        self.ids.clear()
        self.commands.detach()
        for service in list(self._services.values()):
            service.fail(reason)

    def close(self) -> None:
        """Take all endpoints down; safe to call twice."""
        if self._closed:
            return
        self._closed = True
        self.detach("the robot left")
        # This thread is the one that publishes: once it has let go of a publisher, that can be unregistered.
        # A job of the registrar may be opening another one right now, so it looks again.
        publishers = list(self._publishers.values())
        self._publishers.clear()
        released = [call for publisher in publishers for call in publisher.release()]
        self.endpoints.end()
        self._registrar.submit(lambda: self.endpoints.close(released, publishers), always=True)

    # From the robot.

    def declare(self, topic: Topic, name: str) -> None:
        """The robot declared topic, which is called name in ROS."""
        info, kind = topic.info, topic.kind
        if name not in self._names:
            if len(self._names) >= self._max_names:
                text = f"topic {name} refused: more than {len(self._names)} names (2 * max_topics)"
                self.endpoints.report_error("names", text)
                return
            self._names.add(name)
        ros_type = message_types.apply_aliases(info.message_type)
        convert = message_layouts.CONVERSIONS.get((ros_type, info.md5sum))
        layout = Layout(ros_type, (MD5SUMS[ros_type] if convert else info.md5sum,))
        if kind is TopicKind.PUBLISHER:
            if ros_type == ENCODER_TYPE:
                conflict = self.corrections.note_encoder(info.md5sum)
                if conflict:
                    self.endpoints.report_error("model", conflict)
            known, self._publisher_layouts[name] = self._publisher_layouts.get(name, layout), layout
            # Declared with another layout than before, so that its publisher is used no more.
            replaced = [self._publishers.pop(name)] if known != layout and name in self._publishers else []
            publishers = self._choose_publishers(topic, name, layout)
            if convert:
                receive, convert_payload = topic.receive, convert
                topic.receive = lambda payload, arrival_ns: receive(convert_payload(payload), arrival_ns)
            self._submit(lambda: self.endpoints.advertise(name, layout, publishers, replaced))
        elif kind is TopicKind.SUBSCRIBER:
            self._take_input(topic, name, layout, lambda: self._subscribe(name, layout))
        elif kind in (TopicKind.SERVICE_ANSWERS, TopicKind.SERVICE_REQUESTS):
            self._declare_service_half(topic, name)

    def _subscribe(self, name: str, layout: Layout) -> bool:
        """Subscribe to what the robot takes, and to its alias (job of the registrar); return whether it can be used."""
        make_subscriber = functools.partial(self.commands.make_subscriber, name, name)
        is_usable = self.endpoints.subscribe(name, layout, make_subscriber)
        alias = self.identity.namespace + VELOCITY_ALIAS
        if name != self.identity.namespace + VELOCITY_CONTROLLER or alias in self.ids:
            return is_usable
        if is_usable and layout.message_type == TWIST_TYPE:
            make_subscriber = functools.partial(self.commands.make_subscriber, name, alias)
            self.endpoints.subscribe(alias, layout._replace(is_alias=True), make_subscriber)
        else:
            self.endpoints.unsubscribe(alias)
        return is_usable

    def _take_input(self, topic: Topic, name: str, layout: Layout, register: Callable[[], bool]) -> None:
        """Pass on to the robot what is sent to name, once register(), a job, says that it can be used.

        It gets nothing before that where programs may still send what was declared under this name before.
        """
        connection, known = self._connection, self._layouts.get(name)
        self._layouts[name] = layout
        self.ids.pop(name, None)
        if known in (None, layout) and _has_known_layout(layout):
            self.ids[name] = topic.info.topic_id

        def settle(is_usable: bool) -> None:
            if connection != self._connection or self._layouts.get(name) != layout:
                return
            if not is_usable:
                self.ids.pop(name, None)
            elif name not in self.ids:
                self.ids[name] = topic.info.topic_id

        def do() -> None:
            is_usable = register()
            self._loop.call_soon(lambda: settle(is_usable))

        self._submit(do)

    def _choose_publishers(self, topic: Topic, name: str, layout: Layout) -> List[Tuple[str, str, RawPublisher]]:
        """Set up the way of a topic's messages; return the topics that they become, types and publishers."""
        ros_type = layout.message_type
        if not _has_known_layout(layout):
            text = "topic %s refused: its %s has md5 %s, but only %s can be read: flash firmware with that message"
            if ros_type == ENCODER_TYPE:
                text += "; odom is the robot's own estimate until then, which loses distance"
            known = [md5 for message_type, md5 in message_layouts.CONVERSIONS if message_type == ros_type]
            md5sums = " or ".join([MD5SUMS[ros_type], *known])
            self.endpoints.report_error(name, text % (name, topic.info.message_type, layout.md5sums[0], md5sums))
            return []
        if name == TRANSFORMS and ros_type != TRANSFORM_TYPE:
            text = f"topic /tf refused: its type is {ros_type}, not {TRANSFORM_TYPE}"
            self.endpoints.report_error(name, text)
            return []
        publishers = [
            (output, its_type, self._publishers.setdefault(output, RawPublisher(QUEUE_LENGTH, self._loop.call_later)))
            for output, its_type in self.corrections.list_outputs(name, ros_type)
        ]
        topic.receive = self.corrections.handler_for(name, ros_type, [publisher for _, _, publisher in publishers])
        return publishers

    def _declare_service_half(self, topic: Topic, name: str) -> None:
        self._service_halves[name, topic.kind] = topic
        requests = self._service_halves.get((name, TopicKind.SERVICE_REQUESTS))
        answers = self._service_halves.get((name, TopicKind.SERVICE_ANSWERS))
        if requests is None or answers is None:
            return
        if requests.info.message_type != answers.info.message_type:
            halves = f"{requests.info.message_type} and {answers.info.message_type}"
            self.endpoints.report_error(name, f"service {name} refused: its halves are {halves}")
            return
        ros_type = message_types.apply_aliases(requests.info.message_type)
        layout = Layout(ros_type, (requests.info.md5sum, answers.info.md5sum))
        service = self._services.get(name)
        if service is None or self._layouts.get(name) != layout:
            service = RobotService(name, ros_type, self._service_timeout_s, self.send_request, self._loop)
            self._services[name] = service
        known_service = service
        answers.receive = lambda payload, _: self._receive_answer(known_service, payload)
        self._take_input(requests, name, layout, lambda: self.endpoints.serve(name, layout, known_service.call))

    def send_request(self, service: RobotService, request: bytes) -> Optional[str]:
        """Send a request of one of the robot's services; return why it cannot be sent, None if it is on its way."""
        if self._services.get(service.name) is not service:
            return "the robot declared it with another type"
        if service.name not in self.ids:
            return "the robot is not connected"
        return self.commands.offer_request(service.name, service.service_type, request)

    def _receive_answer(self, service: RobotService, payload: bytes) -> None:
        request = service.receive_answer(payload)
        if request is not None and service.service_type == SET_ODOM_TYPE and is_success(payload):
            # The answer comes before the first reading of the counters that the robot has just zeroed.
            self.corrections.odometry.set_pose(read_set_odom_pose(request))

    def is_motion(self, name: str) -> bool:
        """Return whether messages on the topic called name move the robot."""
        return name in self._layouts and self._layouts[name].message_type in STOP_PAYLOADS

    # Jobs of the registrar; these may block.

    def _submit(self, job: Callable[[], None]) -> None:
        """Queue a job, to be dropped if the connection ends first: a robot that returns declares everything again."""
        connection = self._connection

        def run() -> None:
            if connection == self._connection:
                job()

        if not self._registrar.submit(run):
            self.endpoints.report_error("registrar", "too many topics wait for the ROS master; is it reachable?")


def _has_known_layout(layout: Layout) -> bool:
    """Return whether a layout of a type that is read or written here is the one that is known."""
    return layout.md5sums[0] == MD5SUMS.get(layout.message_type, layout.md5sums[0])
