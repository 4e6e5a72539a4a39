#!/usr/bin/env python3
"""Drives a robot slowly forward, at 0.01 m/s, until Ctrl-C."""

import contextlib

import rospy
from geometry_msgs.msg import Twist
from rospy.core import is_shutdown_requested


def main():
    rospy.init_node("tutorial")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    publisher = rospy.Publisher(robot + "/velocity_controller/cmd_vel", Twist, queue_size=1)

    def stop():
        publisher.publish(Twist())  # all speeds zero
        rospy.sleep(0.2)  # lets the message leave before the node exits

    rospy.on_shutdown(stop)
    command = Twist()
    command.linear.x = 0.01  # m/s
    rate = rospy.Rate(1)  # Hz
    while not is_shutdown_requested():  # unlike is_shutdown, already true while stop() runs
        publisher.publish(command)
        rate.sleep()


if __name__ == "__main__":
    with contextlib.suppress(rospy.ROSInterruptException):
        main()
