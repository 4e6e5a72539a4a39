"""Halves the start of ROS's own programs, of which the tests start hundreds; Python imports this module first.

All that imports rospy or roslaunch imports pyparsing, by way of catkin_pkg, for conditions in package.xml: here it
waits for the first one. ROS's own programs also start without numpy, of which genpy takes numbers where it is there,
and without ssl; the suite's programs run as users start them.
"""

import os
import sys
import types

PROGRAMS = ("rosbag", "roslaunch", "rosmaster", "rosnode", "rosparam", "rosservice", "rostest", "rostopic")


def evaluate_condition(condition, context):
    """Evaluate a condition by catkin_pkg's own function."""
    sys.modules.pop("catkin_pkg.condition", None)
    from catkin_pkg.condition import evaluate_condition as evaluate

    return evaluate(condition, context)


sys.modules["catkin_pkg.condition"] = types.ModuleType("catkin_pkg.condition")
sys.modules["catkin_pkg.condition"].evaluate_condition = evaluate_condition
if os.path.basename(sys.argv[0]) in PROGRAMS:
    sys.modules.update(numpy=None, ssl=None)
