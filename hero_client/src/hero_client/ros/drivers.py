"""All drivers under this ROS master as one: their robots in one list, a stop for all of them at once.

Several PCs may have a driver each (docs/several_machines.md). That of the usual name is connected to at once; for
others the master is asked every few seconds. Where the usual topic is remapped, only that one driver is used.

Threads: only the finder waits for the ROS master; only the sender sends requests. Neither a master nor a driver that
hangs delays a stop, because the topics to drivers are open before it is needed.
"""

import contextlib
import math
import threading
import time
from functools import lru_cache
from typing import Any, Dict, FrozenSet, Iterable, List, Optional, Sequence, Set

import rospy
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from hero_msgs.msg import Robot, RobotArray
from hero_node import NodeError, ProgramError, list_names
from hero_node.ros import ask_master

from ..values.background_motion import Sleep
from ..values.errors import RobotNotReadyError
from ..values.robot_states import STATES
from .stop_status import TIME_LIMIT_S, Replies, StopRequest, StopStatus

USUAL_TOPIC = "/hero_driver/robots"
SUFFIX = "/robots"
FIND_PERIOD_S = 3.0
REPEAT_PERIOD_S = 0.1
SETTLE_LOOKS = 3
"""At the third look, 6 s after the first one, a driver that the master knows has reported, unless it hangs or died
without unregistering. Looks, not seconds: a program that was kept from running has heard no driver either."""

FORGET_S = 5.0
"""Reports come once per second. Robots of a driver that is silent for longer than the others are no longer listed."""

SILENT_S = 2.5
"""A driver whose last report is older does not answer."""

POLL_PERIOD_S = 0.02

PREFERENCE = (Robot.READY, Robot.JOINING, Robot.AWAY)
"""If a robot has moved from one driver to another, the entry that counts."""


def find_drivers(system_state: Any, topics: Iterable[str]) -> Set[str]:
    """Return those of the topics that are reports of drivers.

    A driver is a node that publishes NAME/robots and offers the service NAME/stop, where NAME is its own. A robot can
    declare such topics and services, but they are those of its driver's node.
    system_state: the ROS master's answer to getSystemState.
    """
    publishers, _, services = (dict(part) for part in system_state)
    names = {topic: driver_of(topic) for topic in topics}
    return {
        topic
        for topic, name in names.items()
        if name in publishers.get(topic, ()) and name in services.get(name + "/stop", ())
    }


def driver_of(topic: str) -> str:
    """Return the name of the driver that has this topic."""
    return topic.rpartition("/")[0]


def merge(reports: Sequence[RobotArray]) -> RobotArray:
    """Return one report for several drivers: stopped if all of them are, and each robot once, by namespace."""
    merged = RobotArray()
    merged.header.stamp = max((report.header.stamp for report in reports), default=merged.header.stamp)
    merged.listening = ", ".join(sorted(report.listening for report in reports if report.listening))
    merged.stopped = all(report.stopped for report in reports)
    by_name: Dict[str, Robot] = {}
    for robot in (robot for report in reports for robot in report.robots):
        # A refused or still unnamed robot is not the robot of that name.
        own = robot.namespace if robot.namespace and robot.state in PREFERENCE else None
        key = own or f"{robot.namespace} at {robot.address}"
        known = by_name.get(key)
        if known is None or own is None or PREFERENCE.index(robot.state) < PREFERENCE.index(known.state):
            by_name[key] = robot
    merged.stopped_by = ", ".join(sorted({report.stopped_by for report in reports if report.stopped_by}))
    merged.stopped_since = max((report.stopped_since for report in reports), default=merged.stopped_since)
    gone = {robot.namespace: robot for report in reports for robot in report.gone if robot.namespace not in by_name}
    merged.gone = sorted(gone.values(), key=lambda robot: robot.id)
    merged.robots = sorted(by_name.values(), key=lambda robot: (robot.namespace, robot.address))
    return merged


class _DriverLink:
    """One driver: its newest report, and a way to ask for a stop that needs no ROS master."""

    def __init__(self, driver: str, reports_topic: str) -> None:
        """Open the topics; waits for the ROS master.

        driver: the name of the node. Reports of any other node are ignored: a robot can declare topics, and a driver
        publishes them under its own name.
        """
        self.driver = driver
        self.count = 0
        self.report: Optional[RobotArray] = None
        self.arrival_s = -math.inf
        self.stopped_robots: FrozenSet[str] = frozenset()
        self.models: Dict[str, str] = {}
        self._lock = threading.Lock()
        self._is_closed = False
        # Not latched: a driver that starts later must not find an old request.
        self._requests = rospy.Publisher(driver + "/stop_request", Bool, queue_size=1, tcp_nodelay=True)
        self._reports = rospy.Subscriber(reports_topic, RobotArray, self._receive, queue_size=1, tcp_nodelay=True)

    def _receive(self, report: RobotArray) -> None:
        if report._connection_header.get("callerid") == self.driver:
            stopped = [robot.namespace for robot in report.robots if robot.state in (Robot.READY, Robot.JOINING)]
            self.stopped_robots = frozenset(stopped if report.stopped else ())
            self.models = {robot.namespace: robot.model for robot in report.robots if robot.model}
            with self._lock:
                self.report, self.arrival_s = report, time.monotonic()
                self.count += 1

    def newest(self, since_s: float = -math.inf) -> Optional[RobotArray]:
        """Return the newest report if it came after since_s."""
        with self._lock:
            return self.report if self.arrival_s > since_s else None

    @property
    def is_connected(self) -> bool:
        """Return whether a driver that has reported is still connected; it may hang all the same."""
        with self._lock:
            if self._is_closed or self.report is None:
                return False
            return self._reports.get_num_connections() > 0

    def request_stop(self, stopped: bool) -> bool:
        """Ask the driver to stop its robots, or to release them; return whether it is connected.

        rospy sends on a thread per connection.
        """
        with self._lock:
            if self._is_closed:
                return False
            is_connected = bool(self._requests.get_num_connections() > 0)
            self._requests.publish(stopped)
            return is_connected

    def close(self) -> None:
        """Close the topics; waits for the ROS master. Safe twice."""
        with self._lock:
            self._is_closed = True
        self._requests.unregister()
        self._reports.unregister()


@lru_cache(maxsize=None)
def share_drivers() -> "Drivers":
    """Return the connections that all Robot and Swarm objects of the program share; needs a started node."""
    return Drivers()


class Drivers:
    """Connections to all drivers. Methods are safe on any thread; none waits for the ROS master."""

    def __init__(self) -> None:
        """Connect; needs a started node."""
        self._usual = rospy.resolve_name(USUAL_TOPIC)
        self._links: Dict[str, _DriverLink] = {}  # replaced, never changed: read on all threads
        self._listed: Set[str] = set()
        self._request: Optional[StopRequest] = None
        self._start_s = time.monotonic()
        self._looks = 0
        self._has_found = False  # whether the master has told who the drivers are
        self._end = threading.Event()
        self._wake = threading.Event()
        rospy.on_shutdown(self.close)
        threading.Thread(target=self._find, name="drivers", daemon=True).start()
        threading.Thread(target=self._ask, name="stop requests", daemon=True).start()

    # -- finding them (a thread of its own) -----------------------------------------------------------------

    def _find(self) -> None:
        self._links = {self._usual: _DriverLink(driver_of(self._usual), self._usual)}
        while not self._end.is_set():
            if self._usual != USUAL_TOPIC:
                self._listed = {self._usual}
                self._has_found = True
            else:
                self._look()
            self._looks += 1
            self._end.wait(FIND_PERIOD_S)
        if not rospy.core.is_shutdown_requested():  # else rospy closes all topics at once
            for link in self._links.values():
                link.close()

    def _look(self) -> None:
        try:
            published = ask_master("getPublishedTopics", "/")
            listed = {topic for topic, kind in published if kind == RobotArray._type and topic.endswith(SUFFIX)}
            if not listed <= self._listed:
                listed = (listed & self._listed) | find_drivers(ask_master("getSystemState"), listed - self._listed)
        except NodeError:
            return  # it may return; keep what is known
        new = {topic: _DriverLink(driver_of(topic), topic) for topic in listed - set(self._links)}
        # The usual driver may be started again at any time. Others come under any name, and are forgotten.
        gone = {
            topic: link
            for topic, link in self._links.items()
            if topic not in listed and topic != self._usual and not link.is_connected
        }
        self._listed = listed
        self._links = {**{topic: link for topic, link in self._links.items() if topic not in gone}, **new}
        self._has_found = True
        for link in gone.values():
            link.close()

    # -- what they report -----------------------------------------------------------------------------------

    def _find_known(self) -> List[_DriverLink]:
        """Return the drivers that the master knows or that are connected."""
        return [link for topic, link in self._links.items() if topic in self._listed or link.is_connected]

    @property
    def is_settled(self) -> bool:
        """Return whether every driver that the master knows has reported, or had the time to."""
        if self._looks >= SETTLE_LOOKS:
            return True
        return self._has_found and all(link.report is not None for link in self._find_known())

    def knows(self, namespace: str) -> bool:
        """Return whether a driver has reported the robot with this namespace, or every driver had the time to."""
        if self.is_settled:
            return True
        reports = [link.report for link in self._links.values() if link.report is not None]
        return any(robot.namespace == namespace for report in reports for robot in report.robots)

    def _find_fresh(self) -> List[_DriverLink]:
        """Return the drivers that have reported, without those that are silent for longer than the others."""
        links = self._links.values()
        limit_s = max((link.arrival_s for link in links), default=0.0) - FORGET_S
        return [link for link in links if link.arrival_s > limit_s]

    def read_each(self) -> Dict[str, RobotArray]:
        """Return the newest report of each driver by its name, without those silent for longer than the others."""
        newest = {link.driver: link.newest() for link in self._find_fresh()}
        return {driver: report for driver, report in newest.items() if report is not None}

    def read(self) -> Optional[RobotArray]:
        """Return the newest reports of all drivers in one; None until there is one.

        It says stopped only if every driver says so, and none is silent.
        """
        reports = self.read_each()
        if not reports:
            return None
        merged = merge(list(reports.values()))
        merged.stopped = merged.stopped and not self.find_silent()
        return merged

    def list_ready(self) -> List[int]:
        """Return the numbers of the robots that can be driven now, sorted."""
        report = self.read()
        robots = report.robots if report else ()
        return sorted(robot.id for robot in robots if robot.state == Robot.READY and robot.id >= 0)

    def wait_for_robots(self, timeout_s: float, sleep: Sleep, robot_ids: Optional[Sequence[int]] = None) -> List[int]:
        """Return the numbers of all robots that can be driven, sorted, as soon as those of robot_ids are among them.

        After timeout_s some of them suffice. None: as soon as there is one, and every driver has reported.
        Raises: RobotNotReadyError after timeout_s without a driver or without a robot.
        """
        ready: List[int] = []
        deadline_s = time.monotonic() + timeout_s
        while time.monotonic() < deadline_s and sleep(POLL_PERIOD_S):
            ready = self.list_ready()
            if ready and (self.is_settled if robot_ids is None else set(ready).issuperset(robot_ids)):
                return ready
        if not self.read_each():
            raise RobotNotReadyError(f"nothing on {USUAL_TOPIC} within {timeout_s:.3g} s: is the driver running?")
        if not ready or robot_ids is None:
            raise RobotNotReadyError(f"no robot joined the driver within {timeout_s:.3g} s: are they on?")
        return ready

    def dismiss_gone(self) -> None:
        """Ask all drivers to list robots that are gone no longer; waits for the ROS master and the drivers."""
        for driver in self.names():
            with contextlib.suppress(rospy.ServiceException):
                rospy.ServiceProxy(driver + "/dismiss_gone", Trigger)()

    def count(self) -> int:
        """Return how many reports came so far, to see whether there are new ones."""
        return sum(link.count for link in self._links.values())

    def find_silent(self) -> List[str]:
        """Return the names of the drivers that have reported before and do not now, or that the master knows."""
        limit_s = time.monotonic() - SILENT_S
        if limit_s < self._start_s:
            return []
        return [link.driver for link in self._find_known() if link.newest(limit_s) is None]

    def find_answering(self, limit_s: float) -> Dict[str, bool]:
        """Return for each driver that ever reported whether it is connected and has reported within limit_s."""
        since_s = time.monotonic() - limit_s
        return {
            link.driver: link.is_connected and link.newest(since_s) is not None
            for link in self._links.values()
            if link.report is not None
        }

    def names(self) -> List[str]:
        """Return the drivers that are known; without one, the usual one."""
        return sorted(link.driver for link in self._find_known()) or [driver_of(self._usual)]

    def find(self, namespace: str) -> str:
        """Return the driver of a robot; the usual one if none has it."""
        having = [
            (PREFERENCE.index(robot.state), driver)
            for driver, report in self.read_each().items()
            for robot in report.robots
            if robot.namespace == namespace and robot.state in PREFERENCE
        ]
        return min(having, default=(0, driver_of(self._usual)))[1]

    def is_stopped(self, driver: str) -> bool:
        """Return whether a driver has stopped all its robots."""
        report = self.read_each().get(driver)
        return report is not None and bool(report.stopped)

    def is_robot_stopped(self, namespace: str) -> bool:
        """Return whether a robot takes no motion because all robots of its driver are stopped.

        Called for each command, so it only looks the robot up in what was prepared when the report arrived.
        """
        return any(namespace in link.stopped_robots for link in self._find_fresh())

    def find_model(self, namespace: str) -> str:
        """Return the name of a robot's model; "" while it is not known."""
        return next((link.models[namespace] for link in self._links.values() if namespace in link.models), "")

    def explain_absence(self, namespace: str) -> str:
        """Return why a robot takes no commands, as far as the drivers tell, for users."""
        report = self.read()
        if report is None:
            return "no driver answers; start one: roslaunch hero_bringup hero_bringup.launch"
        for robot in report.robots:
            if robot.namespace == namespace:
                reason = ": " + robot.last_error if robot.last_error else ""
                return f"the driver reports {namespace.strip('/')} as {STATES[robot.state]}{reason}"
        names = [robot.namespace.strip("/") for robot in report.robots if robot.state == Robot.READY]
        return "connected are %s: is the robot on, and its id right?" % (list_names(names) or "no robots")

    # -- stop requests --------------------------------------------------------------------------------------

    def request_stop(self, stopped: bool) -> None:
        """Ask all drivers to stop all their robots, or to release them; returns at once.

        Each is asked again until it reports that it stopped; for a release each is asked once.
        """
        self._request = StopRequest(stopped, time.monotonic())
        self._wake.set()

    def stop_status(self) -> Optional[StopStatus]:
        """Return the status of the last request; None before the first one."""
        request, now_s = self._request, time.monotonic()
        if request is None:
            return None
        replies = self._read_replies(request, now_s)
        return request.describe(replies, merge([report for report in replies.values() if report]).robots, now_s)

    def wait_for_stop(self, timeout_s: float = TIME_LIMIT_S) -> Optional[StopStatus]:
        """Return the status as soon as the outcome is known, or what is known after timeout_s."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            status = self.stop_status()
            if status is None or status.is_final or time.monotonic() > deadline_s:
                return status
            time.sleep(POLL_PERIOD_S)

    def check_stop(self) -> None:
        """Wait until the outcome of the last stop or release is known, 1.5 s at most; for the end of a program.

        Raises: ProgramError with the robots and drivers that did not obey.
        """
        status = self.wait_for_stop()
        if status is not None and status.level == "error":
            raise ProgramError(status.text)

    def _read_replies(self, request: StopRequest, now_s: float) -> Replies:
        since_s = max(request.made_s, now_s - SILENT_S)
        replies = {link.driver: link.newest(since_s) for link in self._find_known()}
        return replies or {driver_of(self._usual): None}

    def _ask(self) -> None:
        """Send what was requested at once, and again while a driver has not taken it (a thread of its own)."""
        while not self._end.is_set():
            request, now_s = self._request, time.monotonic()
            if request is not None:
                request.update(self._read_replies(request, now_s), self._has_found, now_s)
                for link in self._links.values():
                    if request.is_open_to(link.driver) and link.request_stop(request.stopped):
                        request.note_asked(link.driver)
            self._wake.wait(None if request is None or request.is_over else REPEAT_PERIOD_S)
            self._wake.clear()

    def close(self) -> None:
        """Disconnect; the topics are closed later. Safe twice."""
        self._end.set()
        self._wake.set()
