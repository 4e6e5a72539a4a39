"""One robot's jobs for the registrar: they may be held back for a while, and go with the robot's connection.

A program that comes under ever new names would otherwise keep the ROS master, the registrar and Python's one lock
busy: each name is 20 calls to the master, and as many when it is gone. A robot that returns declares everything
again, so nothing is missing when the jobs of its last connection are left out.
Everything here runs on the thread of the sockets, except the jobs.
"""

from typing import Callable, List

from .worker import Job, Worker

HELD_MAX = 1000
"""Jobs that are held back for one robot; a stock robot has 24."""

CallLater = Callable[[float, Callable[[], None]], None]


class RobotRegistrar:
    """What the bridge of one robot sees of the registrar, over all connections of that robot."""

    def __init__(self, registrar: Worker, call_later: CallLater) -> None:
        self._registrar = registrar
        self._call_later = call_later
        self._held: List[Job] = []
        self._is_holding = False
        self._connection = 0

    def begin(self, hold_s: float) -> None:
        """A connection stands; its jobs are held back for hold_s."""
        self._connection += 1
        self._is_holding = hold_s > 0.0
        if self._is_holding:
            connection = self._connection
            self._call_later(hold_s, lambda: self._let_go(connection))

    def end(self) -> None:
        """The connection is gone, and what it left to be done."""
        self._connection += 1
        self._held.clear()

    def submit(self, job: Job, always: bool = False) -> bool:
        """Queue job; return False if too many wait. With always it is done whatever becomes of the connection."""
        if always:
            return self._registrar.submit(job, always=True)
        if not self._is_holding:
            return self._queue(job)
        if len(self._held) >= HELD_MAX:
            return False
        self._held.append(job)
        return True

    def _let_go(self, connection: int) -> None:
        if connection != self._connection:
            return
        self._is_holding = False
        held, self._held = self._held, []
        for job in held:
            self._queue(job)

    def _queue(self, job: Job) -> bool:
        connection = self._connection

        def do() -> None:
            if connection == self._connection:
                job()

        return self._registrar.submit(do)
