#!/usr/bin/env python3
"""The model alone: display.launch without RViz."""

import sys
import unittest

import rospy
import rostest
from tf2_msgs.msg import TFMessage

from hero_test.waiting import wait_for


class DisplayTest(unittest.TestCase):
    def test_the_wheels_transforms_are_published_again_and_again(self):
        seen = set()

        def add(message):
            seen.update((transform.child_frame_id, transform.header.stamp) for transform in message.transforms)

        rospy.Subscriber("/tf", TFMessage, add)
        for wheel in ("left", "right"):
            frame = "hero_0/%s_wheel_link" % wheel
            wait_for(lambda frame=frame: sum(name == frame for name, _ in list(seen)) > 5, frame)


if __name__ == "__main__":
    rospy.init_node("test_display")
    rostest.rosrun("hero_description", "display", DisplayTest, sys.argv)
