"""Simulated time <-> the wall clock: runs a swarm behind its TCP connections.

The only file that reads a clock. It asks the swarm to catch up, carries bytes both ways, and waits.
"""

import time
from typing import Callable, List, Optional, Set

from .link import tcp_link
from .link.tcp_link import TcpLink
from .link.wifi import Radio
from .robot_constants import RECEIVE_WINDOW_LENGTH
from .swarm import Swarm

_LONGEST_WAIT_S = 0.05
"""So that a stop from a signal or another thread is seen soon."""

_SHORTEST_WAIT_S = 0.0005

_FLAPPING_MS = 5000
"""A server that closes every connection at once gets one pair of lines per robot in this time."""

_LATE_S = 1.0
"""More behind the wall clock than this (a machine that slept), and the time is given up, not caught up."""


class Simulator:
    """Runs one swarm.

    Attributes:
        swarm, link: what it joins.
        stopping: set from anywhere to end run().
        late_s: wall-clock time given up because the machine was too slow or asleep.
    """

    def __init__(
        self,
        swarm: Swarm,
        link: TcpLink,
        radios: List[Radio],
        report: Callable[[str], None],
        speed: float = 1.0,
    ) -> None:
        """Join a swarm, its radios and their link; speed is simulated seconds per second of wall clock."""
        self.swarm = swarm
        self.link = link
        self.radios = radios
        self.speed = speed
        self.stopping = False
        self.paused = False
        self.late_s = 0.0
        self.before_advance: Optional[Callable[[int], None]] = None
        self._report = report
        self._said_unreachable = False
        self._said_connected = [False] * len(swarm.robots)
        self._quiet_until_ms = [0] * len(swarm.robots)
        self._away_until_ms = [0] * len(swarm.robots)
        self._carrying: Set[int] = set()
        self._full: Set[int] = set()

    def run(self, seconds: Optional[float] = None) -> None:
        """Run until stopping is set, or for so many simulated seconds."""
        swarm = self.swarm
        end_ms = None if seconds is None else swarm.now_ms + int(seconds * 1000)
        anchor_s, anchor_ms = time.monotonic(), swarm.now_ms
        while not self.stopping and (end_ms is None or swarm.now_ms < end_ms):
            now_s = time.monotonic()
            wanted_ms = anchor_ms + int((now_s - anchor_s) * 1000 * self.speed)
            if self.paused:
                anchor_s, anchor_ms = now_s, swarm.now_ms
                wanted_ms = swarm.now_ms
            elif wanted_ms - swarm.now_ms > _LATE_S * 1000 * self.speed:
                self._give_up((wanted_ms - swarm.now_ms) / 1000.0 / self.speed)
                anchor_s, anchor_ms = now_s, swarm.now_ms
                wanted_ms = swarm.now_ms + 1
            if end_ms is not None:
                wanted_ms = min(wanted_ms, end_ms)
            if self.before_advance is not None:
                self.before_advance(swarm.now_ms)
            if not self.paused:
                for index in swarm.advance(wanted_ms):
                    self.serve_robot(index)
            if self._carrying:
                self._carry(swarm.now_ms)
            for index in list(self._full):
                self._limit_window(index)
            wait_s = _LONGEST_WAIT_S
            if not self.paused:
                next_ms = min(swarm.next_due_ms, swarm.world.time_ms + 10)
                wait_s = (next_ms - anchor_ms) / 1000.0 / self.speed - (time.monotonic() - anchor_s)
            for event in self.link.poll(min(max(wait_s, _SHORTEST_WAIT_S), _LONGEST_WAIT_S)):
                self._take_event(event)

    def _give_up(self, late_s: float) -> None:
        if self.late_s == 0.0:
            self._report(
                "this machine was busy or asleep for %.1f s; the robots stood still meanwhile (said once; "
                "if it is too slow, take fewer robots or a lower --speed)" % late_s
            )
        self.late_s += late_s

    def serve_robot(self, index: int) -> None:
        """Carry away what a robot wants to send, and dial for it if it wants that."""
        robot = self.swarm.robots[index]
        if robot.outbox:
            self._carry_up(index, robot.outbox)
            robot.outbox.clear()
        if robot.crash_reason is not None:
            self._report(
                "%s crashed: the server sent %s; the robot restarts" % (robot.name, robot.crash_reason)
            )
            self.reboot(index)
        elif robot.wants_connection:
            self._connect(index)

    def _carry_up(self, index: int, pieces: List[bytes]) -> None:
        radio, link, now_ms = self.radios[index], self.link, self.swarm.now_ms
        if not radio.is_transparent(now_ms):
            for data in pieces:
                radio.put_up(now_ms, data)
            self._carrying.add(index)
            return
        if link.has_unsent(index):
            # The firmware's write ran into its limit of 5 s: what is left of it is lost, half a frame
            # perhaps.
            link.drop_unsent(index)
        for data in pieces:
            link.send(index, data)

    def _carry(self, now_ms: int) -> None:
        """Let through what has arrived over the radios."""
        for index in list(self._carrying):
            radio = self.radios[index]
            up = radio.take_up(now_ms)
            if up:
                self.link.send(index, up)
            down = radio.take_down(now_ms)
            if down:
                self.swarm.robots[index].receive_bytes(now_ms, down)
            if not radio.is_carrying:
                self._carrying.discard(index)

    def _limit_window(self, index: int) -> None:
        """Leave what comes to the system while a robot's receive window is full, so that the sender feels it."""
        waiting_length = self.swarm.robots[index].received_length + self.radios[index].down_length
        if waiting_length >= RECEIVE_WINDOW_LENGTH:
            self._full.add(index)
        else:
            self._full.discard(index)
        self.link.pause(index, index in self._full)

    def _connect(self, index: int) -> None:
        robot = self.swarm.robots[index]
        now_ms = self.swarm.now_ms
        if self.link.serve and self.link.is_open(index):
            robot.connection_made(now_ms)
        elif self.link.serve or now_ms < self._away_until_ms[index]:
            robot.connection_failed(now_ms)
        elif self.link.is_dialling(index):
            # The firmware gave up after 5 s and tries again; the attempt under way is as good as a new one.
            self._report_failure("no answer within 5 s")
            return
        else:
            self.link.dial(index)
            return
        self.swarm.reschedule(index)

    def _drop_connection(self, index: int, orderly: bool) -> None:
        if orderly:
            self.link.close(index)
        else:
            self.link.abandon(index)
        self.radios[index].clear()
        self.swarm.robots[index].connection_lost()
        self._said_connected[index] = False

    def switch_off(self, index: int) -> None:
        """Cut a robot's power: the driver gets no word of it."""
        self._drop_connection(index, orderly=False)
        self.swarm.robots[index].switch_off()
        self.swarm.reschedule(index)

    def reboot(self, index: int, robot_id: Optional[int] = None) -> None:
        """Restart a robot at once; its old connection is left without a word, as by a real one."""
        self.switch_off(index)
        self.swarm.robots[index].switch_on(self.swarm.now_ms, robot_id)
        self.swarm.reschedule(index)

    def leave(self, index: int, for_ms: int) -> None:
        """Close a robot's connection and keep it from dialling for for_ms."""
        self._away_until_ms[index] = self.swarm.now_ms + for_ms
        self._drop_connection(index, orderly=True)

    def _take_event(self, event: tcp_link.LinkEvent) -> None:
        robot = self.swarm.robots[event.robot_index]
        now_ms = self.swarm.now_ms
        if event.kind == tcp_link.DATA:
            radio = self.radios[event.robot_index]
            if radio.is_transparent(now_ms):
                robot.receive_bytes(now_ms, event.data)
            else:
                radio.put_down(now_ms, event.data)
                self._carrying.add(event.robot_index)
            self._limit_window(event.robot_index)
            return
        if event.kind == tcp_link.MADE:
            if robot.is_on:
                robot.connection_made(now_ms)
            self._report_connection(event.robot_index)
        elif event.kind == tcp_link.FAILED:
            self._report_failure(event.data.decode())
            robot.connection_failed(now_ms)
        elif event.kind == tcp_link.LOST:
            self.radios[event.robot_index].clear()
            robot.connection_lost()
            if now_ms >= self._quiet_until_ms[event.robot_index]:
                self._said_connected[event.robot_index] = False
                self._quiet_until_ms[event.robot_index] = now_ms + _FLAPPING_MS
                self._report("%s lost its connection: %s" % (robot.name, event.data.decode()))
        elif event.kind == tcp_link.BLOCKED:
            robot.block_writing(now_ms)
        else:
            robot.unblock_writing(now_ms)
        self.swarm.reschedule(event.robot_index)
        self.serve_robot(event.robot_index)

    def _report_connection(self, index: int) -> None:
        self._said_unreachable = False
        if not self._said_connected[index]:
            self._said_connected[index] = True
            self._report("%s connected" % self.swarm.robots[index].name)

    def _report_failure(self, reason: str) -> None:
        if not self._said_unreachable:
            self._said_unreachable = True
            self._report(
                "no driver answers at %s:%d (%s); the robots go on trying, as real ones do"
                % (self.link.host, self.link.port, reason)
            )
