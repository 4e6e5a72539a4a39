"""Commands that no robot hears, by the ROS master's lists: a misspelled topic, an absent robot, another type."""

import re
from typing import Dict, List

import rospy

from hero_node.ros import ask_master

COMMANDS = {
    "velocity_controller/cmd_vel": "geometry_msgs/Twist",
    "position_controller/cmd_vel": "geometry_msgs/Twist",
    "cmd_vel": "geometry_msgs/Twist",
    "cmd_motor": "hero_msgs/Motor",
    "led": "std_msgs/ColorRGBA",
    "goal": "geometry_msgs/PoseStamped",
}
"""Types of the topics below /hero_N on which robots, or programs that drive them, take commands."""

USUAL = {COMMANDS[topic]: topic for topic in ("velocity_controller/cmd_vel", "cmd_motor", "led")}
"""Topic that a publisher of such a type means, if nothing subscribes to its own."""

_ROBOT_TOPIC = re.compile(r"/(hero_[0-9]+)/(.+)")


def find_lost_commands() -> List[str]:
    """Return a sentence for each topic whose publishers mean to command robots, but are heard by none.

    This node is not among them: it keeps topics open for robots that may return. Asks the ROS master, which may take
    seconds. Raises: NodeError if it does not answer.
    """
    published, subscribed, _ = (dict(part) for part in ask_master("getSystemState"))
    types: Dict[str, str] = dict(ask_master("getTopicTypes"))
    heard = {topic for topic in subscribed if _ROBOT_TOPIC.fullmatch(topic)}
    drivers = {node for topic in heard if topic.endswith("/cmd_vel") for node in subscribed[topic]}
    lost = []
    for topic, publishers in sorted(published.items()):
        nodes = sorted(set(publishers) - {rospy.get_name()})
        match, kind = _ROBOT_TOPIC.fullmatch(topic), types.get(topic, "")
        robot, name = match.groups() if match else ("hero_N", "")
        says = f"{', '.join(nodes)} publishes {topic}"
        if not nodes or drivers.intersection(nodes):  # a driver's are the robot's own
            continue
        if topic in heard and kind != COMMANDS.get(name, kind):
            lost.append(f"{says} as {kind}, but robots take {COMMANDS[name]}")
        elif topic in subscribed:
            continue
        elif name == "goal" and kind == COMMANDS["goal"]:
            text = f"{says}, but no program takes its goals: roslaunch hero_examples go_to_goal.launch robots:=all"
            lost.append(text)
        elif name in COMMANDS and kind == COMMANDS[name]:
            lost.append(f"{says}, but no driver has {robot}: is it on, and its number right?")
        elif kind in USUAL:
            lost.append(f"{says}, which no robot reads: did you mean /{robot}/{USUAL[kind]}?")
    return lost
