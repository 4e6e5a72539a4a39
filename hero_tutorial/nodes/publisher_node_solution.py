#!/usr/bin/env python3
"""Publishes a sine wave on sine; its phase comes from the clock, not from counting cycles."""

import contextlib
import math

import rospy
from std_msgs.msg import Float32


def main():
    rospy.init_node("sine_node")
    period_s = rospy.get_param("~period_s", 5.0)
    publisher = rospy.Publisher("sine", Float32, queue_size=10)
    rate = rospy.Rate(rospy.get_param("~rate_hz", 10.0))
    start = rospy.Time.now()
    while not rospy.is_shutdown():
        elapsed_s = (rospy.Time.now() - start).to_sec()
        publisher.publish(math.sin(2.0 * math.pi * elapsed_s / period_s))
        rate.sleep()


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        main()
