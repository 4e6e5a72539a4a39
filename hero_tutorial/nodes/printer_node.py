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
    with contextlib.suppress(rospy.ROSInterruptException):  # Ctrl-C during rate.sleep()
        main()
