"""Turns the wheels of a model that has no robot, so that robot_state_publisher can say where they are."""

import math

import rospy
from sensor_msgs.msg import JointState

from .start import start_node

RATE_HZ = 20.0
TURN_RAD_S = 0.5


def main() -> None:
    """Run the program turn_wheels."""
    start_node("turn_wheels")
    publisher = rospy.Publisher("joint_states", JointState, queue_size=2)
    message = JointState(name=["left_wheel_joint", "right_wheel_joint"])
    angle_rad = 0.0
    rate = rospy.Rate(RATE_HZ)
    while not rospy.is_shutdown():
        message.header.stamp = rospy.Time.now()
        message.position = [angle_rad, angle_rad]
        publisher.publish(message)
        angle_rad = (angle_rad + TURN_RAD_S / RATE_HZ) % math.tau
        try:
            rate.sleep()
        except rospy.ROSInterruptException:
            return
