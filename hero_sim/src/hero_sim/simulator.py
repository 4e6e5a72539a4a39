"""Simulated time <-> the wall clock: runs a swarm behind its TCP connections.

The only file that reads a clock. It asks the swarm to catch up, carries bytes both ways, and waits.
"""

import time
from typing import Callable, List, Optional

from . import tcp_link
from .swarm import Swarm
from .tcp_link import TcpLink

_LONGEST_WAIT_S = 0.05
"""So that a stop from a signal or another thread is seen soon."""

_SHORTEST_WAIT_S = 0.0005

_LATE_S = 1.0
"""More behind the wall clock than this (a machine that slept), and the time is given up, not caught up."""


class Simulator:
    """Runs one swarm.

    Attributes:
        swarm, link: what it joins.
        stopping: set from anywhere to end run().
        late_s: wall-clock time given up because the machine was too slow or asleep.
    """

    def __init__(self, swarm: Swarm, link: TcpLink, report: Callable[[str], None], speed: float = 1.0) -> None:
        """Join swarm and link; speed is simulated seconds per second of wall clock."""
        self.swarm = swarm
        self.link = link
        self.speed = speed
        self.stopping = False
        self.paused = False
        self.late_s = 0.0
        self.before_advance: Optional[Callable[[int], None]] = None
        self._report = report
        self._said_unreachable = False
        self._said_connected = [False] * len(swarm.robots)

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
                self.late_s += (wanted_ms - swarm.now_ms) / 1000.0 / self.speed
                anchor_s, anchor_ms = now_s, swarm.now_ms
                wanted_ms = swarm.now_ms + 1
            if end_ms is not None:
                wanted_ms = min(wanted_ms, end_ms)
            if self.before_advance is not None:
                self.before_advance(swarm.now_ms)
            self._serve(swarm.advance(wanted_ms) if not self.paused else range(0))
            wait_s = _LONGEST_WAIT_S
            if not self.paused:
                next_ms = min(swarm.next_due_ms, swarm.world.time_ms + 10)
                wait_s = (next_ms - anchor_ms) / 1000.0 / self.speed - (time.monotonic() - anchor_s)
            for event in self.link.poll(min(max(wait_s, _SHORTEST_WAIT_S), _LONGEST_WAIT_S)):
                self._take_event(event)

    def _serve(self, touched: List[int]) -> None:
        for index in touched:
            self.serve_robot(index)

    def serve_robot(self, index: int) -> None:
        """Carry away what a robot wants to send, and dial for it if it wants that."""
        robot = self.swarm.robots[index]
        if robot.outbox:
            for data in robot.outbox:
                self.link.send(index, data)
            robot.outbox.clear()
        if robot.crash_reason is not None:
            self._crash(index, robot.crash_reason)
        elif robot.wants_connection and not self.link.serve:
            if not self.link.is_dialling(index):
                self.link.dial(index)
        elif robot.wants_connection:
            robot.connection_failed(self.swarm.now_ms)
            self.swarm.reschedule(index)

    def _crash(self, index: int, reason: str) -> None:
        """A frame came that a real robot does not survive: it starts again, without closing anything."""
        robot = self.swarm.robots[index]
        self._report("%s crashed: the server sent %s; the robot restarts" % (robot.name, reason))
        self.reboot(index)

    def reboot(self, index: int, robot_id: Optional[int] = None) -> None:
        """Restart a robot at once; its old connection is left without a word, as by a real one."""
        robot = self.swarm.robots[index]
        self.link.abandon(index)
        robot.connection_lost()
        robot.switch_off()
        robot.switch_on(self.swarm.now_ms, robot_id)
        self.swarm.reschedule(index)

    def _take_event(self, event: tcp_link.LinkEvent) -> None:
        robot = self.swarm.robots[event.index]
        now_ms = self.swarm.now_ms
        if event.kind == tcp_link.DATA:
            robot.receive_bytes(now_ms, event.data)
            return
        if event.kind == tcp_link.MADE:
            if robot.is_on:
                robot.connection_made(now_ms)
            self._report_connection(event.index)
        elif event.kind == tcp_link.FAILED:
            self._report_failure(event.data.decode())
            robot.connection_failed(now_ms)
        elif event.kind == tcp_link.LOST:
            robot.connection_lost()
            self._said_connected[event.index] = False
            self._report("%s lost its connection: %s" % (robot.name, event.data.decode()))
        elif event.kind == tcp_link.BLOCKED:
            robot.block_writing(now_ms)
        else:
            robot.unblock_writing(now_ms)
        self.swarm.reschedule(event.index)
        self.serve_robot(event.index)

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
