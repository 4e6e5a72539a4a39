#!/usr/bin/env python3
"""Turns a robot left by about a quarter turn, then exits."""

import contextlib
import math

import rospy
from geometry_msgs.msg import Twist
from rospy.core import is_shutdown_requested

ANGULAR_RAD_S = 1.0


def main():
    rospy.init_node("tutorial")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    publisher = rospy.Publisher(robot + "/velocity_controller/cmd_vel", Twist, queue_size=1)

    def stop():
        publisher.publish(Twist())
        rospy.sleep(0.2)

    rospy.on_shutdown(stop)
    command = Twist()
    command.angular.z = ANGULAR_RAD_S
    rate = rospy.Rate(10)  # Hz
    while publisher.get_num_connections() == 0 and not is_shutdown_requested():
        rate.sleep()  # messages published before a subscriber connects are lost
    end = rospy.Time.now() + rospy.Duration(math.pi / 2 / ANGULAR_RAD_S)
    while rospy.Time.now() < end and not is_shutdown_requested():
        publisher.publish(command)
        rate.sleep()
    rospy.loginfo("turned a quarter")


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        main()
