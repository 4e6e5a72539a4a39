#!/usr/bin/env python3
"""Sets the robot's LED from its sensors: red while something is near, otherwise green."""

import rospy
from sensor_msgs.msg import LaserScan
from std_msgs.msg import ColorRGBA

NEAR_M = 0.14
RED = ColorRGBA(1.0, 0.0, 0.0, 1.0)
GREEN = ColorRGBA(0.0, 1.0, 0.0, 1.0)


def main():
    rospy.init_node("led_from_proximity")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    publisher = rospy.Publisher(robot + "/led", ColorRGBA, queue_size=1)

    def set_led(scan):
        # inf means nothing in range. The LED turns off 15 s after the last message, so publish with each scan.
        publisher.publish(RED if any(not range_m > NEAR_M for range_m in scan.ranges) else GREEN)

    rospy.Subscriber(robot + "/proximity", LaserScan, set_led, queue_size=1)
    rospy.spin()


if __name__ == "__main__":
    main()
