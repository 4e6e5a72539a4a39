#!/usr/bin/env python3
"""Publishes every tenth pose of odom as a nav_msgs/Path on path."""

import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path


def main():
    rospy.init_node("path_node")
    publisher = rospy.Publisher("path", Path, queue_size=1, latch=True)
    path = Path()
    count = 0

    def add_pose(message):
        nonlocal count
        if count % 10 == 0:
            path.header = message.header
            path.poses.append(PoseStamped(message.header, message.pose.pose))
            publisher.publish(path)
        count += 1

    rospy.Subscriber("odom", Odometry, add_pose, queue_size=10)
    rospy.spin()


if __name__ == "__main__":
    main()
