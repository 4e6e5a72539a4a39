"""Shows the colors that robots were told to display as spheres on their hats, for RViz.

    rosrun hero_description lights _robots:=0-3

Robots do not report their light: it is the last color on /hero_N/led, for as long as the firmware displays it.
"""

import rospy
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from hero_node.ros.private_parameters import read_parameters
from hero_node.ros.program import Program, run

from .robots_parameter import given_robots
from .rviz_config import LIGHTS_TOPIC

LIGHT_S = 15.0
"""The firmware switches the light off this long after the last command (LEDStatus.ino:76)."""

LIGHT_Z_M = 0.002
LIT_DIAMETER_M = 0.019
"""Covers the model's dark light in hat_link (urdf/hero.urdf)."""


def make_marker(robot_id: int, color: ColorRGBA) -> Marker:
    """Return the sphere of one robot; it follows the robot's frame, and disappears when the light goes out."""
    marker = Marker(type=Marker.SPHERE, ns="lights", id=robot_id, frame_locked=True)
    marker.header.frame_id = "hero_%d/hat_link" % robot_id
    marker.action = Marker.ADD if max(color.r, color.g, color.b) > 0.0 else Marker.DELETE
    marker.pose.position.z = LIGHT_Z_M
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = LIT_DIAMETER_M
    marker.color = ColorRGBA(color.r, color.g, color.b, 1.0)
    marker.lifetime = rospy.Duration(LIGHT_S)
    return marker


def show_lights() -> None:
    """Publish a sphere for each color."""
    with Program("hero_lights") as program:
        robots = read_parameters({"robots": given_robots()})["robots"]
        publisher = rospy.Publisher(LIGHTS_TOPIC, MarkerArray, queue_size=len(robots) + 10)

        def show(color: ColorRGBA, robot_id: int) -> None:
            publisher.publish(MarkerArray([make_marker(robot_id, color)]))

        for robot_id in robots:
            rospy.Subscriber("/hero_%d/led" % robot_id, ColorRGBA, show, robot_id, queue_size=5)
        while program.sleep(10.0):
            pass


def main() -> None:
    """Run the program lights."""
    run(show_lights)
