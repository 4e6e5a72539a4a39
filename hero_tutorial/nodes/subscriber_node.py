#!/usr/bin/env python3
"""Logs every number received on publisher_node_example."""

import rospy
from std_msgs.msg import Int32


def print_number(message):
    rospy.loginfo("received %d", message.data)


def main():
    rospy.init_node("subscriber_node")
    rospy.Subscriber("publisher_node_example", Int32, print_number, queue_size=10)
    rospy.spin()  # blocks until Ctrl-C; rospy calls print_number on its own thread


if __name__ == "__main__":
    main()
