#!/usr/bin/env python3
"""Logs a robot's pose estimate once a second."""

import math

import rospy
from nav_msgs.msg import Odometry
from tf.transformations import euler_from_quaternion


def print_pose(message):
    position = message.pose.pose.position
    q = message.pose.pose.orientation
    _, _, yaw_rad = euler_from_quaternion([q.x, q.y, q.z, q.w])
    rospy.loginfo_throttle(1.0, "x %.3f m, y %.3f m, yaw %.1f deg" % (position.x, position.y, math.degrees(yaw_rad)))


def main():
    rospy.init_node("odometry_reader")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    rospy.Subscriber(robot + "/odom", Odometry, print_pose, queue_size=1)
    rospy.spin()


if __name__ == "__main__":
    main()
