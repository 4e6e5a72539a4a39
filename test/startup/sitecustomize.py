"""Halves the start of programs, of which the tests start hundreds; Python imports this module first.

All that imports rospy or roslaunch imports pyparsing, by way of catkin_pkg, for conditions in package.xml: here it
waits for the first one. genpy imports numpy to take its numbers, and http.client ssl, both only where there is one:
these programs, of ROS and ours, have no number of numpy and no https. One that imports numpy itself fails.
"""

import os
import sys
import types

PROGRAMS = "hero_driver rosbag roslaunch rosmaster rosnode rosparam rosservice rostest rostopic scripted_driver".split()


def evaluate_condition(condition, context):
    """Evaluate a condition by catkin_pkg's own function."""
    sys.modules.pop("catkin_pkg.condition", None)
    from catkin_pkg.condition import evaluate_condition as evaluate

    return evaluate(condition, context)


sys.modules["catkin_pkg.condition"] = types.ModuleType("catkin_pkg.condition")
sys.modules["catkin_pkg.condition"].evaluate_condition = evaluate_condition
if os.path.basename(sys.argv[0]) in PROGRAMS:
    sys.modules.update(numpy=None, ssl=None)
