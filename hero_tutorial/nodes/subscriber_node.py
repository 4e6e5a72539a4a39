#!/usr/bin/env python
"""Prints every number that comes on the topic publisher_node_example."""

import rospy
from std_msgs.msg import Int32


def print_number(message):
    rospy.loginfo("received %d", message.data)


def main():
    rospy.init_node("subscriber_node")
    rospy.Subscriber("publisher_node_example", Int32, print_number, queue_size=10)
    rospy.spin()  # waits for Ctrl-C; rospy calls print_number meanwhile


if __name__ == "__main__":
    main()
