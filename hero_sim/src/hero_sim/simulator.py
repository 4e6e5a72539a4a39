"""A swarm behind its TCP connections, in step with the wall clock.

The only file that reads a clock. It lets the swarm catch up, carries bytes both ways, and waits.
"""

import time
from typing import Callable, List, Optional, Set

from .link.tcp_link import LinkHandler, TcpLink
from .link.wifi import Radio
from .robot_constants import RECEIVE_WINDOW_LENGTH
from .swarm import Swarm
from .world.world import STEP_MS

_MAX_WAIT_S = 0.05
"""Limits the delay of a stop by a signal or another thread."""

_MIN_WAIT_S = 0.0005

_FLAPPING_MS = 5000
"""A server that closes every connection at once gets one pair of lines per robot in this time."""

_LATE_S = 1.0
"""Further behind the wall clock than this (a machine that slept), the time is skipped, not caught up."""


class Simulator(LinkHandler):
    """Runs one swarm.

    Attributes:
        swarm, link, radios: what it joins.
        stopping: set from anywhere to end run().
        before_advance: called with the simulated time (ms) between two steps.
    """

    def __init__(
        self, swarm: Swarm, link: TcpLink, radios: List[Radio], report: Callable[[str], None], speed: float = 1.0
    ) -> None:
        """Join a swarm, its radios and their link; speed is simulated seconds per second of wall clock."""
        self.swarm = swarm
        self.link = link
        link.handler = self
        self.radios = radios
        self.stopping = False
        self.before_advance: List[Callable[[int], None]] = []
        self._speed = speed
        self._anchor_s, self._anchor_ms = 0.0, 0
        self._report = report
        self._reported_late = False
        self._reported_unreachable = False
        self._reported_connected = [False] * len(swarm.robots)
        self._quiet_until_ms = [0] * len(swarm.robots)
        self._away_until_ms = [0] * len(swarm.robots)
        self._carrying: Set[int] = set()
        self._full: Set[int] = set()
        self._congested: Set[int] = set()

    def run(self, seconds: Optional[float] = None) -> None:
        """Run until stopping is set, or for this many simulated seconds."""
        end_ms = None if seconds is None else self.swarm.now_ms + int(seconds * 1000)
        self._anchor_clock()
        while not self.stopping and (end_ms is None or self.swarm.now_ms < end_ms):
            self._step(end_ms)

    def linger(self, limit_s: float) -> None:
        """Run on until the driver closes a connection or stopping is set again, at most for limit_s of wall clock.

        A driver that ends at the same time then sees its robots stop before they disconnect.
        """
        self.stopping = False
        self._report = lambda text: None
        deadline_s = time.monotonic() + limit_s
        connected = self.link.count_open()
        while connected and not self.stopping and time.monotonic() < deadline_s:
            self._step(None)
            if self.link.count_open() < connected:
                return

    def _step(self, end_ms: Optional[int]) -> None:
        target_ms = self._find_target()
        for call in self.before_advance:
            call(self.swarm.now_ms)
        for index in self.swarm.advance(target_ms if end_ms is None else min(target_ms, end_ms)):
            self.serve_robot(index)
        if self._carrying:
            self._carry(self.swarm.now_ms)
        for index in list(self._full):
            self._limit_window(index)
        self.link.poll(self._find_wait())

    def _anchor_clock(self) -> None:
        self._anchor_s, self._anchor_ms = time.monotonic(), self.swarm.now_ms

    def _find_target(self) -> int:
        """Return the simulated time (ms) that the wall clock has reached."""
        now_ms = self.swarm.now_ms
        target_ms = self._anchor_ms + int((time.monotonic() - self._anchor_s) * 1000 * self._speed)
        late_s = (target_ms - now_ms) / 1000.0 / self._speed
        if late_s <= _LATE_S:
            return target_ms
        if not self._reported_late:
            self._reported_late = True
            self._report(
                "this machine was busy or asleep for %.1f s; the robots were paused meanwhile (reported once; "
                "if it is too slow, take fewer robots or a lower --speed)" % late_s
            )
        self._anchor_clock()
        return now_ms + 1

    def _find_wait(self) -> float:
        """Return how long (s) to wait for the link until the swarm has to continue."""
        next_ms = min(self.swarm.next_due_ms, self.swarm.world.time_ms + STEP_MS)
        wait_s = (next_ms - self._anchor_ms) / 1000.0 / self._speed - (time.monotonic() - self._anchor_s)
        return min(max(wait_s, _MIN_WAIT_S), _MAX_WAIT_S)

    # -- bytes between robots and link -----------------------------------------------------------------------

    def serve_robot(self, index: int) -> None:
        """Send what a robot has in its outbox, and connect it if it wants that."""
        robot = self.swarm.robots[index]
        if robot.outbox:
            self._send_up(index, robot.outbox)
            robot.outbox.clear()
        if robot.crash_reason is not None:
            self._report(f"{robot.name} crashed: the server sent {robot.crash_reason}; the robot restarts")
            self.reboot(index)
        elif robot.wants_connection:
            self._connect(index)

    def _send_up(self, index: int, pieces: List[bytes]) -> None:
        radio, link, now_ms = self.radios[index], self.link, self.swarm.now_ms
        if not radio.is_transparent(now_ms):
            # TCP joins what is written at once (Nagle).
            radio.up.put(now_ms, b"".join(pieces))
            self._carrying.add(index)
            if radio.is_congested(now_ms):
                self._congested.add(index)
                self.writing_blocked(index)
            return
        # The firmware's write ran into its limit of 5 s: what is left of it is lost, half a packet perhaps.
        link.drop_unsent(index)
        for data in pieces:
            link.send(index, data)

    def _carry(self, now_ms: int) -> None:
        """Pass on what has arrived over the radios."""
        for index in list(self._carrying):
            radio = self.radios[index]
            up, down = radio.up.take(now_ms), radio.down.take(now_ms)
            if up:
                self.link.send(index, up)
            if down:
                self.swarm.robots[index].receive_bytes(now_ms, down)
            if index in self._congested and not radio.is_congested(now_ms):
                self._congested.discard(index)
                if not self.link.has_unsent(index):
                    self.writing_resumed(index)
            if not radio.is_carrying:
                self._carrying.discard(index)

    def _limit_window(self, index: int) -> None:
        """Leave what arrives in the system while a robot's receive window is full, so that the sender blocks."""
        waiting_length = self.swarm.robots[index].received_length + self.radios[index].down.length
        full = waiting_length >= RECEIVE_WINDOW_LENGTH
        (self._full.add if full else self._full.discard)(index)
        self.link.pause(index, full)

    # -- connections -----------------------------------------------------------------------------------------

    def _connect(self, index: int) -> None:
        robot = self.swarm.robots[index]
        now_ms = self.swarm.now_ms
        if now_ms < self._away_until_ms[index]:
            robot.connection_failed(now_ms)
            self.swarm.reschedule(index)
        elif self.link.is_connecting(index):
            # The firmware gave up after 5 s and tries again; the attempt under way serves as the new one.
            self._report_failure("no answer within 5 s")
        else:
            self.link.connect(index)

    def _drop_connection(self, index: int, orderly: bool) -> None:
        if orderly:
            self.link.close(index)
        else:
            self.link.abandon(index)
        self.radios[index].clear()
        self.swarm.robots[index].connection_lost()
        self._reported_connected[index] = False

    def switch_off(self, index: int) -> None:
        """Cut a robot's power; the driver is not told."""
        self._drop_connection(index, orderly=False)
        self.swarm.robots[index].switch_off()
        self.swarm.reschedule(index)

    def reboot(self, index: int, robot_id: Optional[int] = None, after_ms: int = 0) -> None:
        """Switch a robot off, and on again after_ms; its old connection is left without a word, as by a real one."""
        self.switch_off(index)
        self.swarm.robots[index].switch_on(self.swarm.now_ms + after_ms, robot_id)
        self.swarm.reschedule(index)

    def leave(self, index: int, for_ms: int) -> None:
        """Close a robot's connection, and let it connect again only after for_ms."""
        self._away_until_ms[index] = self.swarm.now_ms + for_ms
        self._drop_connection(index, orderly=True)

    # -- what the link tells ---------------------------------------------------------------------------------

    def connection_made(self, index: int) -> None:
        if self.swarm.robots[index].is_on:
            self.swarm.robots[index].connection_made(self.swarm.now_ms)
        self.swarm.reschedule(index)
        self._reported_unreachable = False
        if not self._reported_connected[index]:
            self._reported_connected[index] = True
            self._report(f"{self.swarm.robots[index].name} connected")

    def connection_failed(self, index: int, reason: str) -> None:
        self._report_failure(reason)
        self.swarm.robots[index].connection_failed(self.swarm.now_ms)
        self.swarm.reschedule(index)

    def connection_lost(self, index: int, reason: str) -> None:
        self.radios[index].clear()
        self.swarm.robots[index].connection_lost()
        if self.swarm.now_ms >= self._quiet_until_ms[index]:
            self._reported_connected[index] = False
            self._quiet_until_ms[index] = self.swarm.now_ms + _FLAPPING_MS
            self._report(f"{self.swarm.robots[index].name} lost its connection: {reason}")

    def receive_bytes(self, index: int, data: bytes) -> None:
        radio, now_ms = self.radios[index], self.swarm.now_ms
        if radio.is_transparent(now_ms):
            self.swarm.robots[index].receive_bytes(now_ms, data)
        else:
            radio.down.put(now_ms, data)
            self._carrying.add(index)
        self._limit_window(index)

    def writing_blocked(self, index: int) -> None:
        self.swarm.robots[index].block_writing(self.swarm.now_ms)
        self.swarm.reschedule(index)

    def writing_resumed(self, index: int) -> None:
        if index in self._congested:
            return  # its channel still blocks it
        self.swarm.robots[index].unblock_writing(self.swarm.now_ms)
        self.swarm.reschedule(index)

    def _report_failure(self, reason: str) -> None:
        if not self._reported_unreachable:
            self._reported_unreachable = True
            self._report(
                "no driver answers at %s:%d (%s); the robots keep trying, as real ones do"
                % (self.link.host, self.link.port, reason)
            )
