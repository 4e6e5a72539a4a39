"""The velocities that programs send to robots, in the order of their arrival."""

import rospy
from geometry_msgs.msg import Twist

from hero_test.waiting import wait_for


class CommandWatch:
    """Commands of some robots from now on: linear m/s, angular rad/s."""

    def __init__(self, robot_ids):
        self.commands = {robot_id: [] for robot_id in robot_ids}
        self.subscribers = [
            rospy.Subscriber(
                "/hero_%d/velocity_controller/cmd_vel" % robot_id, Twist, self.receive, robot_id, tcp_nodelay=True
            )
            for robot_id in robot_ids
        ]

    def receive(self, twist, robot_id):
        self.commands[robot_id].append((twist.linear.x, twist.angular.z))

    def wait_for_answer(self, robot_id, act, condition, what):
        """Do act() and wait for a command since then that condition(linear, angular) likes."""
        start = len(self.commands[robot_id])
        act()
        wait_for(lambda: any(condition(*command) for command in self.commands[robot_id][start:]), what)

    def wait_for_stops(self, *robot_ids):
        """Wait until the last command of each robot is a stop."""
        wait_for(
            lambda: all(self.commands[robot_id][-1:] == [(0.0, 0.0)] for robot_id in robot_ids),
            lambda: "stops among %s" % {robot_id: self.commands[robot_id][-5:] for robot_id in robot_ids},
        )
