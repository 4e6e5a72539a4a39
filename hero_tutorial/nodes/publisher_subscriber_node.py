#!/usr/bin/env python3
"""Doubles each number received on publisher_node_example and publishes it on publisher_subscriber."""

import rospy
from std_msgs.msg import Int32


def main():
    rospy.init_node("publisher_subscriber_node")
    publisher = rospy.Publisher("publisher_subscriber", Int32, queue_size=10)

    def publish_double(message):
        publisher.publish(2 * message.data)

    # Created after the publisher, because the first callback may run at once.
    rospy.Subscriber("publisher_node_example", Int32, publish_double, queue_size=10)
    rospy.spin()


if __name__ == "__main__":
    main()
