#!/usr/bin/env python3
"""Logs once a second how many numbers were received on publisher_node_example, and how many are missing."""

import rospy
from std_msgs.msg import Int32


class GapCounter:
    def __init__(self):
        self.received = 0
        self.missing = 0
        self.last = None

    def receive(self, message):
        if self.last is not None:
            self.missing += max(0, message.data - self.last - 1)
        self.last = message.data
        self.received += 1
        rospy.loginfo_throttle(1.0, "%d received, %d missing" % (self.received, self.missing))


def main():
    rospy.init_node("gap_counter")
    rospy.Subscriber("publisher_node_example", Int32, GapCounter().receive, queue_size=10)
    rospy.spin()


if __name__ == "__main__":
    main()
