"""All drivers under this ROS master as one: their robots in one list, their stops at once.

Several PCs may have a driver each (docs/several_machines.md). A driver is who publishes a hero_msgs/RobotArray on
NAME/robots. That of the usual name is listened to at once; for others the master is asked now and then, on a thread of
its own, because it may take its time. Where the usual topic is remapped, that one driver is meant and no other.
"""

import threading
import time
from typing import Callable, Dict, List, Optional, Set

import rosgraph
import rospy
from std_srvs.srv import SetBool

from hero_msgs.msg import Robot, RobotArray

from .newest_message import NewestMessage

USUAL_TOPIC = "/hero_driver/robots"
SUFFIX = "/robots"
LOOK_PERIOD_S = 3.0
SETTLE_S = 1.5
"""A driver that the master knows has said something by then, unless it died without a word."""

SILENT_S = 5.0
"""Reports come once a second. Who is silent for longer than the others is taken for dead."""

PREFERENCE = (Robot.READY, Robot.JOINING, Robot.AWAY)
"""Of a robot that went from one driver to another, the entry that counts."""

Tell = Callable[[str, Optional[str]], None]
"""Takes the name of a driver and why it did not do what it was asked for, None if it did; on any thread."""


class Drivers:
    """Listens to all drivers from now on.

    read(), find() and names() are for one thread; close() ends the listening.
    """

    def __init__(self) -> None:
        self._usual = rospy.resolve_name(USUAL_TOPIC)
        self._lock = threading.Lock()
        self._topics: Dict[str, NewestMessage] = {self._usual: NewestMessage(self._usual, RobotArray)}
        self._listed: Set[str] = set()
        self._reports: Dict[str, RobotArray] = {}
        self._heard_s: Dict[str, float] = {}
        self._start_s = time.monotonic()
        self._has_looked = threading.Event()
        self._end = threading.Event()
        if self._usual == USUAL_TOPIC:
            threading.Thread(target=self._look_now_and_then, name="drivers", daemon=True).start()
        else:
            self._has_looked.set()

    # -- finding them (a thread of its own) -----------------------------------------------------------------

    def _look_now_and_then(self) -> None:
        while not self._end.is_set():
            self._look()
            self._has_looked.set()
            self._end.wait(LOOK_PERIOD_S)

    def _look(self) -> None:
        try:
            published = rosgraph.Master(rospy.get_name()).getPublishedTopics("/")
        except (rosgraph.MasterException, OSError):
            return  # it may come back; what is known stays
        listed = {topic for topic, kind in published if kind == RobotArray._type and topic.endswith(SUFFIX)}
        new = {topic: NewestMessage(topic, RobotArray) for topic in listed - set(self._topics)}
        with self._lock:
            self._listed = listed
            # The usual driver may be started again at any time. Others come under any name, and are forgotten.
            gone = [self._topics.pop(topic) for topic in set(self._topics) - listed - {self._usual}]
            self._topics.update(new)
        for topic in gone:
            topic.close()

    # -- what they say --------------------------------------------------------------------------------------

    @property
    def is_settled(self) -> bool:
        """Whether every driver that the master knows was heard, or had the time to speak; to be asked after read()."""
        if time.monotonic() > self._start_s + SETTLE_S:
            return True
        return self._has_looked.is_set() and self._listed <= set(self._reports)

    def read(self) -> Optional[RobotArray]:
        """Return the newest reports of all drivers in one; None until there is one."""
        with self._lock:
            topics = dict(self._topics)
        for topic, newest in topics.items():
            message = newest.take()
            if message is not None:
                self._reports[topic], self._heard_s[topic] = message, time.monotonic()
        freshest_s = max(self._heard_s.values(), default=0.0)
        for topic in list(self._reports):
            if topic not in topics or freshest_s - self._heard_s[topic] > SILENT_S:
                del self._reports[topic], self._heard_s[topic]
        return merge(list(self._reports.values())) if self._reports else None

    def count(self) -> int:
        """Return how many reports came so far, to see whether there are new ones."""
        with self._lock:
            return sum(newest.count for newest in self._topics.values())

    def names(self) -> List[str]:
        """Return the drivers that were heard or that the master knows; without one, the usual one."""
        return [topic[: -len(SUFFIX)] for topic in sorted(self._listed | set(self._reports) or {self._usual})]

    def find(self, namespace: str) -> str:
        """Return the driver of a robot; the usual one if none has it."""
        having = [
            (PREFERENCE.index(robot.state), topic)
            for topic, report in self._reports.items()
            for robot in report.robots
            if robot.namespace == namespace and robot.state in PREFERENCE
        ]
        return min(having, default=(0, self._usual))[1][: -len(SUFFIX)]

    def holds(self, driver: str) -> bool:
        """Return whether a driver holds all its robots (~stop)."""
        report = self._reports.get(driver + SUFFIX)
        return report is not None and bool(report.stopped)

    # -- what they are asked for ----------------------------------------------------------------------------

    def stop(self, held: bool, tell: Tell) -> List[threading.Thread]:
        """Let every driver stop and hold its robots, or let them go; returns at once.

        Each is called on a thread of its own, which is returned: one that hangs keeps no other from its stop.
        """
        threads = [
            threading.Thread(target=call_stop, args=(name, held, tell), daemon=True, name="stop")
            for name in self.names()
        ]
        for thread in threads:
            thread.start()
        return threads

    def close(self) -> None:
        """Listen no more; safe twice."""
        self._end.set()
        with self._lock:
            topics = list(self._topics.values())
        for topic in topics:
            topic.close()


def call_stop(driver: str, held: bool, tell: Tell) -> None:
    """Call the stop service of one driver and tell what came of it."""
    try:
        answer = rospy.ServiceProxy(driver + "/stop", SetBool)(held)
    except (rospy.ServiceException, rospy.ROSException, OSError) as error:
        tell(driver, "no answer from %s/stop: %s" % (driver, error))
        return
    tell(driver, None if answer.success else "%s/stop refused: %s" % (driver, answer.message))


def merge(reports: List[RobotArray]) -> RobotArray:
    """Return one report for several drivers: stopped if all of them are, and each robot once, by namespace."""
    merged = RobotArray()
    merged.header.stamp = max(report.header.stamp for report in reports)
    merged.listening = ", ".join(sorted(report.listening for report in reports if report.listening))
    merged.stopped = all(report.stopped for report in reports)
    by_name: Dict[str, Robot] = {}
    for robot in (robot for report in reports for robot in report.robots):
        # Who was refused, or has not said its name, is not the robot of that name.
        own = robot.namespace if robot.namespace and robot.state in PREFERENCE else None
        key = own or "%s at %s" % (robot.namespace, robot.address)
        known = by_name.get(key)
        if known is None or own is None or PREFERENCE.index(robot.state) < PREFERENCE.index(known.state):
            by_name[key] = robot
    merged.robots = sorted(by_name.values(), key=lambda robot: (robot.namespace, robot.address))
    return merged
