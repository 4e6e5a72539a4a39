#!/usr/bin/env python
"""Lets a robot walk at random: ahead while nothing is near, else it turns on the spot until the way is free."""

import random

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

AHEAD_M_S = 0.08
DRIFT_RAD_S = 0.5  # largest turn while it walks
TURN_RAD_S = 1.5  # turn away from an obstacle
NEAR_M = 0.14  # from the centre of the robot; the body ends at 0.037 m
RIGHT, AHEAD, LEFT = 3, 4, 5  # of the eight ranges: 45 degrees to the right, straight ahead, 45 to the left


class RandomWalk:
    def __init__(self, robot):
        self.turn_sign = 0  # 1 while it turns left, -1 right, 0 while it walks
        self.publisher = rospy.Publisher(robot + "/velocity_controller/cmd_vel", Twist, queue_size=1)
        self.subscriber = rospy.Subscriber(robot + "/proximity", LaserScan, self.walk, queue_size=1)
        rospy.on_shutdown(self.stop)

    def walk(self, scan):
        """Send one command for each scan: no scans, no commands, and the robot stands after 2 s."""
        command = Twist()
        # inf, nothing in range, is further than anything; nan, not calibrated, is not.
        if all(range_m > NEAR_M for range_m in scan.ranges[RIGHT : LEFT + 1]):
            self.turn_sign = 0
            command.linear.x = AHEAD_M_S
            command.angular.z = random.uniform(-DRIFT_RAD_S, DRIFT_RAD_S)
        else:
            if self.turn_sign == 0:  # choose a side and keep to it, or a corner holds the robot
                self.turn_sign = 1 if scan.ranges[LEFT] >= scan.ranges[RIGHT] else -1
            command.angular.z = self.turn_sign * TURN_RAD_S
        self.publisher.publish(command)

    def stop(self):
        self.subscriber.unregister()
        self.publisher.publish(Twist())
        rospy.sleep(0.2)


def main():
    rospy.init_node("random_walk")
    RandomWalk(rospy.get_param("~robot", "hero_3"))
    rospy.spin()


if __name__ == "__main__":
    main()
