"""Commands on their way to one robot, from subscribers to its queue; which program moves it, and whether it still does.

make_subscriber() -> _receive_motion() or _receive_command() -> CommandQueue
"""

import functools
import math
import time
from typing import Any, Callable, Dict, List, Optional, Protocol

from hero_node.robot_constants import MAX_WATCHDOG_S

from ..commands.command_queue import CommandQueue, CommandSettings
from ..commands.command_sources import CommandSources
from ..commands.service_requests import find_request_error
from ..commands.stop_progress import StopState
from ..commands.velocity_shaper import STOP_PAYLOADS, check_motor_pulses, check_twist
from ..corrections.wheel_motion import WheelMotion
from ..transport.event_loop import EventLoop
from .log_relay import LogRelay
from .raw_subscriber import RawSubscriber
from .rospy_internals import read_caller

MOTOR_TYPE = "hero_msgs/Motor"
CALIBRATION_SUFFIX = "/pid_calibration"

LIGHT_SUFFIX = "/led"
NO_LIGHT = bytes(16)

SUPERSEDED_S = 1.0
"""A program that commands again so soon after another one has not ended; robots stop 2 s after the last command."""

TUNING_SILENCE_S = 1.0
"""A robot that tunes itself logs up to 47 lines per second (VelocityControl.ino:118)."""

Stops = List[Optional[StopState]]
"""State of each connection that can move a robot, and None for each robot that is away."""


class Owner(Protocol):
    """Interface of the gateway for stops and commands, on the thread of the sockets; each peer is a Peer."""

    stopped: bool
    """True if all robots are stopped until they are released."""

    def stop_robot(self, peer: Any) -> None:
        """Stop the robot of a connection."""

    def warn_robot(self, peer: Any, text: str) -> None:
        """Log what is wrong with a robot."""

    def warn_late(self) -> None:
        """Log that what robots send is read too late to tell what they do, if that is this PC's doing."""

    def report_bug(self, error: Exception) -> None:
        """Log a bug of the driver itself."""

    def note_change(self) -> None:
        """A robot's state changed."""

    def set_stopped(self, stopped: bool) -> None:
        """Stop all robots until they are released, or release them."""

    def list_stops(self) -> Stops:
        """Return the stops of all robots."""


class RobotCommands:
    """The commands of all programs to one robot: the queue of those that wait, and how many were refused.

    Attributes:
        fault: what is wrong with how the robot is commanded now; empty if nothing is.
        light: the color (std_msgs/ColorRGBA) that its light was given last.
        was_told_to_tune: whether a program called the service that starts its self-tuning.
    """

    def __init__(self, namespace: str, owner: Owner, loop: EventLoop, log: LogRelay, settings: CommandSettings) -> None:
        """Begin without a connection: see attach(); namespace: of the robot."""
        self.queue = CommandQueue(settings.command_max_age_s)
        self.refused = 0
        self.fault = ""
        self.light = NO_LIGHT
        self.was_told_to_tune = False
        self._may_tune = False  # since the last stop a program has called that service
        self._label = namespace.lstrip("/")
        self._owner = owner
        self._loop = loop
        self._log = log
        self._settings = settings
        self._peer: Any = None  # the robot's connection, a Peer
        self._commanders = CommandSources(WheelMotion())
        self._subscribers: Dict[str, RawSubscriber] = {}
        self._newest_sender: object = None  # connection of the newest motion command, and the name of its node
        self._newest_node = ""
        self._superseded = ("", -math.inf)  # name of the node that commanded before, and until when
        self._tuning_heard_s = -math.inf

    # The robot's connection.

    def attach(self, peer: Any) -> None:
        """The robot is connected by peer, whose wheels show whether it moves."""
        self._commanders = CommandSources(peer.wheels)
        self.note_tuning(False)
        self._peer = peer

    def detach(self) -> None:
        """The robot is away; what waits is dropped."""
        self._peer = None
        self.queue.clear()

    # From a program.

    def make_subscriber(self, name: str, source: str, ros_type: str) -> RawSubscriber:
        """Return the subscriber to source, which is name, a topic that the robot subscribes to, or an alias of it."""
        receive = self.choose_receiver(name, source, ros_type)
        subscriber = RawSubscriber(
            receive, self._loop, functools.partial(self._lose_sender, name, source), moves=ros_type in STOP_PAYLOADS
        )
        self._subscribers[source] = subscriber
        return subscriber

    def choose_receiver(self, name: str, source: str, ros_type: str) -> Callable[[bytes], None]:
        """Return what takes the messages of ros_type that come on the ROS topic source, for the topic called name."""
        stop_payload = STOP_PAYLOADS.get(ros_type)
        if stop_payload is None:
            return functools.partial(self._receive_command, name)
        check = check_motor_pulses if ros_type == MOTOR_TYPE else check_twist
        return functools.partial(self._receive_motion, name, source, check, stop_payload)

    def _receive_motion(
        self, name: str, source: str, check: Callable[[bytes], Optional[bytes]], stop_payload: bytes, payload: bytes
    ) -> None:
        command = check(payload)
        if command is None:
            self.refused += 1
            text = (
                f"{self._label}: a command on {source} is not finite and was refused; correct the program that sends it"
            )
            self._log.log_throttled("warn", source, text)
            if self._commanders.find(name) is not None or self.tunes(time.monotonic()):
                # It must not continue its previous command.
                self._stop_robot()
            return
        moves, subscriber = command != stop_payload, self._subscribers[source]
        if moves and subscriber.is_old:
            self.refused += 1
            text = f"{self._label}: a command on {source} was refused, because it may be from before the robot, or the"
            self._log.log_throttled("warn", "old " + source, text + " driver, was there or ran; send it again")
        elif self._peer is None or (moves and self._owner.stopped):
            self.refused += 1
        else:
            now_s = time.monotonic()
            sender = subscriber.last_sender
            if sender is not self._newest_sender:
                self._change_sender(sender, now_s)
            commander = self._commanders.note_command(name, source, sender, self._newest_node, moves, now_s)
            if not moves and (self.tunes(now_s) or self._commanders.needs_another_stop(commander, now_s)):
                self._stop_robot()
                return
            self.queue.offer_motion(name, command, stop_payload, now_s)
            self._peer.send_commands()

    def _change_sender(self, sender: object, now_s: float) -> None:
        """Another connection brings the newest command: warn if two programs take turns, not one follows another."""
        before, after = self._newest_node, read_caller(sender)
        self._newest_sender, self._newest_node = sender, after
        if not before or not after or before == after:
            return
        if after == self._superseded[0] and now_s - self._superseded[1] < SUPERSEDED_S:
            text = "%s is commanded by %s and %s at once and obeys the newest command: end one of them"
            names = (self._label, *sorted((before, after)))
            self._log.log_throttled("warn", "two programs " + self._label, text % names)
        self._superseded = before, now_s

    def _receive_command(self, name: str, payload: bytes) -> None:
        if self._peer is None:
            self.refused += 1
            return
        if name.endswith(LIGHT_SUFFIX) and len(payload) == len(NO_LIGHT):
            self.light = payload
        self.queue.offer(name, payload)
        self._peer.send_commands()

    def offer_request(self, name: str, service_type: str, request: bytes) -> Optional[str]:
        """Take a request of a service; return why it cannot be sent, if so."""
        fault = find_request_error(service_type, request)
        if fault is not None:
            return fault
        if name.endswith(CALIBRATION_SUFFIX):
            if not self._settings.allow_self_tuning:
                text = "self-tuning spins the robot for up to a minute and finds no gains that the firmware keeps;"
                return text + " measure them with hero_calibration calibrate, or set ~allow_self_tuning"
            if self._owner.stopped:
                return "it moves the robot, and all robots are stopped (~stop)"
            self.was_told_to_tune = self._may_tune = True
        self.queue.offer(name, request)
        self._peer.send_commands()
        return None

    def _lose_sender(self, name: str, source: str) -> None:
        """The program that sent the newest command on source has disconnected."""
        commander = self._commanders.find(name)
        if commander is None or commander.source != source:
            return
        if time.monotonic() - commander.commanded_s > MAX_WATCHDOG_S:
            return

        def stop_orphan() -> None:
            # Any newer command is another commander's.
            if self._commanders.find(name) is commander:
                self._stop_robot()

        self._loop.call_later(self._settings.orphan_stop_s, stop_orphan)

    def _stop_robot(self) -> None:
        if self._peer is not None:
            self._owner.stop_robot(self._peer)

    # From the driver.

    def stop(self) -> None:
        """Drop the motion commands that wait: the robot is being stopped."""
        self._commanders.stop()
        self._may_tune = False
        self.queue.discard_motion(time.monotonic())

    @property
    def is_commanded(self) -> bool:
        """Return whether a program has asked for motion, and not for a stop, since the last stop()."""
        return self._commanders.are_moving or self._may_tune

    def watch_commanders(self, now_s: float) -> None:
        """Stop the robot if it missed a zero, or if a program that commands it regularly has fallen silent."""
        if self._commanders.is_zero_missed(now_s):
            self._stop_robot()
        silent = self._commanders.find_silent(self._settings.silent_stop_s, now_s)
        if silent is not None and self._settings.silent_stop_s > 0.0:
            silence_s = now_s - silent.commanded_s
            text = "%s is stopped: %s, which commands it regularly, has been silent for %.1f s (~silent_stop_s)"
            self._log.log_throttled(
                "warn", "silent " + self._label, text % (self._label, silent.node or "a program", silence_s)
            )
            self._stop_robot()
        self.fault = self._commanders.find_fault(now_s)
        if self.fault:
            self._log.log_throttled("warn", "fault " + self._label, f"{self._label}: {self.fault}")

    # Self-tuning.

    def note_tuning(self, tunes: bool) -> None:
        """The robot said that it tunes itself, or it is known that it has ended that."""
        self._tuning_heard_s = time.monotonic() if tunes else -math.inf
        self.was_told_to_tune = self.was_told_to_tune and tunes
        self._may_tune = self._may_tune and tunes

    def tunes(self, now_s: float) -> bool:
        """Return whether the robot tunes itself, as far as its log and the calls to its services tell."""
        return self.was_told_to_tune or now_s - self._tuning_heard_s < TUNING_SILENCE_S
