#!/usr/bin/env python
"""Turns a robot to the left by about a quarter of a turn, and ends."""

import contextlib
import math

import rospy
from geometry_msgs.msg import Twist
from rospy.core import is_shutdown_requested

TURN_RAD_S = 1.0


def main():
    rospy.init_node("tutorial")
    robot = rospy.get_param("~robot", "hero_3")
    publisher = rospy.Publisher(robot + "/velocity_controller/cmd_vel", Twist, queue_size=1)

    def stop():
        publisher.publish(Twist())
        rospy.sleep(0.2)

    rospy.on_shutdown(stop)
    command = Twist()
    command.angular.z = TURN_RAD_S
    rate = rospy.Rate(10)  # Hz
    while publisher.get_num_connections() == 0 and not is_shutdown_requested():
        rate.sleep()  # nobody listens yet: what is published now is lost
    end = rospy.Time.now() + rospy.Duration(math.pi / 2 / TURN_RAD_S)
    while rospy.Time.now() < end and not is_shutdown_requested():
        publisher.publish(command)
        rate.sleep()
    rospy.loginfo("turned for a quarter")


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        main()
