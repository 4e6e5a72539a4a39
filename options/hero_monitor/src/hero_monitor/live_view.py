"""Shows stepped robots live in Foxglove, Lichtblick or PlotJuggler, without ROS and without a page.

    with StepSwarm(5) as swarm, LiveView(swarm.rows, range(5)):
        ...  # open ws://127.0.0.1:8088/foxglove

Simulated time is slowed down to real time meanwhile. The server runs in a thread of its own.
"""

import threading
import time
from collections import deque
from concurrent.futures import Future
from contextlib import ExitStack
from typing import Any, Deque, Dict, List, Sequence, Set

from hero_node import ProgramError
from hero_sim.stepped import LATCHED, MessageType, RobotRows, StepTopics

from .foxglove.endpoint import FoxgloveEndpoint, TopicSource
from .foxglove.hub import TopicMessage, TopicType
from .serving.access import Access
from .serving.client_limits import CONNECTIONS_MAX, ClientLimits
from .serving.monotonic_loop import MonotonicLoop
from .serving.server import Server

WAITING_MAX = 20_000
"""Messages between two turns of the server; the oldest are dropped."""


class LiveView(ExitStack):
    """A Foxglove endpoint on this PC that shows robots until close(); then time passes as fast as it can.

    Attributes:
        port: on which it listens.
    """

    def __init__(
        self,
        rows: RobotRows,
        robot_ids: Sequence[int],
        port: int = 8088,
        speed: float = 1.0,
        origins: Sequence[str] = (),
    ) -> None:
        """Listen; robots are those of the first world.

        port: 0 for any that is free. speed: simulated seconds per second. origins: of other servers whose pages may
        connect, such as https://app.foxglove.dev.
        Raises: ProgramError if the port is taken.
        """
        super().__init__()
        self._rows = rows
        self._speed = speed
        self._wanted: Set[str] = set()
        self._waiting: Deque[TopicMessage] = deque(maxlen=WAITING_MAX)
        self._latched: Dict[str, TopicMessage] = {}
        topics = StepTopics(rows, robot_ids, self._receive)
        self._types = {name: TopicType(kind.name, kind.definition) for name, kind in topics.types.items()}
        self._loop: Any = None
        self._start_s = time.monotonic() - rows.now_ms / 1000.0 / speed
        listening: Future[int] = Future()
        thread = threading.Thread(target=self._serve, args=(port, origins, listening), name="live view", daemon=True)
        thread.start()
        try:
            self.port = listening.result()
        except OSError as error:
            topics.close()
            raise ProgramError("cannot listen on port %d: %s; choose another" % (port, error.strerror)) from None
        rows.on_cycle.append(self._pace)
        self.callback(thread.join)
        self.callback(lambda: self._loop.add_callback(self._loop.stop))
        self.callback(rows.on_cycle.remove, self._pace)
        self.callback(topics.close)

    def _pace(self, rows: Any) -> None:
        """Wait until real time has come as far; a program that was slower does not catch up."""
        del rows
        due_s = self._start_s + self._rows.now_ms / 1000.0 / self._speed
        ahead_s = due_s - time.monotonic()
        if ahead_s > 0.0:
            time.sleep(ahead_s)
        else:
            self._start_s -= ahead_s

    def _receive(self, topic: str, kind: MessageType, content: bytes, time_ns: int) -> None:
        """Keep a message that a viewer shows (the program's thread)."""
        del kind
        message = TopicMessage(topic, content, time_ns, "hero_sim" if topic in LATCHED else "")
        if topic in LATCHED:
            self._latched[topic] = message
        elif topic in self._wanted:
            self._waiting.append(message)

    def _serve(self, port: int, origins: Sequence[str], listening: "Future[int]") -> None:
        self._loop = MonotonicLoop()
        endpoint = FoxgloveEndpoint(TopicSource(lambda: self._types, self._want, self._take), origins)
        server = Server(Access(None, ()), ClientLimits(CONNECTIONS_MAX), None, endpoint.route)
        try:
            listening.set_result(server.listen("127.0.0.1", port))
        except OSError as error:
            listening.set_exception(error)
            return
        self._loop.start()
        endpoint.close()
        server.close()
        self._loop.close()

    def _want(self, topics: Set[str]) -> bool:
        for topic in topics - self._wanted:
            if topic in self._latched:
                self._waiting.append(self._latched[topic])
        self._wanted = topics
        return True

    def _take(self) -> List[TopicMessage]:
        return [self._waiting.popleft() for _ in range(len(self._waiting))]
