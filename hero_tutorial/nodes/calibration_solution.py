#!/usr/bin/env python3
"""Sets the odometry of a robot to zero."""

import sys

import rospy

from hero_msgs.srv import SetOdom


def main():
    rospy.init_node("set_odom")
    robot = "hero_" + str(rospy.get_param("~robot", 3)).replace("hero_", "")  # 3 or hero_3
    service = robot + "/set_odom"
    try:
        rospy.wait_for_service(service, timeout=5.0)
        answer = rospy.ServiceProxy(service, SetOdom)(x=0.0, y=0.0, theta=0.0)
    except (rospy.ROSException, rospy.ServiceException) as error:
        sys.exit("%s: %s" % (service, error))
    rospy.loginfo("%s: %s", robot, answer.message)


if __name__ == "__main__":
    main()
