"""What the simulator knows to be true of its robots, recorded for tests: paths, touches, cells visited."""

import math
import threading
import time

import numpy as np
import rospy
from nav_msgs.msg import Odometry

from hero_test.waiting import wait_for

BODY_RADIUS_M = 0.036835
"""Of the robot's body, which the simulator draws as a disc."""

TOUCH_M = 0.001
"""Nearer than this two bodies touch; the simulator lets nothing overlap."""

SEEN_RAD = math.radians(60.0)
"""Half of the field that a robot sees coming: the front beams and their cones."""

REST_M_S = 0.005
"""Slower than this a robot has been stopped; its wheels take some tenths of a second more to come to exactly zero."""

WATCHDOG_S = 1.9
"""A robot that nobody stops drives on for 2 s after its last command; a stop takes about 0.2 s."""

STALL_S = 0.25
RECOVERY_S = 1.5
"""While this machine stands still for so long no program can steer, and for a moment after it robots touch things: two
of them that face each other are 0.5 s apart when they see each other."""

CREEP_M_S = 0.01
"""Slower than this a robot does not run into anything; things run into it."""


class SwarmWatch:
    """Ground truth of some robots from now on: rows of time s, x m, y m, yaw rad, speed m/s."""

    def __init__(self, robot_ids):
        self.rows = {robot_id: [] for robot_id in robot_ids}
        self.stalls_s = []  # begin and end, as stamps, of each time in which nothing came of any robot
        self.heard_s = (time.monotonic(), 0.0)
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
            arrival_s = time.monotonic()
            if arrival_s - self.heard_s[0] > STALL_S and self.heard_s[1]:
                self.stalls_s.append((self.heard_s[1], row[0]))
            self.heard_s = (arrival_s, row[0])
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
        """Wait until these robots stand, by their own clocks sooner than their watchdogs would have it."""
        begin_s = {robot_id: self.rows[robot_id][-1][0] for robot_id in robot_ids}
        wait_for(lambda: self.at_rest(*robot_ids), "rest of %s" % (robot_ids,))
        for robot_id in robot_ids:
            moving_s = [row[0] for row in list(self.rows[robot_id]) if abs(row[4]) >= REST_M_S]
            took_s = max(moving_s, default=0.0) - begin_s[robot_id]
            assert took_s < WATCHDOG_S, "hero_%d went on for %.1f s" % (robot_id, took_s)

    def wait_until_stopped_despite(self, act, *robot_ids):
        """Wait until these robots stand although act(), called meanwhile, commands them to move."""

        def stopped():
            act()
            return self.at_rest(*robot_ids)

        wait_for(stopped, "rest of %s" % (robot_ids,))

    def path(self, robot_id):
        """Return all rows as an array (T, 5)."""
        with self.lock:
            return np.array(self.rows[robot_id]).reshape(-1, 5)

    def wait_until_complete(self, timeout_s=30.0):
        """Wait until every robot was heard of."""
        wait_for(lambda: all(self.rows.values()), "ground truth of %s" % sorted(self.rows), timeout_s)

    def lengths_m(self):
        """Return how far each robot drove."""
        return {
            robot_id: float(np.sum(np.hypot(*np.diff(self.path(robot_id)[:, 1:3], axis=0).T))) for robot_id in self.rows
        }

    def least_gap_m(self):
        """Return the least distance of two bodies, at the moments at which both were heard of."""
        least_m = math.inf
        paths = {robot_id: self.path(robot_id) for robot_id in self.rows}
        for first in paths:
            for second in paths:
                if first < second:
                    apart_m = np.hypot(*(paths[first][:, 1:3] - sample(paths[second], paths[first][:, 0])[:, :2]).T)
                    least_m = min(least_m, float(apart_m.min()))
        return least_m - 2.0 * BODY_RADIUS_M

    def seen_touches(self, measure_clearance):
        """Return (robot, other or "wall", time) of each touch that the robot drove into with open eyes.

        A touch counts for a robot if it moved ahead and what it touched was within its front field as it began, unless
        this machine stood still then. measure_clearance: points (N, 2) to distances from the nearest wall, (N,).
        """
        touches = []
        first_s = min(rows[0][0] for rows in self.rows.values())
        paths = {robot_id: self.path(robot_id) for robot_id in self.rows}
        for robot_id, path in paths.items():
            times_s, places, yaws, speeds = path[:, 0], path[:, 1:3], path[:, 3], path[:, 4]
            # The wall is where the clearance gets less.
            steps = [measure_clearance(places + shift) for shift in (np.zeros(2), [0.001, 0], [0, 0.001])]
            bearings = np.arctan2(steps[0] - steps[2], steps[0] - steps[1])
            touches += begin_of(robot_id, "wall", times_s, steps[0] - BODY_RADIUS_M, bearings - yaws, speeds)
            for other, other_path in paths.items():
                if other != robot_id:
                    way = sample(other_path, times_s)[:, :2] - places
                    bearings = np.arctan2(way[:, 1], way[:, 0])
                    gaps_m = np.hypot(*way.T) - 2.0 * BODY_RADIUS_M
                    touches += begin_of(robot_id, other, times_s, gaps_m, bearings - yaws, speeds)
        return [
            (robot_id, other, time_s - first_s)
            for robot_id, other, time_s in touches
            if not any(begin_s <= time_s <= end_s + RECOVERY_S for begin_s, end_s in self.stalls_s)
        ]

    def visited_share(self, bounds_m, measure_clearance, cell_m):
        """Return the share of the cells a robot could stand in that any robot was in."""
        x_min, y_min, x_max, y_max = bounds_m
        columns, rows = int(round((x_max - x_min) / cell_m)), int(round((y_max - y_min) / cell_m))
        visited = np.zeros((columns, rows), dtype=bool)
        for robot_id in self.rows:
            places = self.path(robot_id)[:, 1:3]
            column = np.clip(((places[:, 0] - x_min) / cell_m).astype(int), 0, columns - 1)
            row = np.clip(((places[:, 1] - y_min) / cell_m).astype(int), 0, rows - 1)
            visited[column, row] = True
        centers = np.array(
            [
                (x_min + (column + 0.5) * cell_m, y_min + (row + 0.5) * cell_m)
                for column in range(columns)
                for row in range(rows)
            ]
        )
        reachable = (measure_clearance(centers) > 0.10).reshape(columns, rows)
        return float(visited[reachable].mean())


def begin_of(robot_id, other, times_s, gaps_m, bearings, speeds):
    """Return the touches of one pair as (robot, other, time): where the gap closes, ahead, while driving ahead."""
    touching = gaps_m < TOUCH_M
    begins = np.flatnonzero(touching[1:] & ~touching[:-1]) + 1
    ahead = np.abs(np.angle(np.exp(1j * bearings))) < SEEN_RAD
    return [
        (robot_id, other, float(times_s[index]))
        for index in begins
        if ahead[index - 1] and speeds[index - 1] > CREEP_M_S
    ]


def sample(path, times_s):
    """Return x, y of a path at other times."""
    return np.column_stack([np.interp(times_s, path[:, 0], path[:, column]) for column in (1, 2)])
