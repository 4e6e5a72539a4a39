"""The emergency stop in ROS: the service ~stop, the topic ~stop_request, and the stop kept over restarts (store).

Programs connect to ~stop_request at their start, so that it works while the ROS master is dead, hung or slow.
"""

import collections
import functools
import queue
import time
import weakref
from typing import Any, Callable, FrozenSet, Optional

import rospy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, SetBoolResponse

from ..ros.log_relay import LogRelay
from ..ros.robot_commands import Owner, Stops
from ..ros.rospy_internals import find_connection, is_latched_before, list_publishers
from ..transport.call_queue import Worker
from ..transport.event_loop import EventLoop, NoAnswerError
from .store import UNKNOWN_TIME_S, StopStore

ANSWER_WAIT_S = 0.5
"""The thread of the sockets answers within milliseconds; a service call must not hang where it does not."""

KEEP_WAIT_S = 1.0
"""Likewise the disk: writing took 0.3 to 45 ms; one that hangs (a network's, a failing card) is told of."""


class StopInterface:
    """The stop of all robots, as ROS sees it."""

    def __init__(self, loop: EventLoop, fleet: Owner, store: StopStore, log: LogRelay) -> None:
        """Serve nothing before open(); the loop's thread owns fleet, and store keeps the stop."""
        self._loop = loop
        self._fleet = fleet
        self._store = store
        self._log = log
        self._request_topic = rospy.resolve_name("~stop_request")
        self._earlier: Optional[FrozenSet[str]] = frozenset()  # publishers that were there before
        self._heard: weakref.WeakSet[Any] = weakref.WeakSet()  # connections that have brought a request
        self._publisher = rospy.Publisher("~stopped", Bool, queue_size=1, latch=True)
        self._stopped = False
        self.stopped_by = ""
        """Node that stopped the robots; empty if they are not, or were stopped before the driver's start."""
        self.stopped_s: Optional[float] = None  # monotonic; None: not stopped, or unknown
        self._keeper = Worker("stop keeper", 100, "~stopped was not published", functools.partial(log.log, "error"))

    def open(self, stopped: bool, since_s: Optional[float]) -> None:
        """Serve; begin as stopped says. The loop does not run yet. since_s: as StopStore.read_since() returns it."""
        self._fleet.set_stopped(stopped)
        self._stopped = stopped
        self._keeper.submit(self._keep)
        if stopped:
            begin = "from the start (~start_stopped)" if since_s is None else "since " + describe_time(since_s)
            if since_s != UNKNOWN_TIME_S:
                self.stopped_s = time.monotonic() - (0.0 if since_s is None else max(0.0, time.time() - since_s))
            text = "all robots are stopped %s; this releases them: rosservice call %s false"
            self._log.log("warn", text % (begin, rospy.resolve_name("~stop")))
        self._publisher.publish(Bool(stopped))
        self._earlier = list_publishers(self._request_topic, Bool._type)
        rospy.Subscriber("~stop_request", Bool, self._take_request, queue_size=10, tcp_nodelay=True)
        rospy.Service("~stop", SetBool, self._serve)

    def _keep(self) -> str:
        """Write to disk whether robots are stopped now; return what is lost if that fails (on the keeper's thread)."""
        stopped = self._stopped
        try:
            self._store.write(stopped)
        except OSError as error:
            lost = "the stop will not survive" if stopped else "whether robots are stopped may not survive"
            reason = f"{self._store.path} cannot be written ({error.strerror})"
            text = f"{lost} a restart of the driver: {reason}"
            self._log.log_throttled("warn", text, text + "; make it writable, or set ROS_HOME to another folder")
            return text
        return ""

    def _await_kept(self) -> str:
        """Return when it is on the disk whether robots are stopped; if it is not, what is lost."""
        outcomes: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._keeper.submit(lambda: outcomes.put(self._keep()))
        try:
            return outcomes.get(timeout=KEEP_WAIT_S)
        except queue.Empty:
            text = f"not yet written to {self._store.path}, which hangs: a restart of the driver may lose it"
            self._log.log_throttled("warn", text, text)
            return text

    def close(self) -> None:
        """Keep nothing any more once what was asked for is kept; safe to call twice."""
        self._keeper.close(drain=True)

    def _serve(self, request: Any) -> SetBoolResponse:
        stopped = bool(request.data)
        caller = str(request._connection_header.get("callerid", ""))

        def set_and_answer(answer: Callable[[Stops], None]) -> None:
            self._set(stopped, caller)
            answer(self._fleet.list_stops())

        try:
            stops = self._loop.ask(set_and_answer, ANSWER_WAIT_S)
        except NoAnswerError:
            return SetBoolResponse(False, "NOT STOPPED: the driver hangs" if stopped else "the driver hangs")
        parts = [describe_stop(stops) if stopped else "robots may move", self._await_kept()]
        return SetBoolResponse(True, "; ".join(filter(None, parts)))

    def _take_request(self, message: Bool) -> None:
        stopped = bool(message.data)
        connection = find_connection(self._request_topic, message)
        is_first = connection is not None and connection not in self._heard
        if is_first:
            self._heard.add(connection)
            if not stopped and is_latched_before(connection, self._earlier):
                text = "a release on ~stop_request was refused, because it is from before the driver was there"
                self._log.log("warn", text)
                return
        caller = str(message._connection_header.get("callerid", ""))
        self._loop.call_soon(lambda: self._set(stopped, caller))

    def _set(self, stopped: bool, caller: str) -> None:
        """Runs on the thread of the sockets."""
        changed = stopped is not self._fleet.stopped
        if not changed and not stopped:
            return
        self._fleet.set_stopped(stopped)
        if changed:
            self._stopped = stopped
            self.stopped_by, self.stopped_s = (caller, time.monotonic()) if stopped else ("", None)
            # Published and written elsewhere: both may block.
            self._keeper.submit(self._keep)
            self._keeper.submit(lambda: self._publisher.publish(Bool(stopped)))
            self._log.log("warn", f"{'stopping all robots' if stopped else 'robots may move'}, by {caller or '?'}")


def describe_time(since_s: float) -> str:
    """Return a time (s since 1970) for users."""
    if since_s == UNKNOWN_TIME_S:
        return "an unknown time"
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(since_s))


def describe_stop(stops: Stops) -> str:
    """Return how many robots are in which state of a stop, for users, such as "2 AT_REST, 1 AWAY"."""
    counts = collections.Counter("AWAY" if state is None else state.name for state in stops)
    return ", ".join(f"{count} {name}" for name, count in counts.items()) or "no robot is connected"
