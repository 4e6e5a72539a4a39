"""Records the simulator's ground truth for tests."""

import math
import threading

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_test.waiting import TIMEOUT_S, wait_for

REST_M_S = 0.005
"""Slower than this a robot has been stopped; its wheels take some tenths of a second more to come to exactly zero."""


class SwarmWatch:
    """Ground truth of some robots from now on: rows of time s, x m, y m, yaw rad, speed m/s."""

    def __init__(self, robot_ids):
        self.rows = {robot_id: [] for robot_id in robot_ids}
        self.lock = threading.Lock()
        self.subscribers = [
            rospy.Subscriber("/hero_%d/ground_truth" % robot_id, Odometry, self.receive, robot_id, queue_size=50)
            for robot_id in robot_ids
        ]

    def receive(self, message, robot_id):
        turn = message.pose.pose.orientation
        place = message.pose.pose.position
        row = (
            message.header.stamp.to_sec(),
            place.x,
            place.y,
            2.0 * math.atan2(turn.z, turn.w),
            message.twist.twist.linear.x,
        )
        with self.lock:
            self.rows[robot_id].append(row)

    def close(self):
        for subscriber in self.subscribers:
            subscriber.unregister()

    def pose(self, robot_id):
        """Return the newest x, y, yaw."""
        return self.rows[robot_id][-1][1:4]

    def at_rest(self, *robot_ids):
        """Return whether these robots stand."""
        return all(abs(self.rows[robot_id][-1][4]) < REST_M_S for robot_id in robot_ids)

    def wait_until_stopped(self, *robot_ids):
        """Wait until these robots stand; who stopped them, a program or their watchdogs, a CommandWatch tells."""
        wait_for(lambda: self.at_rest(*robot_ids), f"rest of {robot_ids}")

    def wait_until_stopped_despite(self, act, *robot_ids):
        """Wait until these robots stand although act(), called meanwhile, commands them to move."""

        def stopped():
            act()
            return self.at_rest(*robot_ids)

        wait_for(stopped, f"rest of {robot_ids}")

    def path(self, robot_id):
        """Return all rows as an array (T, 5)."""
        with self.lock:
            return np.array(self.rows[robot_id]).reshape(-1, 5)

    def wait_until_complete(self, timeout_s=TIMEOUT_S):
        """Wait until every robot was reported."""
        wait_for(lambda: all(self.rows.values()), f"ground truth of {sorted(self.rows)}", timeout_s)
