#!/usr/bin/env python3
"""Simulates a robot driving a square: publishes odometry on odom and the transform from map to base_link."""

import contextlib
import math

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry

LINEAR_M_S = 0.6  # along a side
ANGULAR_RAD_S = 0.2  # on the spot, at a corner
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))  # in side lengths


def compute_motion(elapsed_s, side_m):
    """Return x (m), y (m), yaw (rad), linear (m/s) and angular (rad/s) velocity at a time since the start."""
    drive_s = side_m / LINEAR_M_S
    turn_s = math.pi / 2 / ANGULAR_RAD_S
    sides, in_side_s = divmod(elapsed_s, drive_s + turn_s)
    corner = int(sides) % 4
    heading_rad = corner * math.pi / 2
    distance_m = LINEAR_M_S * min(in_side_s, drive_s)
    x_m = CORNERS[corner][0] * side_m + distance_m * math.cos(heading_rad)
    y_m = CORNERS[corner][1] * side_m + distance_m * math.sin(heading_rad)
    if in_side_s < drive_s:
        return x_m, y_m, heading_rad, LINEAR_M_S, 0.0
    return x_m, y_m, heading_rad + ANGULAR_RAD_S * (in_side_s - drive_s), 0.0, ANGULAR_RAD_S


def make_odometry(motion, stamp):
    """Return the message: the pose in the frame map, the velocity in the frame base_link."""
    x_m, y_m, yaw_rad, linear_m_s, angular_rad_s = motion
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = "map"
    message.child_frame_id = "base_link"
    message.pose.pose.position.x = x_m
    message.pose.pose.position.y = y_m
    message.pose.pose.orientation.z = math.sin(yaw_rad / 2)
    message.pose.pose.orientation.w = math.cos(yaw_rad / 2)
    message.twist.twist.linear.x = linear_m_s
    message.twist.twist.angular.z = angular_rad_s
    return message


def make_transform(odometry):
    """Return the same pose as the transform from map to base_link."""
    transform = TransformStamped()
    transform.header = odometry.header
    transform.child_frame_id = odometry.child_frame_id
    transform.transform.translation.x = odometry.pose.pose.position.x
    transform.transform.translation.y = odometry.pose.pose.position.y
    transform.transform.rotation = odometry.pose.pose.orientation
    return transform


def main():
    rospy.init_node("odometry_node")
    side_m = rospy.get_param("~side_m", 10.0)
    publisher = rospy.Publisher("odom", Odometry, queue_size=10)
    broadcaster = tf2_ros.TransformBroadcaster()
    rate = rospy.Rate(5)  # Hz
    start = rospy.Time.now()
    while not rospy.is_shutdown():
        now = rospy.Time.now()
        odometry = make_odometry(compute_motion((now - start).to_sec(), side_m), now)
        publisher.publish(odometry)
        broadcaster.sendTransform(make_transform(odometry))
        rate.sleep()


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        main()
