#!/usr/bin/env python3
"""Logs once a second how far a robot has driven, along its path and in a straight line from the start."""

import math

import rospy
from nav_msgs.msg import Odometry


class DistanceMeter:
    def __init__(self):
        self.start = None
        self.last = None
        self.path_m = 0.0

    def receive(self, message):
        here = (message.pose.pose.position.x, message.pose.pose.position.y)
        if self.start is None:
            self.start = self.last = here
        self.path_m += math.hypot(here[0] - self.last[0], here[1] - self.last[1])
        self.last = here
        straight_m = math.hypot(here[0] - self.start[0], here[1] - self.start[1])
        rospy.loginfo_throttle(1.0, "path %.3f m, straight line %.3f m" % (self.path_m, straight_m))


def main():
    rospy.init_node("odometry_reader")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    rospy.Subscriber(robot + "/odom", Odometry, DistanceMeter().receive, queue_size=1)
    rospy.spin()


if __name__ == "__main__":
    main()
