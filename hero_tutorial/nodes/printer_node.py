#!/usr/bin/env python3
"""Logs a greeting once a second until Ctrl-C."""

import contextlib

import rospy


def main():
    rospy.init_node("printer_node")
    rate = rospy.Rate(1)  # Hz
    while not rospy.is_shutdown():
        rospy.loginfo("Hello from ROS")
        rate.sleep()


if __name__ == "__main__":
    # Ctrl-C during rate.sleep(), or while no ROS master answers
    with contextlib.suppress(rospy.ROSInterruptException, rospy.ROSInitException):
        main()
