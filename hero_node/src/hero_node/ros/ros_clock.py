"""The machine's time, for a ROS program that is no Program, and the time for what lasts as long in simulated time."""

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


def read_duration_clock_s() -> float:
    """Return a time for durations: simulated where /use_sim_time is set, else the machine's, which is never set."""
    return time.monotonic() if rospy.rostime.is_wallclock() else float(rospy.get_time())
