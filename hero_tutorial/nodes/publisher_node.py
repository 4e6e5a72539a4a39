#!/usr/bin/env python3
"""Publishes a counter on publisher_node_example ten times a second."""

import contextlib

import rospy
from std_msgs.msg import Int32


def main():
    rospy.init_node("publisher_node")
    publisher = rospy.Publisher("publisher_node_example", Int32, queue_size=10)
    rate = rospy.Rate(10)  # Hz
    counter = 0
    while not rospy.is_shutdown():
        publisher.publish(counter)
        counter += 1
        rate.sleep()


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        main()
