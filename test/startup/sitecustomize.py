"""Saves a tenth of each start of rospy and roslaunch, of which tests have hundreds; Python imports this module first.

They import pyparsing, by way of catkin_pkg, for conditions in package.xml: here it waits for the first one.
"""

import sys
import types


def evaluate_condition(condition, context):
    """Evaluate a condition by catkin_pkg's own function."""
    sys.modules.pop("catkin_pkg.condition", None)
    from catkin_pkg.condition import evaluate_condition as evaluate

    return evaluate(condition, context)


sys.modules["catkin_pkg.condition"] = types.ModuleType("catkin_pkg.condition")
sys.modules["catkin_pkg.condition"].evaluate_condition = evaluate_condition
