"""The topics that connect a program with one driver: its reports, and requests to stop."""

import math
import threading
import time
from typing import Optional

import rospy
from std_msgs.msg import Bool

from hero_msgs.msg import RobotArray

from .driver_reports import clean


class DriverLink:
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
        self._lock = threading.Lock()
        self._is_closed = False
        # Not latched: a driver that starts later must not find an old request.
        self._requests = rospy.Publisher(driver + "/stop_request", Bool, queue_size=1, tcp_nodelay=True)
        self._reports = rospy.Subscriber(reports_topic, RobotArray, self._receive, queue_size=1, tcp_nodelay=True)

    def _receive(self, report: RobotArray) -> None:
        if report._connection_header.get("callerid") == self.driver:
            clean(report)
            with self._lock:
                self.report, self.arrival_s = report, time.monotonic()
                self.count += 1

    def newest(self, since_s: float = -math.inf) -> Optional[RobotArray]:
        """Return the newest report if it came after since_s."""
        with self._lock:
            return self.report if self.arrival_s > since_s else None

    @property
    def is_connected(self) -> bool:
        """Whether a driver that has reported is still connected; it may hang all the same."""
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
