#!/usr/bin/env python3
"""Publishes the mean of the last ten numbers of publisher_node_example on mean_of_ten."""

import collections

import rospy
from std_msgs.msg import Float32, Int32


def main():
    rospy.init_node("mean_node")
    publisher = rospy.Publisher("mean_of_ten", Float32, queue_size=10)
    newest = collections.deque(maxlen=10)

    def publish_mean(message):
        newest.append(message.data)
        if len(newest) == newest.maxlen:
            publisher.publish(sum(newest) / len(newest))

    rospy.Subscriber("publisher_node_example", Int32, publish_mean, queue_size=10)
    rospy.spin()


if __name__ == "__main__":
    main()
