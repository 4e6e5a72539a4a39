#!/usr/bin/env python
"""Says once a second how far a robot has come, along its way and as the crow flies."""

import math

import rospy
from nav_msgs.msg import Odometry


class WayMeter:
    def __init__(self):
        self.start = None
        self.last = None
        self.way_m = 0.0

    def receive(self, message):
        here = (message.pose.pose.position.x, message.pose.pose.position.y)
        if self.start is None:
            self.start = self.last = here
        self.way_m += math.hypot(here[0] - self.last[0], here[1] - self.last[1])
        self.last = here
        straight_m = math.hypot(here[0] - self.start[0], here[1] - self.start[1])
        rospy.loginfo_throttle(1.0, "way %.3f m, from the start %.3f m" % (self.way_m, straight_m))


def main():
    rospy.init_node("odometry_reader")
    robot = rospy.get_param("~robot", "hero_3")
    rospy.Subscriber(robot + "/odom", Odometry, WayMeter().receive, queue_size=1)
    rospy.spin()


if __name__ == "__main__":
    main()
