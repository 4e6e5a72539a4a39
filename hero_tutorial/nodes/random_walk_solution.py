#!/usr/bin/env python
"""Lets the light of a robot say what its sensors see: red while something is near, else green."""

import rospy
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA

NEAR_M = 0.14
RED = ColorRGBA(1.0, 0.0, 0.0, 1.0)
GREEN = ColorRGBA(0.0, 1.0, 0.0, 1.0)


def main():
    rospy.init_node("light")
    robot = rospy.get_param("~robot", "hero_3")
    publisher = rospy.Publisher(robot + "/led", ColorRGBA, queue_size=1)

    def shine(scan):
        # inf is nothing in range; the light goes dark 15 s after the last message, so send with each scan
        publisher.publish(RED if any(not range_m > NEAR_M for range_m in scan.ranges) else GREEN)

    rospy.Subscriber(robot + "/proximity", LaserScan, shine, queue_size=1)
    rospy.spin()


if __name__ == "__main__":
    main()
