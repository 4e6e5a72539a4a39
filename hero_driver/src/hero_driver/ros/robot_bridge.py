"""One robot's place in ROS: its publishers, subscribers and services. ROS begins here.

receive_message() and the other methods without a comment run on the thread of the sockets and never block;
what needs the ROS master is a job for the registrar. Endpoints stay up when the connection goes and are
there again when the robot returns.
"""

import functools
import math
import threading
import time
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Protocol, Set, Tuple

from ..commands.command_queue import CommandQueue
from ..commands.command_settings import CommandSettings
from ..commands.commander import Commanders
from ..commands.service_requests import find_request_error, is_success, read_set_odom_pose
from ..commands.velocity_shaper import STOP_PAYLOADS, check_motor_pulses, check_twist
from ..corrections import message_layouts
from ..corrections.robot_corrections import TRANSFORMS, CorrectionSettings, RobotCorrections
from ..fleet.namespaces import Identity
from ..robot_constants import MAX_WATCHDOG_S
from ..rosserial.session import Topic, TopicKind
from ..transport import EventLoop
from . import message_types
from .endpoints import QUEUE_LENGTH, Endpoints, Layout
from .log_relay import LogRelay
from .raw_publisher import RawPublisher
from .raw_subscriber import RawSubscriber
from .rospy_internals import read_caller
from .services import RobotService
from .transform_publisher import TransformPublisher
from .worker import Worker

VELOCITY_CONTROLLER = "/velocity_controller/cmd_vel"
VELOCITY_ALIAS = "/cmd_vel"
"""What teleop_twist_keyboard, move_base and the like publish on: the same commands as VELOCITY_CONTROLLER's, as if two
programs published on one topic. The newest command wins."""

MOTOR_TYPE = "hero_msgs/Motor"
TRANSFORM_TYPE = "tf2_msgs/TFMessage"
TWIST_TYPE = "geometry_msgs/Twist"
CALIBRATION_SUFFIX = "/pid_calibration"
SET_ODOM_TYPE = "hero_msgs/SetOdom"

LIGHT_SUFFIX = "/led"
NO_LIGHT = bytes(16)

TURNS_S = 1.0
"""A program that commands again so soon after another one has not ended; robots stop 2 s after the last command."""

TUNING_HEARD_S = 1.0
"""A robot that tunes itself logs up to 47 lines per second (VelocityControl.ino:118)."""


class BridgeOwner(Protocol):
    """What a bridge needs of the gateway, on the thread of the sockets."""

    stopped: bool
    """Whether all robots are stopped."""

    def send_commands(self, bridge: "RobotBridge") -> None:
        """Send the commands that wait in bridge.commands, as soon as the robot can take them."""

    def stop_robot(self, bridge: "RobotBridge") -> None:
        """Stop the bridge's robot."""


class BridgeContext(NamedTuple):
    """What all bridges share."""

    owner: BridgeOwner
    loop: EventLoop
    log: LogRelay
    transforms: TransformPublisher
    registrar: Worker
    corrections: CorrectionSettings
    commands: CommandSettings


class RobotBridge:
    """The endpoints of one robot."""

    def __init__(self, identity: Identity, context: BridgeContext) -> None:
        self.identity = identity
        self.label = identity.namespace.lstrip("/")
        self.commands = CommandQueue(context.commands.command_max_age_s, threading.Lock())
        self.light = NO_LIGHT
        self.refused_commands = 0
        self._owner = context.owner
        self._loop = context.loop
        self._log = context.log
        self._settings = context.commands
        self._registrar = context.registrar
        self._endpoints = Endpoints(self.label, context.log.log_throttled)
        self._closed = False
        self._connected = False
        self._connection = 0
        self._publishers: Dict[str, RawPublisher] = {}
        self.corrections = RobotCorrections(
            identity.namespace,
            context.corrections,
            self._publishers,
            context.transforms.add,
        )
        self._services: Dict[str, RobotService] = {}
        self._service_halves: Dict[Tuple[str, TopicKind], Topic] = {}
        self._ids: Dict[str, int] = {}
        self._layouts: Dict[str, Layout] = {}  # as declared last, of what the robot takes
        self._publisher_layouts: Dict[str, Layout] = {}  # and of what it sends
        self._commanders = Commanders(self.corrections.wheels)
        self._subscribers: Dict[str, RawSubscriber] = {}
        self._newest_sender: Any = None  # connection of the newest motion command, and the name of its node
        self._newest_node = ""
        self._superseded = ("", -math.inf)  # name of the node that commanded before, and until when
        self._tuning_heard_s = -math.inf
        self.was_told_to_tune = False
        self._names: Set[str] = set()
        self._subscribed_types: Dict[str, str] = {}

    # The connection's life.

    def attach(self) -> None:
        """A connection stands; its topics are declared next."""
        self._connection += 1
        self._ids.clear()
        self._service_halves.clear()
        self._commanders = Commanders(self.corrections.wheels)
        self.note_tuning(False)
        self._connected = True

    def detach(self, reason: str) -> None:
        """The connection is gone; endpoints stay, calls that wait fail now, commands that wait are dropped."""
        self._connected = False
        self._connection += 1  # what waits for the ROS master is left out
        self._ids.clear()
        self.commands.clear()
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
        self._endpoints.end()
        self._registrar.submit(lambda: self._endpoints.close(released, publishers), always=True)

    @property
    def last_error(self) -> str:
        """The newest problem about a declared topic that still holds, empty if there is none."""
        return self._endpoints.last_error

    # From the robot.

    def declare(self, topic: Topic, name: str) -> None:
        """The robot declared topic, which is called name in ROS."""
        info, kind = topic.info, topic.kind
        if name not in self._names:
            if len(self._names) >= self._settings.max_names:
                text = "topic %s refused: more than %d names (2 * max_topics)" % (name, len(self._names))
                self._endpoints.report_error("names", text)
                return
            self._names.add(name)
        ros_type = message_types.apply_aliases(info.message_type)
        layout = Layout(ros_type, (info.md5sum,))
        if kind is TopicKind.PUBLISHER:
            replaced = self._replace_publisher(name, layout)
            publishers = self._choose_publishers(topic, name, layout)
            self._submit(lambda: self._endpoints.advertise(name, layout, publishers, replaced))
        elif kind is TopicKind.SUBSCRIBER:
            self._subscribed_types[name] = ros_type
            self._take_input(topic, name, layout, lambda: self._subscribe(name, layout))
        elif kind in (TopicKind.SERVICE_ANSWERS, TopicKind.SERVICE_REQUESTS):
            self._declare_service_half(topic, name)

    def _subscribe(self, name: str, layout: Layout) -> bool:
        """Subscribe to what the robot takes, and to its alias (job of the registrar); return whether it can be used."""
        is_usable = self._endpoints.subscribe(name, layout, functools.partial(self._make_subscriber, name, name))
        alias = self.identity.namespace + VELOCITY_ALIAS
        if name != self.identity.namespace + VELOCITY_CONTROLLER or alias in self._ids:
            return is_usable
        if is_usable and layout.message_type == TWIST_TYPE:
            make_subscriber = functools.partial(self._make_subscriber, name, alias)
            self._endpoints.subscribe(alias, layout._replace(is_alias=True), make_subscriber)
        else:
            self._endpoints.unsubscribe(alias)
        return is_usable

    def _take_input(self, topic: Topic, name: str, layout: Layout, register: Callable[[], bool]) -> None:
        """The robot takes what is sent to name; register() is a job that tells whether that can be used.

        It gets nothing before that where programs may still send what was declared under this name before.
        """
        connection, known = self._connection, self._layouts.get(name)
        self._layouts[name] = layout
        self._ids.pop(name, None)
        if known in (None, layout) and _has_known_layout(layout):
            self._ids[name] = topic.info.topic_id

        def settle(is_usable: bool) -> None:
            if connection != self._connection or self._layouts.get(name) != layout:
                return
            if not is_usable:
                self._ids.pop(name, None)
            elif name not in self._ids:
                self._ids[name] = topic.info.topic_id

        def do() -> None:
            is_usable = register()
            self._loop.call_soon(lambda: settle(is_usable))

        self._submit(do)

    def _replace_publisher(self, name: str, layout: Layout) -> List[RawPublisher]:
        """Return the publisher of a topic that is declared with another layout than before; it is used no more."""
        known, self._publisher_layouts[name] = self._publisher_layouts.get(name, layout), layout
        return [self._publishers.pop(name)] if known != layout and name in self._publishers else []

    def _choose_publishers(self, topic: Topic, name: str, layout: Layout) -> List[Tuple[str, RawPublisher]]:
        """Set up the way of a topic's messages; return the topics that they become, with their publishers."""
        ros_type = layout.message_type
        if not _has_known_layout(layout):
            # The registrar will refuse it with both md5s.
            return []
        if name == TRANSFORMS:
            if ros_type != TRANSFORM_TYPE:
                text = "topic /tf refused: its type is %s, not %s" % (ros_type, TRANSFORM_TYPE)
                self._endpoints.report_error(name, text)
            else:
                topic.receive = self.corrections.handler_for(name, ros_type)
            return []
        derived = self.corrections.derive_topics(name, ros_type)
        for publisher_name in (name, *derived):
            self._publishers.setdefault(publisher_name, RawPublisher(QUEUE_LENGTH, self._loop.call_later))
        topic.receive = self.corrections.handler_for(name, ros_type)
        return [(publisher_name, self._publishers[publisher_name]) for publisher_name in (name, *derived)]

    def _declare_service_half(self, topic: Topic, name: str) -> None:
        self._service_halves[name, topic.kind] = topic
        requests = self._service_halves.get((name, TopicKind.SERVICE_REQUESTS))
        answers = self._service_halves.get((name, TopicKind.SERVICE_ANSWERS))
        if requests is None or answers is None:
            return
        if requests.info.message_type != answers.info.message_type:
            self._endpoints.report_error(
                name,
                "service %s refused: its halves are %s and %s"
                % (name, requests.info.message_type, answers.info.message_type),
            )
            return
        ros_type = message_types.apply_aliases(requests.info.message_type)
        layout = Layout(ros_type, (requests.info.md5sum, answers.info.md5sum))
        service = self._services.get(name)
        if service is None or self._layouts.get(name) != layout:
            service = self._make_service(name, ros_type)
        known_service = service
        answers.receive = lambda payload, _: self._receive_answer(known_service, payload)
        self._take_input(requests, name, layout, lambda: self._endpoints.serve(name, layout, known_service.call))

    def _make_service(self, name: str, ros_type: str) -> RobotService:
        def send(request: bytes) -> Optional[str]:
            if self._services.get(name) is not service:
                return "the robot declared it with another type"
            return self._send_request(name, ros_type, request)

        loop, timeout_s = self._loop, self._settings.service_timeout_s
        service = self._services[name] = RobotService(name, ros_type, timeout_s, send, loop.ask, loop.call_later)
        return service

    def _receive_answer(self, service: RobotService, payload: bytes) -> None:
        request = service.receive_answer(payload)
        if request is not None and service.service_type == SET_ODOM_TYPE and is_success(payload):
            # The answer comes before the first reading of the counters that the robot has just zeroed.
            self.corrections.set_pose(read_set_odom_pose(request))

    # To the robot.

    def find_id(self, name: str) -> Optional[int]:
        """Return the id under which the robot receives the topic or service called name."""
        return self._ids.get(name)

    def is_motion(self, name: str) -> bool:
        """Return whether messages on the topic called name move the robot."""
        return self._subscribed_types.get(name) in STOP_PAYLOADS

    def forget_motion(self) -> None:
        """Drop the motion commands that wait: the robot is being stopped."""
        self._commanders.stop()
        self.commands.discard_motion(time.monotonic())

    def resume(self, now_s: float) -> None:
        """The driver runs again after a pause: what waits is old, and silence counts from now on."""
        self.commands.discard_motion(now_s)
        self._commanders.forgive_silence(now_s)

    @property
    def is_commanded(self) -> bool:
        """Whether a program has asked for motion, and not for a stop, since the last forget_motion()."""
        return self._commanders.are_moving

    def watch_commanders(self, now_s: float) -> None:
        """Stop the robot if it missed a zero, or if a program that commands it regularly has fallen silent."""
        if self._commanders.is_zero_missed(now_s):
            self._owner.stop_robot(self)
        silent = self._commanders.find_silent(self._settings.silent_stop_s, now_s)
        if silent is not None and self._settings.silent_stop_s > 0.0:
            silence_s = now_s - silent.commanded_s
            text = "%s is stopped: %s, which commands it regularly, has been silent for %.1f s (~silent_stop_s)"
            self._log.log_throttled(
                "warn", "silent " + self.label, text % (self.label, silent.node or "a program", silence_s)
            )
            self._owner.stop_robot(self)

    # Self-tuning.

    def note_tuning(self, tunes: bool) -> None:
        """The robot said that it tunes itself, or it is known that it has ended that."""
        self._tuning_heard_s = time.monotonic() if tunes else -math.inf
        self.was_told_to_tune = self.was_told_to_tune and tunes

    def tunes(self, now_s: float) -> bool:
        """Return whether the robot tunes itself, as far as its log and the calls to its services tell."""
        return self.was_told_to_tune or now_s - self._tuning_heard_s < TUNING_HEARD_S

    # A ROS program sent a message for the robot.

    def _make_subscriber(self, name: str, source: str, ros_type: str) -> RawSubscriber:
        """Return the subscriber to source, which is name or an alias of it."""
        receive = self._choose_receiver(name, source, ros_type)
        subscriber = RawSubscriber(
            receive, self._loop, functools.partial(self._lose_sender, name, source), ros_type in STOP_PAYLOADS
        )
        self._subscribers[source] = subscriber
        return subscriber

    def _choose_receiver(self, name: str, source: str, ros_type: str) -> Callable[[bytes], None]:
        """Return what takes the messages of a topic that the robot subscribes to."""
        stop_payload = STOP_PAYLOADS.get(ros_type)
        if stop_payload is None:
            return functools.partial(self._receive_command, name)
        check: Callable[[bytes], Optional[bytes]] = check_motor_pulses
        if ros_type != MOTOR_TYPE:
            check = functools.partial(check_twist, clamp=self._settings.clamp)
        return functools.partial(self._receive_motion, name, source, check, stop_payload)

    def _receive_motion(
        self,
        name: str,
        source: str,
        check: Callable[[bytes], Optional[bytes]],
        stop_payload: bytes,
        payload: bytes,
    ) -> None:
        command = check(payload)
        if command is None:
            self.refused_commands += 1
            self._log.log_throttled(
                "warn",
                source,
                "%s: a command on %s is not finite and was refused; correct the program that sends it"
                % (self.label, source),
            )
            if self._commanders.find(name) is not None or self.tunes(time.monotonic()):
                # It must not go on with what it was told before.
                self._owner.stop_robot(self)
            return
        moves, subscriber = command != stop_payload, self._subscribers[source]
        if moves and subscriber.is_old:
            self.refused_commands += 1
            self._log.log_throttled(
                "warn",
                "old " + source,
                "%s: a command on %s was refused, because it may be from before the robot, or the driver, was there"
                " or ran; send it again" % (self.label, source),
            )
        elif not self._connected or (moves and self._owner.stopped):
            self.refused_commands += 1
        else:
            now_s = time.monotonic()
            sender = subscriber.last_sender
            if sender is not self._newest_sender:
                self._change_sender(sender, now_s)
            commander = self._commanders.note_command(name, source, sender, self._newest_node, moves, now_s)
            if not moves and (self.tunes(now_s) or self._commanders.has_more_to_stop(commander, now_s)):
                self._owner.stop_robot(self)
                return
            self.commands.offer_motion(name, command, stop_payload, now_s)
            self._owner.send_commands(self)

    def _change_sender(self, sender: Any, now_s: float) -> None:
        """Another connection brings the newest command: warn if two programs take turns, not one follows another."""
        before, after = self._newest_node, read_caller(sender)
        self._newest_sender, self._newest_node = sender, after
        if not before or not after or before == after:
            return
        if after == self._superseded[0] and now_s - self._superseded[1] < TURNS_S:
            self._log.log_throttled(
                "warn",
                "two programs " + self.label,
                "%s is commanded by %s and %s at once and obeys the newest command: end one of them"
                % (self.label, *sorted((before, after))),
            )
        self._superseded = before, now_s

    def _lose_sender(self, name: str, source: str) -> None:
        """The program that sent the newest command on source has gone (thread of the sockets)."""
        commander = self._commanders.find(name)
        if commander is None or commander.source != source:
            return
        if time.monotonic() - commander.commanded_s > MAX_WATCHDOG_S:
            return

        def stop_orphan() -> None:
            # Any newer command is another commander's.
            if self._commanders.find(name) is commander:
                self._owner.stop_robot(self)

        self._loop.call_later(self._settings.orphan_stop_s, stop_orphan)

    def _receive_command(self, name: str, payload: bytes) -> None:
        if not self._connected:
            self.refused_commands += 1
            return
        if name.endswith(LIGHT_SUFFIX) and len(payload) == len(NO_LIGHT):
            self.light = payload
        self.commands.offer(name, payload)
        self._owner.send_commands(self)

    def _send_request(self, name: str, service_type: str, request: bytes) -> Optional[str]:
        """Send a service request; return why not, if so."""
        fault = find_request_error(service_type, request)
        if fault is not None:
            return fault
        if not self._connected or name not in self._ids:
            return "the robot is not connected"
        if name.endswith(CALIBRATION_SUFFIX):
            if not self._settings.allow_self_tuning:
                return (
                    "self-tuning spins the robot for up to a minute and finds no gains that the firmware keeps; measure"
                    " them with hero_calibration calibrate, or set ~allow_self_tuning"
                )
            if self._owner.stopped:
                return "it moves the robot, and all robots are stopped (~stop)"
            self.was_told_to_tune = True
        self.commands.offer(name, request)
        self._owner.send_commands(self)
        return None

    # Jobs of the registrar; these may block.

    def _submit(self, job: Callable[[], None]) -> None:
        """Queue a job, to be dropped if the connection ends first: a robot that returns declares everything again."""
        connection = self._connection

        def run() -> None:
            if connection == self._connection:
                job()

        if not self._registrar.submit(run):
            self._endpoints.report_error("registrar", "too many topics wait for the ROS master; is it reachable?")


def _has_known_layout(layout: Layout) -> bool:
    """Return whether a layout of a type that is read or written here is the one that is known."""
    return layout.md5sums[0] == message_layouts.MD5SUMS.get(layout.message_type, layout.md5sums[0])
