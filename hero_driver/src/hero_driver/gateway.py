"""The owner of all conversations: connects links, sessions, the fleet and the robots' bridges.

    in    transport -> receive_data() -> session -> events -> fleet -> robot bridge
    out   robot commands -> command queue -> send_commands() -> session -> transport

Everything here runs on the thread of the sockets, except what says otherwise. It never blocks.
"""

import os
import time
import traceback
from typing import Callable, Dict, List, Optional

from .commands.stop_progress import StopState
from .config import DriverConfig
from .corrections.stamps import NS_PER_S
from .fleet import namespaces
from .fleet.admission import Admission, RateLimit
from .fleet.namespaces import Identity
from .fleet.registry import Decision, FleetRegistry, RobotRecord, RobotState, Verdict
from .peer import Peer
from .reports.robot_log import receive_line
from .reports.robot_status import RobotStatus, describe_robot
from .ros.log_relay import LogRelay
from .ros.raw_publisher import TransformPublisher
from .ros.robot_bridge import RobotBridge
from .ros.robot_commands import Stops
from .rosserial.payloads import Log
from .rosserial.session import Event, MessagesReceived, Problem, Session, SessionEnded, Topic
from .stops.delivery import StopDelivery, can_move, find_stop_payload
from .transport.call_queue import Worker
from .transport.event_loop import THE_DRIVER_ENDS, EventLoop
from .transport.link import READ_LENGTH, Link, LinkHandler

STOP_LIMIT_S = 2.0
"""At the end of the driver, and of a connection, robots get this long to come to rest; 0.4 s is usual."""


class Gateway(LinkHandler):
    """All robots of one driver."""

    def __init__(
        self,
        config: DriverConfig,
        loop: EventLoop,
        log: LogRelay,
        registrar: Worker,
        node: str,
        clock_ns: Callable[[], int],
        on_change: Callable[[], None],
    ) -> None:
        """node: the driver's name in ROS; clock_ns: ROS time; on_change(), of a robot's state, must not block."""
        self._config = config
        self._loop = loop
        self._log = log
        self._registrar = registrar
        self._clock_ns = clock_ns
        self._node = node
        self._admission = Admission(config)
        self._stops = StopDelivery(loop.call_later, self)
        self.note_change = on_change
        self.stop_robot = self._stops.begin
        self._transforms = TransformPublisher(loop.call_later)
        self.open = self._transforms.open
        self.peers: Dict[Link, Peer] = {}
        self.fleet = FleetRegistry(config.grace_s)
        self.bridges: Dict[str, RobotBridge] = {}
        self.stopped = False
        self.refused_connections = 0
        self.last_refusal = ""

    # What the transport calls.

    def open_link(self, link: Link) -> Optional[str]:
        """Begin a conversation, unless the limits are against it."""
        eviction = self._admission.find_eviction(link.address.host)
        if eviction is not None:
            evicted, parameter = eviction
            self._stops.begin(self.peers[evicted])
            evicted.close(f"its address has the most of too many connections ({parameter})")
        refusal = self._admission.admit(link, link.address.host)
        if refusal is not None:
            self.refused_connections += 1
            return refusal
        now_s = time.monotonic()
        session = Session(self._config, now_s)
        peer = Peer(link, session, RateLimit(self._config, now_s), self, self._loop.call_later)
        self.peers[link] = peer
        self.poll_link(link, now_s)
        return None

    def receive_data(self, link: Link, data: bytes, now_s: float) -> None:
        """Pass bytes to the session and its events on; the hot path of the driver."""
        peer = self.peers[link]
        session = peer.session
        reader = session.reader
        packets, skipped_bytes = reader.packets, reader.skipped_bytes
        arrival_ns = self._clock_ns()
        # What fills a read has more behind it; two bursts of a robot do not, so the driver or the network was late.
        peer.wheels.is_late = len(data) >= READ_LENGTH
        events = session.receive_bytes(data, now_s, arrival_ns / NS_PER_S)
        refusal = peer.rate_limit.admit(reader.packets - packets, len(data), now_s)
        if refusal is None and reader.skipped_bytes != skipped_bytes:
            garbage_length = reader.skipped_bytes - skipped_bytes
            refusal = self._admission.admit_garbage(link.address.host, garbage_length, now_s)
        if refusal is not None:
            link.close(refusal)
            return
        if session.outgoing:
            self._send_outgoing(peer)
        for event in events:
            if isinstance(event, MessagesReceived):
                for topic, payload in event.messages:
                    topic.receive(payload, arrival_ns)
                if not self._transforms.is_scheduled:
                    self._transforms.schedule()
            else:
                self._receive_event(peer, event, now_s)
                if link.closed:
                    break

    def poll(self, now_s: float) -> None:
        """Stop robots whose programs have fallen silent, and take down what belongs to robots that left for good."""
        for bridge in self.bridges.values():
            try:
                self._watch(bridge, now_s)
            except Exception as error:  # noqa: BLE001 - an error with one robot must not keep the others moving
                self.report_bug(error)
        for record in self.fleet.collect_expired(now_s):
            expired = self.bridges.pop(record.identity.namespace, None)
            if expired is not None:
                expired.close()
                text = f"{expired.label} has left; its topics and services are unregistered"
                self._log.log_throttled("info", "gone " + expired.label, text)
            self._admit_duplicates(record, lambda host: True)
            self.note_change()

    def _watch(self, bridge: RobotBridge, now_s: float) -> None:
        bridge.commands.watch_commanders(now_s)
        problem = bridge.corrections.take_problem()
        if problem:
            line = f"{bridge.label}: {problem}"
            self._log.log_throttled("warn", bridge.label + problem.split(" ", 1)[0], line, bridge.label)

    def poll_link(self, link: Link, now_s: float) -> None:
        """Perform what is due in the session."""
        peer = self.peers[link]
        for event in peer.session.poll(now_s):
            self._receive_event(peer, event, now_s)
        if peer.session.begins_to_lack_data() and peer.bridge is not None:
            text = f"{peer.label} is connected, but sends none of its topics any more: reboot it"
            self._log.log_throttled("warn", "no data " + peer.label, text, peer.label)
        if peer.record is None and now_s - peer.session.opened_s > self._config.declare_timeout_s:
            link.close(f"did not identify itself as a robot within {self._config.declare_timeout_s:.1f} s")
        if peer.session.outgoing and not link.closed:
            self._send_outgoing(peer)

    def resume(self, now_s: float) -> None:
        """Keep robots that could not be read meanwhile, drop commands that waited, and continue stops at once."""
        for bridge in self.bridges.values():
            bridge.commands.queue.discard_motion(now_s)
        for peer in self.peers.values():
            peer.session.listening_s = now_s
            if peer.stop is not None:
                peer.stop.renew(now_s)

    @staticmethod
    def _send_outgoing(peer: Peer) -> None:
        for packet in peer.session.take_packets():
            peer.link.send_packet(packet)

    def close_link(self, link: Link, reason: str) -> None:
        """Note that link was closed, for this reason; the robot's endpoints stay up for the grace period."""
        peer: Optional[Peer] = self.peers.pop(link, None)
        if peer is None:
            self.last_refusal = f"{link.address}: {reason}"
            text = f"connection of {link.address} refused: {reason}"
            self._log.log_throttled("warn", "refused " + link.address.host, text)
            return
        self._admission.release(link)
        level = "debug" if reason == THE_DRIVER_ENDS else "warn"
        if peer.record is None:
            self.last_refusal = f"{link.address}: {reason}"
            text = f"unidentified connection of {link.address} ended: {reason}"
            self._log.log_throttled(level, "unidentified " + link.address.host + reason[:12], text)
            return
        if peer.refused:
            peer.record.refused.pop(str(link.address), None)
            self.note_change()
            return
        record = peer.record
        record.packets += peer.session.reader.packets
        record.bad_packets += peer.session.reader.bad_packets
        record.received_length += link.received_length
        if record.link is link:
            record.last_heard_s = peer.session.last_receive_s
        if self.fleet.leave(link, reason, time.monotonic()) is not None:
            text = f"{peer.label} left ({link.address}): {reason}"
            self._log.log_throttled(level, "left " + record.identity.namespace, text)
            self.note_change()
        if peer.bridge is not None:
            peer.bridge.detach(reason)
        self._admit_duplicates(record, lambda host: not self.fleet.is_reserved(record, host))

    def report_bug(self, error: Exception) -> None:
        """Log a bug of the driver itself, with the place; only the connection at hand is lost."""
        kind, place = type(error).__name__, "".join(traceback.format_tb(error.__traceback__)[-2:]).replace("\n", " ")
        text = f"bug in the driver, please report it: {kind}: {error}; {place}"
        self._log.log_throttled("fatal", "fault " + kind, text)

    def warn_network(self, text: str) -> None:
        """Log what the transport warns of."""
        self._log.log_throttled("warn", "network " + text[:40], text)

    # What a session tells.

    def _receive_event(self, peer: Peer, event: Event, now_s: float) -> None:
        if isinstance(event, Topic):
            self._declare(peer, event, now_s)
        elif isinstance(event, Log):
            receive_line(self._log, peer, event, now_s)
        elif isinstance(event, Problem):
            self.warn_robot(peer, event.text)
        elif isinstance(event, SessionEnded):
            peer.link.close(event.reason)

    def _declare(self, peer: Peer, topic: Topic, now_s: float) -> None:
        if self.stopped and find_stop_payload(topic) is not None:
            # After the whole burst of declarations: every motion topic is to get its zero.
            self._loop.call_soon(lambda: self._stop_late(peer))
        if peer.record is None:
            self._identify(peer, topic, now_s)
        if peer.refused:
            peer.watch_wheels(topic)
        if peer.refused or peer.bridge is None or peer.record is None:
            return
        name = self._resolve(peer, topic, peer.bridge.identity)
        if name is None:
            return
        peer.bridge.declare(topic, name)
        if peer.record.enter(RobotState.READY, now_s):
            self.note_change()

    def _stop_late(self, peer: Peer) -> None:
        """Stop a robot that has joined while all are stopped."""
        if self.stopped and peer.stop is None:
            self._stops.begin(peer)

    def _resolve(self, peer: Peer, topic: Topic, identity: Identity) -> Optional[str]:
        """Return the ROS name of what a robot declared, None if it may not use it, which is logged."""
        info = topic.info
        refusal = namespaces.find_refusal(info.name, info.message_type, identity, self._node, topic.kind.is_from_robot)
        if refusal is not None:
            self.warn_robot(peer, f"topic {info.name!a} refused: {refusal}")
            return None
        return namespaces.resolve(info.name, identity)

    def _identify(self, peer: Peer, topic: Topic, now_s: float) -> None:
        """Find out which robot a peer is from the first name that tells."""
        identity = namespaces.identify(topic.info.name)
        address = peer.link.address
        if identity is None:
            if topic.info.name in namespaces.TF_TOPICS:
                peer.keep(topic)
            else:
                self.warn_robot(peer, f"topic {topic.info.name!a} refused: not a name below /hero_N")
            return
        if self._resolve(peer, topic, identity) is None:
            return
        known = self.fleet.robots.get(identity.namespace)
        if known is not None and known.link is not None:
            # Only needed here, and every read would cost more.
            known.last_heard_s = self.peers[known.link].session.last_receive_s
        if known is None:
            refusal = self._admission.admit_new_robot(address.host, now_s)
            if refusal is not None:
                peer.link.close(refusal)
                return
        decision = self.fleet.claim_identity(
            peer.link, identity, address.host, str(address), peer.session.opened_s, now_s
        )
        self._admission.note_identified(peer.link)
        peer.record = decision.record
        if decision.verdict is Verdict.REFUSED:
            peer.refused = True
            key, text = "duplicate " + identity.namespace + address.host, peer.record.refused[str(address)]
            self._log.log_throttled("error", key, text)
            self.note_change()
            return
        self._join(peer, decision)

    def _join(self, peer: Peer, decision: Decision) -> None:
        record = decision.record
        identity = record.identity
        if decision.old_link is not None and not decision.old_link.closed:
            # The record belongs to the new connection already, so the old one's end changes nothing.
            decision.old_link.close(f"the robot connected again from {peer.link.address}")
        bridge = self.bridges.get(identity.namespace)
        if bridge is None:
            shared = self, self._loop, self._log, self._transforms, self._registrar, self._config, self._config
            bridge = self.bridges[identity.namespace] = RobotBridge(identity, *shared, 2 * self._config.max_topics)
        peer.bridge = bridge
        rebooted = peer.boot is not None
        bridge.corrections.odometry.restart(rebooted and decision.verdict is not Verdict.ARRIVED, peer.wheels)
        bridge.attach(peer)
        text = f"{bridge.label} {decision.verdict.value} ({peer.link.address})"
        self._log.log_throttled("info", "joined " + bridge.label, text)
        self.note_change()
        early, peer.early = peer.early, []
        for event in early:
            self._receive_event(peer, event, record.joined_s)

    def _admit_duplicates(self, record: RobotRecord, may_come: Callable[[str], bool]) -> None:
        """Close connections that waited because another robot has their id: they dial again, and are admitted."""
        for peer in list(self.peers.values()):
            if peer.refused and peer.record is record and may_come(peer.link.address.host):
                peer.link.close("the robot with the same id left; this one may try again")

    # Reports.

    def list_robots(self, now_s: float) -> List[RobotStatus]:
        """Return the state of every robot, sorted by namespace."""
        statuses = []
        duplicate_stops = {
            str(peer.link.address): self._stops.find_state(peer) for peer in self.peers.values() if peer.refused
        }
        for record in self.fleet.robots.values():
            bridge = self.bridges.get(record.identity.namespace)
            peer = None if record.link is None else self.peers.get(record.link)
            stop_state = self._stops.find_state(peer)
            statuses.append(describe_robot(record, bridge, peer, stop_state, duplicate_stops, now_s))
        return sorted(statuses, key=lambda status: (status.message.id, status.message.namespace))

    def list_gone(self, now_s: float) -> List[RobotStatus]:
        """Return the last state of each robot that has not returned, sorted by id."""
        records = sorted(self.fleet.gone.values(), key=lambda record: record.identity.number)
        return [describe_robot(record, None, None, StopState.NOT_STOPPED, {}, now_s) for record in records]

    def dismiss_gone(self, answer: Callable[[List[str]], None]) -> None:
        """Report robots that are gone no longer; call answer() with their names."""
        names = [record.identity.namespace.lstrip("/") for record in self.fleet.gone.values()]
        self.fleet.gone.clear()
        self.note_change()
        answer(names)

    def list_stops(self) -> Stops:
        """Return the stop of every connection that can move a robot, and None for each robot that is away."""
        connected = [peer for peer in self.peers.values() if peer.bridge is not None or can_move(peer)]
        away = [None for record in self.fleet.robots.values() if record.link is None]
        return [*map(self._stops.find_state, connected), *away]

    # Stop.

    def set_stopped(self, stopped: bool) -> None:
        """Stop all robots until they are released, or release them; on the thread of the sockets, or before it runs."""
        self.stopped = stopped
        if stopped:
            for peer in self._list_stoppable():
                self._stops.begin(peer)
        else:
            self._stops.release()
        self.note_change()

    def stop_at_end(self) -> None:
        """Stop every robot after the loop that served them, and say which may still move; blocks."""
        self.stopped = True
        doubtful = self._stops.stop_and_wait(self._list_stoppable(), time.monotonic() + STOP_LIMIT_S, self._serve)
        if doubtful:
            names = ", ".join(f"{peer.label} ({self._stops.find_state(peer).name})" for peer in doubtful)
            self._log.log("error", f"the driver ends, and these robots are not known to be at rest: {names}")

    def _list_stoppable(self) -> List[Peer]:
        return [peer for peer in self.peers.values() if can_move(peer)]

    # What stops and the robots' commands ask for.

    def warn_robot(self, peer: Peer, text: str) -> None:
        """Log what is wrong with a robot, and keep it for reports."""
        if peer.record is not None:
            peer.record.dropped_messages += 1
            peer.record.last_error = text
        group = peer.label if peer.bridge is not None else peer.link.address.host
        line = f"{peer.label}: {text}"
        self._log.log_throttled("error", peer.label + text[:80], line, group)

    def warn_late(self) -> None:
        """Log that what robots send is read too late to tell what they do, if that is this PC's doing."""
        late_s = self._loop.find_lateness_s()
        if late_s > 0.0:
            load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count() or 1} CPUs"
            text = f"the PC is overloaded ({load}): the driver ran up to {late_s:.1f} s late, and does not know yet"
            text += " whether robots that were stopped are at rest; end other programs"
            self._log.log_throttled("warn", "overload", text)

    def _serve(self, peer: Peer) -> None:
        """Write what waits for a robot, and take what it has sent, as the loop does."""
        try:
            peer.link.flush()
            data = peer.link.read()
            if data:
                self.receive_data(peer.link, data, time.monotonic())
        except Exception as error:  # noqa: BLE001 - an error with one robot must not keep the others moving
            self.report_bug(error)
