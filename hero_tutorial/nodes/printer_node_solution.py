#!/usr/bin/env python3
"""Logs a text at a rate, both set by parameters, until Ctrl-C."""

import contextlib

import rospy


def main():
    rospy.init_node("printer_node")
    text = rospy.get_param("~text", "Hello from ROS")
    rate = rospy.Rate(rospy.get_param("~rate_hz", 1.0))
    while not rospy.is_shutdown():
        rospy.loginfo(text)
        rate.sleep()


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException, rospy.ROSInitException):
        main()
