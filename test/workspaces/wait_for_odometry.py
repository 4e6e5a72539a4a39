"""Ends with 0 as soon as odometry of every robot named as an argument has come, with 1 after a minute."""

import sys
import time

import rosgraph
import rospy
from nav_msgs.msg import Odometry

deadline_s = time.monotonic() + 60.0
while not rosgraph.is_master_online():
    if time.monotonic() > deadline_s:
        sys.exit("no ROS master")
    time.sleep(0.1)
rospy.init_node("wait_for_odometry", anonymous=True, disable_signals=True)
for robot in sys.argv[1:]:
    try:
        rospy.wait_for_message(f"/{robot}/odom", Odometry, max(0.1, deadline_s - time.monotonic()))
    except rospy.ROSException:
        sys.exit(f"no odometry of {robot}")
    print(f"{robot} is there")
