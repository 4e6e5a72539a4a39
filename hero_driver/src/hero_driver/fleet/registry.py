"""The robots of one driver: arrival, return, duplicate, departure with a grace period. Pure; time enters as now_s.

A robot is known by its namespace, with one connection that counts. A second one from the same address is the robot
after a power cycle and takes over; from another address, while the first one is there or within its grace period, it
is a second robot with the same id and has to wait. Two that were never there at the same time are one robot.
"""

import enum
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional

from .namespaces import Identity

ALIVE_S = 3.0
"""A robot that sent something within this time is connected: stock robots speak at least every 2.5 s."""

FLAP_S = 5.0
"""Two take-overs within this time, where the loser still speaks while the winner does, are two robots behind
one address: a robot that boots or reconnects is silent on its old connection."""

GONE_MAX = 100
"""Robots that are remembered after their grace period; of more, those that left first are forgotten."""

RIVALS_MAX = 16
"""Addresses that are remembered because a second robot with the id of the known one came from them."""


class RobotState(enum.Enum):
    """As in hero_msgs/Robot. REFUSED is no state of a robot, but what duplicates are shown as."""

    JOINING = 0
    READY = 1
    AWAY = 2
    REFUSED = 3


class Verdict(enum.Enum):
    """Decision on a connection that claims an identity."""

    ARRIVED = "arrived"  # first time
    RETURNED = "returned"  # was away
    TOOK_OVER = "took over"  # the old connection is dead or of the same robot: close it
    REFUSED = "refused"  # the robot that is here stays


@dataclass
class RobotRecord:
    """State of one robot over all its connections."""

    identity: Identity
    host: str
    address: str
    link: Optional[Any]
    state: RobotState
    since_s: float
    last_heard_s: float
    joined_s: float
    reconnects: int = 0
    firmware: str = ""
    hardware: str = ""
    config: str = ""
    world: str = ""  # of a simulated robot, as it said at its last boot
    booted_s: Optional[float] = None
    heard_uptime_s: float = 0.0  # as the robot said it last; infinite from its boot line to the next
    last_error: str = ""
    dropped_messages: int = 0
    bad_packets: int = 0  # of earlier connections
    packets: int = 0  # of earlier connections
    received_length: int = 0
    refused: Dict[str, str] = field(default_factory=dict)  # address -> reason, of duplicates that are connected
    rivals: Dict[str, float] = field(default_factory=dict)  # host -> when a duplicate from there was first refused
    was_ready: bool = False

    def enter(self, state: RobotState, now_s: float) -> bool:
        """Enter state at now_s (monotonic); return whether the robot was in another one before."""
        if self.state is state:
            return False
        self.state, self.since_s = state, now_s
        self.was_ready = self.was_ready or state is RobotState.READY
        return True


@dataclass(frozen=True)
class Decision:
    """The answer of FleetRegistry.claim_identity()."""

    verdict: Verdict
    record: RobotRecord
    old_link: Optional[Any] = None  # to be closed, when the verdict is TOOK_OVER


class FleetRegistry:
    """All robots by namespace."""

    def __init__(self, grace_s: float) -> None:
        """grace_s: how long a robot that has left keeps its place and its endpoints."""
        self.robots: Dict[str, RobotRecord] = {}
        self.gone: Dict[str, RobotRecord] = {}
        """Robots that were ready once and have not returned since their grace period, in the order of its end."""
        self._grace_s = grace_s

    def claim_identity(
        self, link: Any, identity: Identity, host: str, address: str, opened_s: float, now_s: float
    ) -> Decision:
        """Decide about a connection (link) from address, open since opened_s, that says it is identity."""
        record = self.robots.get(identity.namespace)
        if record is None:
            record = RobotRecord(
                identity, host, address, link, RobotState.JOINING, now_s, last_heard_s=now_s, joined_s=now_s
            )
            self.robots[identity.namespace] = record
            self.gone.pop(identity.namespace, None)
            return Decision(Verdict.ARRIVED, record)
        if self._is_duplicate(record, host, opened_s, now_s):
            record.refused[address] = (
                "two robots call themselves %s: %s was first and keeps the id, %s is refused; give one of them"
                " another id on its configuration page" % (identity.namespace, record.address, address)
            )
            if len(record.rivals) < RIVALS_MAX:
                record.rivals.setdefault(host, now_s)
            return Decision(Verdict.REFUSED, record)
        old_link = record.link
        record.rivals.pop(host, None)
        record.host, record.address, record.link = host, address, link
        record.joined_s = record.last_heard_s = now_s
        record.reconnects += 1
        record.refused.pop(address, None)
        record.enter(RobotState.JOINING, now_s)
        verdict = Verdict.RETURNED if old_link is None else Verdict.TOOK_OVER
        return Decision(verdict, record, old_link)

    @staticmethod
    def _is_duplicate(record: RobotRecord, host: str, opened_s: float, now_s: float) -> bool:
        if host != record.host and FleetRegistry.is_reserved(record, host):
            return True
        if record.link is None or now_s - record.last_heard_s >= ALIVE_S:
            return False
        is_second = record.last_heard_s > opened_s and record.reconnects > 0
        return host != record.host or (is_second and now_s - record.joined_s < FLAP_S)

    @staticmethod
    def is_reserved(record: RobotRecord, host: str) -> bool:
        """Return whether the id is kept from host: the known robot was heard after one from there was refused."""
        refused_s = record.rivals.get(host)
        return refused_s is not None and record.last_heard_s > refused_s

    def leave(self, link: Any, reason: str, now_s: float) -> Optional[RobotRecord]:
        """Handle the end of a connection; return the robot that is away now, None if it had none."""
        for record in self.robots.values():
            if record.link is link:
                record.link = None
                record.last_error = reason
                record.enter(RobotState.AWAY, now_s)
                return record
        return None

    def collect_expired(self, now_s: float) -> List[RobotRecord]:
        """Move the robots that were away for longer than the grace period to those that are gone; return them."""
        expired = [
            record
            for record in self.robots.values()
            if record.state is RobotState.AWAY and now_s - record.since_s >= self._grace_s
        ]
        for record in expired:
            del self.robots[record.identity.namespace]
            if record.was_ready:
                self.gone[record.identity.namespace] = record
        for namespace in list(self.gone)[:-GONE_MAX]:
            del self.gone[namespace]
        return expired
