"""The driver's reports of its robots, for tests that need some of them ready."""

import rospy

from hero_msgs.msg import Robot, RobotArray
from hero_test.waiting import wait_for


def wait_until_ready(*robot_ids):
    """Wait until the driver reports that these robots, and no others, are ready."""
    ready = set()

    def receive(report):
        ready.clear()
        ready.update(robot.id for robot in report.robots if robot.state == Robot.READY)

    subscriber = rospy.Subscriber("/hero_driver/robots", RobotArray, receive)
    wait_for(lambda: ready == set(robot_ids), f"robots {robot_ids} to be ready")
    subscriber.unregister()
