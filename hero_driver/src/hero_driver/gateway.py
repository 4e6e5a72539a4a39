"""The owner of all conversations: connects links, sessions, the fleet and the robots' bridges.

    in    transport -> receive_data() -> session -> events -> fleet -> robot bridge
    out   robot bridge -> command queue -> send_commands() -> session -> transport

Everything here runs on the thread of the sockets, except what says otherwise. It never blocks.
"""

import time
import traceback
from typing import Callable, Dict, List, Optional

from . import log_lines, names
from .admission import GARBAGE_REST_S, Admission, RateGuard
from .cleaning import CleaningSettings
from .command_sender import CommandSender
from .config import DriverConfig
from .fleet import Decision, Fleet, RobotRecord, RobotState, Verdict
from .halting import await_halt, halt_directly
from .log_relay import LogRelay
from .names import Identity, NameRules
from .registrar import RobotRegistrar
from .robot_bridge import VELOCITY_SUFFIX, BridgeContext, RobotBridge
from .robot_requests import RobotRequests
from .robot_status import Peer, RobotStatus, describe_robot
from .rosserial.payloads import LOG_DEBUG, LOG_ERROR, LOG_FATAL, LOG_INFO, LOG_WARN, Log
from .rosserial.session import (
    CallReceived,
    Event,
    LogReceived,
    ParameterRequested,
    Problem,
    Session,
    SessionEnded,
    Topic,
    TopicDeclared,
    TopicKind,
)
from .transform_collector import TransformCollector
from .transport import THE_DRIVER_ENDS, EventLoop, Link, LinkHandler
from .worker import Worker

NS_PER_S = 10**9

LOG_LEVELS = {LOG_DEBUG: "debug", LOG_INFO: "info", LOG_WARN: "warn", LOG_ERROR: "error", LOG_FATAL: "fatal"}

LOG_LINES_PER_S = 100
"""Log lines of one robot that reach /rosout; a robot that tunes its motors sends 47 per second."""

REBOOT_SLACK_S = 2.0
"""An uptime that implies a boot later than the known one by more than this is a reboot."""

FLEET_POLL_S = 0.1


class Gateway(LinkHandler):
    """All robots of one driver."""

    def __init__(
        self,
        config: DriverConfig,
        log: LogRelay,
        registrar: Worker,
        node: str,
        clock_ns: Callable[[], int],
        on_change: Callable[[], None],
    ) -> None:
        """node: the driver's name in ROS; clock_ns gives ROS time; on_change() is called when a robot's state changes (it must not block)."""
        self._config = config
        self._log = log
        self._registrar = registrar
        self._clock_ns = clock_ns
        self._on_change = on_change
        self._names = NameRules(config.namespace_policy, node)
        self._admission = Admission(config.admission_limits)
        self._loop: EventLoop
        self._sender: CommandSender
        self._requests: RobotRequests
        self._transforms: TransformCollector
        self._context: BridgeContext
        self.peers: Dict[Link, Peer] = {}
        self.fleet = Fleet(config.grace_s)
        self.bridges: Dict[str, RobotBridge] = {}
        self.stopped = False
        self.refused_connections = 0
        self.last_refusal = ""

    def open(self, loop: EventLoop) -> None:
        """Begin to serve what loop brings."""
        self._loop = loop
        self._sender = CommandSender(loop.call_here, loop.call_later, self._find_peer, self._complain)
        self._requests = RobotRequests(self._config, self._log, loop.call_soon, self._complain)
        self._transforms = TransformCollector(self._config.transform_period_s, loop.call_later)
        self._context = BridgeContext(
            log=self._log.log_throttled,
            wake=self._sender.wake,
            add_transform=self._transforms.add,
            call_later=loop.call_later,
            add_reader=loop.add_reader,
            is_stopped=lambda: self.stopped,
            clamp=self._config.clamp,
            service_timeout_s=self._config.service_timeout_s,
            command_max_age_s=self._config.command_max_age_s,
            max_names=2 * self._config.max_topics,
        )
        loop.call_later(FLEET_POLL_S, self._poll_fleet)

    def close(self) -> None:
        """End the workers; the loop has ended before."""
        self._requests.close()

    # What the transport calls.

    def open_link(self, link: Link) -> Optional[str]:
        """Begin a conversation, unless the limits are against it."""
        self._make_room(link.address.host)
        refusal = self._admission.admit(link.address.host)
        if refusal is not None:
            self.refused_connections += 1
            return refusal
        now_s = time.monotonic()
        session = Session(self._config.session_limits, now_s)
        guard = RateGuard(self._config.max_frames_per_s, self._config.max_bytes_per_s, now_s)
        peer = Peer(link, session, guard)
        link.peer = peer
        self.peers[link] = peer
        self.poll_link(link, now_s)
        return None

    def _make_room(self, host: str) -> None:
        crowd = self._admission.find_crowd(host)
        if crowd is not None:
            for link, peer in self.peers.items():
                if peer.record is None and link.address.host == crowd:
                    link.close("its address has the most of too many connections (~max_unidentified)")
                    return

    def receive_data(self, link: Link, data: bytes, now_s: float) -> None:
        """Pass bytes to the session and its events on; the hot path of the driver."""
        peer: Peer = link.peer
        session = peer.session
        arrival_ns = self._clock_ns()
        events = session.receive_bytes(data, now_s, arrival_ns / NS_PER_S)
        refusal = peer.guard.judge(session.reader.frames, link.received_length, now_s)
        if refusal is not None:
            link.close(refusal)
            return
        if session.outgoing:
            self._send_outgoing(peer)
        if not events and peer.record is None and peer.guard.hears_garbage:
            self._loop.rest(link, GARBAGE_REST_S)
        for event in events:
            if type(event) is tuple:
                topic, payload = event
                topic.receive(payload, arrival_ns)
            else:
                self._receive_event(peer, event, now_s)
                if link.closed:
                    break
        if not self._transforms.is_scheduled:
            self._transforms.schedule()

    def poll_link(self, link: Link, now_s: float) -> None:
        """Let the session do what is due."""
        peer: Peer = link.peer
        for event in peer.session.poll(now_s):
            self._receive_event(peer, event, now_s)
        if peer.record is None and now_s - peer.session.opened_s > self._config.declare_timeout_s:
            link.close("did not say within %.1f s which robot it is" % self._config.declare_timeout_s)
        if not link.closed:
            self._send_outgoing(peer)

    @staticmethod
    def _send_outgoing(peer: Peer) -> None:
        for frame in peer.session.take_frames():
            peer.link.send_frame(frame)

    def close_link(self, link: Link, reason: str) -> None:
        """Note a departure; the robot's endpoints stay up for the grace period."""
        peer: Optional[Peer] = self.peers.pop(link, None)
        if peer is None:
            self.last_refusal = "%s: %s" % (link.address, reason)
            self._log.log_throttled(
                "warn",
                "refused " + link.address.host,
                "connection of %s refused: %s" % (link.address, reason),
            )
            return
        self._admission.release(link.address.host)
        if peer.record is None:
            self._admission.note_identified(link.address.host)
            self.last_refusal = "%s: %s" % (link.address, reason)
            self._log.log_throttled(
                "warn",
                "nobody " + link.address.host + reason[:12],
                "connection of %s, which never said which robot it is, ended: %s" % (link.address, reason),
            )
            return
        if peer.refused:
            peer.record.refused.pop(str(link.address), None)
            self._on_change()
            return
        record = peer.record
        record.frames += peer.session.reader.frames
        record.bad_frames += peer.session.reader.bad_frames
        record.received_length += link.received_length
        now_s = time.monotonic()
        if self.fleet.leave(link, reason, now_s) is not None:
            self._log.log_throttled(
                "debug" if reason == THE_DRIVER_ENDS else "warn",
                "left " + record.identity.namespace,
                "%s left (%s): %s" % (peer.label, link.address, reason),
                host=link.address.host,
            )
            self._on_change()
        if peer.bridge is not None:
            peer.bridge.registrar.end()
            peer.bridge.detach(reason)
            self._admission.note_departure(link.address.host, now_s - peer.session.opened_s, now_s)
        self._promote_duplicate(record.identity, now_s)

    def report_fault(self, error: Exception) -> None:
        """Log a mistake of the driver itself, with the place; only the connection at hand is lost."""
        place = "".join(traceback.format_tb(error.__traceback__)[-2:]).replace("\n", " ")
        self._log.log_throttled(
            "fatal",
            "fault " + type(error).__name__,
            "the driver made a mistake, please report it: %s: %s; %s" % (type(error).__name__, error, place),
        )

    def report_trouble(self, text: str) -> None:
        """Log what the network has to say."""
        self._log.log_throttled("warn", "trouble " + text[:40], text)

    # What a session tells.

    def _receive_event(self, peer: Peer, event: Event, now_s: float) -> None:
        if isinstance(event, TopicDeclared):
            self._declare(peer, event.topic, now_s)
        elif isinstance(event, LogReceived):
            self._receive_log(peer, event.log, now_s)
        elif isinstance(event, CallReceived):
            self._call_service(peer, event.topic, event.request)
        elif isinstance(event, ParameterRequested):
            self._requests.answer_parameter(peer, event.name)
        elif isinstance(event, Problem):
            self._complain(peer, event.text)
        elif isinstance(event, SessionEnded):
            peer.link.close(event.reason)

    def _complain(self, peer: Peer, text: str) -> None:
        if peer.record is not None:
            peer.record.dropped_messages += 1
            peer.record.last_error = text
        group = peer.label if peer.bridge is not None else peer.link.address.host
        line = "%s: %s" % (peer.label, text)
        self._log.log_throttled("error", peer.label + text[:80], line, group, peer.link.address.host)

    def _declare(self, peer: Peer, topic: Topic, now_s: float) -> None:
        if peer.record is None and not self._identify(peer, topic, now_s):
            return
        if peer.refused or peer.bridge is None or peer.record is None:
            return
        name = self._resolve(peer, topic, peer.bridge.identity)
        if name is None:
            return
        peer.bridge.declare(topic, name)
        if self.stopped and name.endswith(VELOCITY_SUFFIX):
            peer.bridge.halt()
        if peer.record.state is not RobotState.READY:
            peer.record.enter(RobotState.READY, now_s)
            self._on_change()

    def _resolve(self, peer: Peer, topic: Topic, identity: Identity) -> Optional[str]:
        """Return the ROS name of what a robot declared, None if it may not use it, which is logged."""
        info = topic.info
        is_published = topic.kind is TopicKind.PUBLISHER
        refusal = self._names.find_refusal(info.name, info.message_type, is_published, identity)
        if refusal is not None:
            self._complain(peer, "topic %s refused: %s" % (ascii(info.name), refusal))
            return None
        return self._names.resolve(info.name, identity)

    def _identify(self, peer: Peer, topic: Topic, now_s: float) -> bool:
        """Find out which robot a peer is from the first name that tells; return whether it is settled."""
        identity = names.identify(topic.info.name)
        address = peer.link.address
        if identity is None:
            if self._config.namespace_policy == "robot":
                if topic.info.name in names.TF_TOPICS:
                    peer.early_topics.append(topic)
                else:
                    self._complain(
                        peer,
                        "topic %s refused: not a name below /hero_N; for devices that are no HeRos set"
                        " ~namespace_policy to any" % ascii(topic.info.name),
                    )
                return False
            identity = names.identify_any(topic.info.name, address.host)
        if self._resolve(peer, topic, identity) is None:
            return False
        known = self.fleet.robots.get(identity.namespace)
        if known is not None and known.link is not None:
            # Only needed here, and every read would cost more.
            known.last_heard_s = known.link.peer.session.last_receive_s
        if known is None:
            refusal = self._admission.admit_arrival(address.host, now_s)
            if refusal is not None:
                peer.link.close(refusal)
                return False
        decision = self.fleet.identify(
            peer.link, identity, address.host, str(address), peer.session.opened_s, now_s
        )
        self._admission.note_identified(address.host)
        peer.record = decision.record
        if decision.verdict is Verdict.REFUSED:
            peer.refused = True
            self._log.log_throttled(
                "error", "duplicate " + identity.namespace + address.host, decision.reason
            )
            self._on_change()
            return False
        self._join(peer, decision)
        return True

    def _join(self, peer: Peer, decision: Decision) -> None:
        record = decision.record
        identity = record.identity
        if decision.old_link is not None and not decision.old_link.closed:
            # The record belongs to the new connection already, so the old one's end changes nothing.
            decision.old_link.close("the robot connected again from %s" % (peer.link.address,))
        bridge = self.bridges.get(identity.namespace)
        if bridge is None:
            cleaning = self._cleaning_settings() if names.is_hero(identity) else None
            registrar = RobotRegistrar(self._registrar, self._loop.call_later)
            bridge = RobotBridge(identity, cleaning, self._context, registrar)
            self.bridges[identity.namespace] = bridge
        peer.bridge = bridge
        rebooted = peer.boot is not None
        if bridge.cleaner is not None:
            bridge.cleaner.restart(rebooted and decision.verdict is not Verdict.ARRIVED)
        host = peer.link.address.host
        hold_s = self._admission.find_hold_s(host, record.joined_s)
        if hold_s > 0.0:
            text = "robots of %s leave as soon as they have come: new topics of its robots wait for %g s" % (
                host,
                hold_s,
            )
            self._log.log_throttled("warn", "held " + host, text, host=host)
        bridge.registrar.begin(hold_s)
        bridge.attach()
        text = "%s %s (%s)" % (bridge.label, decision.verdict.value, peer.link.address)
        self._log.log_throttled("info", "joined " + bridge.label, text, host=peer.link.address.host)
        self._on_change()
        early_topics, peer.early_topics = peer.early_topics, []
        for topic in early_topics:
            self._declare(peer, topic, record.joined_s)
        early_logs, peer.early_logs = peer.early_logs, []
        for log in early_logs:
            self._receive_log(peer, log, record.joined_s)

    def _cleaning_settings(self) -> CleaningSettings:
        config = self._config
        return CleaningSettings(
            config.odometry,
            config.wheel_geometry,
            config.pose_covariance,
            config.twist_covariance,
            config.stamps,
            config.max_future_s,
            config.max_age_s,
        )

    def _promote_duplicate(self, identity: Identity, now_s: float) -> None:
        """Let a robot in that waited because another one had its id, by asking for its topics again."""
        for peer in list(self.peers.values()):
            if peer.refused and peer.record is not None and peer.record.identity == identity:
                peer.link.close("the robot with the same id left; this one may try again")
                return

    def _receive_log(self, peer: Peer, log: Log, now_s: float) -> None:
        line = log_lines.read_log_line(log.text)
        if line.boot is not None:
            peer.boot = line.boot
        if peer.bridge is None or peer.record is None:
            if len(peer.early_logs) < 10:
                peer.early_logs.append(log)
            return
        if peer.refused:
            return
        record = peer.record
        if line.boot is not None:
            record.firmware, record.hardware, record.config = line.boot
        if line.heartbeat is not None:
            self._receive_heartbeat(peer, record, line.heartbeat.uptime_s, now_s)
        if now_s - peer.log_window_s >= 1.0:
            peer.log_window_s, peer.log_count = now_s, 0
        peer.log_count += 1
        if peer.log_count > LOG_LINES_PER_S:
            record.dropped_messages += 1
            return
        level = "debug" if line.is_routine else LOG_LEVELS.get(log.level, "error")
        self._log.log(level, "%s: %s" % (peer.label, line.text))

    def _receive_heartbeat(self, peer: Peer, record: RobotRecord, uptime_s: float, now_s: float) -> None:
        booted_s = now_s - uptime_s
        if record.booted_s is not None and booted_s - record.booted_s > REBOOT_SLACK_S:
            self._log.log("warn", "%s rebooted %.1f s ago" % (peer.label, uptime_s))
            if peer.bridge is not None and peer.bridge.cleaner is not None and peer.boot is None:
                peer.bridge.cleaner.note_reboot()
        # Delays of the network only make a boot look later, so the earliest is the best.
        if (
            record.booted_s is None
            or booted_s < record.booted_s
            or booted_s - record.booted_s > REBOOT_SLACK_S
        ):
            record.booted_s = booted_s

    def _call_service(self, peer: Peer, topic: Topic, request: bytes) -> None:
        name = None if peer.bridge is None else self._resolve(peer, topic, peer.bridge.identity)
        if name is not None:
            self._requests.call_service(peer, topic, name, request, self._sender.send_message)

    def _find_peer(self, bridge: RobotBridge) -> Optional[Peer]:
        """Return the connection of a bridge's robot, None if it is away."""
        record = self.fleet.robots.get(bridge.identity.namespace)
        if record is None or record.link is None or record.link.closed:
            return None
        peer: Peer = record.link.peer
        return peer

    # Reports.

    def list_robots(self, now_s: float) -> List[RobotStatus]:
        """Return the state of every robot, sorted by namespace."""
        statuses = []
        for record in self.fleet.robots.values():
            bridge = self.bridges.get(record.identity.namespace)
            peer: Optional[Peer] = record.link.peer if record.link is not None else None
            statuses.append(describe_robot(record, bridge, peer, now_s))
        return sorted(statuses, key=lambda status: (status.number, status.namespace))

    # Stop.

    def set_stopped(self, stopped: bool) -> None:
        """Hold all motion, or let it go on; from any thread."""
        self.stopped = stopped
        if stopped:
            self._loop.call_soon(self.halt_all)
        self._on_change()

    def halt_all(self) -> None:
        """Stop every robot."""
        for bridge in self.bridges.values():
            bridge.halt()

    def halt_and_wait(self, deadline_s: float, then: Callable[[], None]) -> None:
        """Stop every robot and call then() when all have got it twice, or at deadline_s (monotonic)."""
        self.stopped = True
        self.halt_all()
        await_halt(self._loop, lambda: list(self.peers.values()), deadline_s, then)

    def disconnect(self, namespace: str, deadline_s: float, then: Callable[[bool], None]) -> None:
        """Stop one robot and close its connection, then say whether there was one; on the thread of the sockets.

        The robot dials again by itself; deadline_s (monotonic): until then it may take to be stopped.
        """
        bridge = self.bridges.get(namespace)
        peer = None if bridge is None else self._find_peer(bridge)
        if bridge is None or peer is None:
            then(False)
            return
        link = peer.link
        bridge.halt()

        def close() -> None:
            if not link.closed:
                link.close("disconnected on request")
            then(True)

        await_halt(self._loop, lambda: [] if link.closed else [peer], deadline_s, close)

    def halt_directly(self) -> None:
        """Write stops past all queues, because the loop that empties them has broken."""
        halt_directly(list(self.peers.values()))

    def _poll_fleet(self) -> None:
        self._loop.call_later(FLEET_POLL_S, self._poll_fleet)
        now_s = time.monotonic()
        for record in self.fleet.collect_expired(now_s):
            bridge = self.bridges.pop(record.identity.namespace, None)
            if bridge is not None:
                bridge.close()
                self._requests.forget(bridge.label)
                text = "%s is gone; its topics and services are taken down" % bridge.label
                self._log.log_throttled("info", "gone " + bridge.label, text, host=record.host)
            self._on_change()
