#!/usr/bin/env python3
"""Random walk: drive forward while nothing is near, otherwise turn on the spot until the path is clear."""

import random

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

LINEAR_M_S = 0.08
DRIFT_RAD_S = 0.5  # largest angular speed while driving forward
TURN_RAD_S = 1.5  # angular speed while turning away from an obstacle
NEAR_M = 0.14  # from the robot's center; the body radius is 0.037 m
FRONT_RIGHT, FRONT, FRONT_LEFT = 3, 4, 5  # indices into the eight ranges


class RandomWalk:
    def __init__(self, robot):
        self.turn_sign = 0  # 1 while turning left, -1 while turning right, 0 while driving forward
        self.publisher = rospy.Publisher(robot + "/velocity_controller/cmd_vel", Twist, queue_size=1)
        self.subscriber = rospy.Subscriber(robot + "/proximity", LaserScan, self.walk, queue_size=1)
        rospy.on_shutdown(self.stop)

    def walk(self, scan):
        """Send one command per scan: if the scans stop, so do the commands, and the robot stops after 2 s."""
        command = Twist()
        # True for inf (nothing in range), false for nan (not calibrated).
        if all(range_m > NEAR_M for range_m in scan.ranges[FRONT_RIGHT : FRONT_LEFT + 1]):
            self.turn_sign = 0
            command.linear.x = LINEAR_M_S
            command.angular.z = random.uniform(-DRIFT_RAD_S, DRIFT_RAD_S)
        else:
            if self.turn_sign == 0:  # keep turning to the same side, or the robot gets stuck in corners
                self.turn_sign = 1 if scan.ranges[FRONT_LEFT] >= scan.ranges[FRONT_RIGHT] else -1
            command.angular.z = self.turn_sign * TURN_RAD_S
        self.publisher.publish(command)

    def stop(self):
        self.subscriber.unregister()
        self.publisher.publish(Twist())
        rospy.sleep(0.2)


def main():
    rospy.init_node("random_walk")
    RandomWalk("hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", ""))  # 3 or hero_3
    rospy.spin()


if __name__ == "__main__":
    main()
