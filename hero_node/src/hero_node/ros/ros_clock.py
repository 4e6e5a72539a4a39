"""The time of a ROS program that is no Program: the machine's, and waits that tell when ROS has ended."""

import time

import rospy

from ..clock import Clock


class _RosClock(Clock):
    """This machine's monotonic time."""

    @property
    def now_s(self) -> float:
        return time.monotonic()

    def sleep(self, duration_s: float) -> bool:
        """Wait for duration_s; return whether ROS still runs."""
        time.sleep(max(0.0, duration_s))
        return not rospy.is_shutdown()


ROS_CLOCK = _RosClock()
