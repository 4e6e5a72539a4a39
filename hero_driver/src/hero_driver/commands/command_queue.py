"""Commands that wait to be sent to one robot: motion is shaped (velocity_shaper), others never wait behind it.

CommandSettings are the parameters of all commands.

Queues are bounded: newer motion replaces what waits, of others the oldest is dropped and counted. Motion waits for
older stops of other topics, and for their repeats: each zero Twist switches the servos off.
"""

import collections
import math
from dataclasses import dataclass
from typing import Deque, Dict, List, Optional, Tuple

from hero_node.parameters import declare, flag, number

from .velocity_shaper import VelocityShaper

QUEUE_LENGTH = 50
"""Commands other than motion that may wait for one robot."""

IN_FLIGHT_MAX = 2048
"""Bytes that the robot has not acknowledged beyond which nothing is written: about its TCP window (2144 B)."""

RETRY_S = 0.01
"""Period of checks for the robot's acknowledgement."""

Command = Tuple[str, bytes]


@dataclass(frozen=True)
class CommandSettings:
    """Permissions and time limits of commands."""

    allow_self_tuning: bool = declare(
        flag(False, "allow pid_calibration, with which a robot spins for a minute or for ever, and keeps no gains")
    )
    orphan_stop_s: float = declare(
        number(0.25, 0.0, 10.0, "s", "delay before a robot is stopped when the program that drove it ends")
    )
    silent_stop_s: float = declare(
        number(0.5, 0.0, 10.0, "s", "silence, four periods at least, after which a driven robot is stopped; 0: never")
    )
    service_timeout_s: float = declare(number(5.0, 0.1, 600.0, "s", "time for a robot to answer a service call"))
    command_max_age_s: float = declare(
        number(2.0, 0.1, 60.0, "s", "age at which a motion command that could not be sent is dropped; stops are kept")
    )


class CommandQueue:
    """Commands that wait to be sent to one robot."""

    def __init__(self, max_age_s: float) -> None:
        """max_age_s: shaped motion commands older than this are dropped."""
        self._max_age_s = max_age_s
        self._shapers: Dict[str, VelocityShaper] = {}
        self._offered_s: Dict[str, float] = {}
        self._waits_since_s: Dict[str, float] = {}  # since when a topic's motion waits, newer ones in its place too
        self._resume_s = -math.inf
        self._waiting: Deque[Command] = collections.deque()
        self._is_idle = True  # after the last take(), and nothing was offered since
        self.dropped = 0

    def offer_motion(self, name: str, payload: bytes, stop_payload: bytes, now_s: float) -> None:
        """Take a checked motion command for the topic called name, which stop_payload stops."""
        shaper = self._shapers.get(name)
        if shaper is None:
            shaper = self._shapers[name] = VelocityShaper(stop_payload)
            shaper.delay_until(self._resume_s)
        if not shaper.has_motion:
            self._waits_since_s[name] = now_s
        self._offered_s[name] = now_s
        shaper.offer(payload)
        self._is_idle = False

    def offer(self, name: str, payload: bytes) -> None:
        """Take a message that is no motion, for the topic called name; a full queue drops its oldest."""
        if len(self._waiting) >= QUEUE_LENGTH:
            self._waiting.popleft()
            self.dropped += 1
        self._waiting.append((name, payload))
        self._is_idle = False

    def discard_motion(self, resume_s: float) -> None:
        """Forget the motion commands that wait, and send none before resume_s; stops that wait are kept."""
        self._resume_s = resume_s
        for shaper in self._shapers.values():
            shaper.discard_motion()
            shaper.delay_until(resume_s)

    def clear(self) -> None:
        """Drop all commands: the connection is closed."""
        self.dropped += len(self._waiting)
        self._waiting.clear()
        self._shapers.clear()
        self._offered_s.clear()
        self._resume_s = -math.inf

    def take(self, in_flight_length: int, motion_acknowledged: bool, stops_only: bool, now_s: float) -> List[Command]:
        """Return what may be sent now; with stops_only motion waits.

        in_flight_length: bytes that the robot has not acknowledged; motion_acknowledged: the last motion command is not
        among them. Of two velocities that reach the robot together it would take the older one.
        """
        commands: List[Command] = []
        is_idle = motion_acknowledged
        if motion_acknowledged:
            for name, shaper in self._shapers.items():
                if now_s - self._offered_s.get(name, now_s) > self._max_age_s:
                    shaper.discard_motion()
                payload = shaper.take(now_s, stops_only or self._is_behind_a_stop(name, shaper))
                if payload is not None:
                    commands.append((name, payload))
                is_idle = is_idle and shaper.is_idle
        while self._waiting and in_flight_length < IN_FLIGHT_MAX:
            in_flight_length += len(self._waiting[0][1])
            commands.append(self._waiting.popleft())
        self._is_idle = is_idle and not self._waiting
        return commands

    def due_in_s(self, motion_may_go: bool, now_s: float) -> Optional[float]:
        """Return the time (s) until the next take(), None if nothing waits; motion_may_go: the robot takes motion."""
        if self._is_idle:
            return None
        if self._waiting:
            return RETRY_S
        due_s: Optional[float] = None
        for name, shaper in self._shapers.items():
            if not shaper.has_stop and self._is_behind_a_stop(name, shaper):
                continue
            delay_s = shaper.due_in_s(now_s)
            if delay_s is not None and (due_s is None or delay_s < due_s):
                due_s = delay_s
        return due_s if motion_may_go or due_s is None else max(RETRY_S, due_s)

    def _is_behind_a_stop(self, name: str, shaper: VelocityShaper) -> bool:
        """Return whether motion has to wait for an older stop of another topic, but not for a stream of newer zeros."""
        if len(self._shapers) == 1 or not shaper.has_motion:
            return False
        return any(
            other is not shaper and other.has_stop and self._offered_s[other_name] < self._waits_since_s[name]
            for other_name, other in self._shapers.items()
        )
