"""Colours that robots are told to show -> spheres on their hats, for RViz.

    rosrun hero_description lights --robots 0-3

The robot does not report its light; what is shown is the last colour on /hero_N/led, for as long as the firmware
shows it. Works with simulated and real robots.
"""

import argparse
from typing import Any

import rospy
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from .dimensions import DECK_THICKNESS_M, LIGHT_DIAMETER_M
from .rviz_config import LIGHTS_TOPIC
from .start import start_node
from .view import ROBOTS_HELP, read_names

LIGHT_S = 15.0
"""The firmware lets the light go dark so long after the last command (LEDStatus.ino:76)."""

GROWTH = 1.6
"""A lit sphere covers the model's dark one."""


def make_marker(name: str, number: int, colour: ColorRGBA) -> Marker:
    """Return the sphere of one robot; it follows the robot's frame, and vanishes when the light goes dark."""
    marker = Marker(type=Marker.SPHERE, ns="lights", id=number, frame_locked=True)
    marker.header.frame_id = name + "/hat_link"
    lit = max(colour.r, colour.g, colour.b) > 0.0
    marker.action = Marker.ADD if lit else Marker.DELETE
    marker.pose.position.z = DECK_THICKNESS_M
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = GROWTH * LIGHT_DIAMETER_M
    marker.color = ColorRGBA(colour.r, colour.g, colour.b, 1.0)
    marker.lifetime = rospy.Duration(LIGHT_S)
    return marker


def main() -> None:
    """Run the node lights."""
    parser = argparse.ArgumentParser(prog="lights", description="The robots' lights, for RViz.")
    parser.add_argument("--robots", default="0", help=ROBOTS_HELP)
    options = parser.parse_args(rospy.myargv()[1:])
    try:
        names = read_names(options.robots)
    except ValueError as error:
        parser.error("--robots %s: %s" % (options.robots, error))
    start_node("hero_lights")
    publisher = rospy.Publisher(LIGHTS_TOPIC, MarkerArray, queue_size=len(names) + 10)

    def show(colour: ColorRGBA, robot: Any) -> None:
        number, name = robot
        publisher.publish(MarkerArray([make_marker(name, number, colour)]))

    for robot in enumerate(names):
        rospy.Subscriber("/%s/led" % robot[1], ColorRGBA, show, robot, queue_size=5)
    rospy.spin()
