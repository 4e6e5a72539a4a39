"""Shows robots' names, rings in their own color, and lights (spheres on their hats) in RViz.

    rosrun hero_description lights _robots:=0-3

Robots do not report their light: it is the last color on /hero_N/led, for as long as the firmware displays it.
"""

import math
from contextlib import suppress
from typing import List

import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from hero_node.parameters import Parameter, parse_explicit_ids
from hero_node.robot_constants import HERO, MODELS, RobotModel
from hero_node.ros import Program, read_parameters

from .rviz_config import TRUE, color_of, read_ids

LIGHTS_TOPIC = "/hero_lights"

LIGHT_S = 15.0
"""The firmware switches the light off this long after the last command (LEDStatus.ino:76)."""

LIGHT_Z_M = 0.002
LIT_DIAMETER_M = 0.019
"""Covers the model's dark light in hat_link (urdf/hero.urdf)."""

NAME_Z_M = 0.11
NAME_SIZE_M = 0.045
RING_GAP_M = 0.008
"""Gap between the body and the middle of its ring."""

RING_WIDTH_M = 0.006
RING_POINTS = 25
REPEAT_S = 2.0
"""Time between two messages of names and rings: RViz may start at any time."""


def make_marker(robot_id: int, kind: int, namespace: str, frame: str, color: ColorRGBA) -> Marker:
    """Return a marker that follows a frame of the robot; of a simulated one, true/base_link and so on."""
    marker = Marker(type=kind, ns=namespace, id=robot_id, frame_locked=True, color=color)
    marker.header.frame_id = "hero_%d/%s" % (robot_id, frame)
    marker.pose.orientation.w = 1.0
    return marker


def make_light(robot_id: int, color: ColorRGBA, place: str = "") -> Marker:
    """Return the sphere of one robot, which disappears when the light goes out."""
    marker = make_marker(
        robot_id, Marker.SPHERE, "lights", place + "hat_link", ColorRGBA(color.r, color.g, color.b, 1.0)
    )
    marker.action = Marker.ADD if max(color.r, color.g, color.b) > 0.0 else Marker.DELETE
    marker.pose.position.z = LIGHT_Z_M
    marker.scale.x = marker.scale.y = marker.scale.z = LIT_DIAMETER_M
    marker.lifetime = rospy.Duration(LIGHT_S)
    return marker


def make_identity(robot_id: int, place: str = "", model: RobotModel = HERO) -> List[Marker]:
    """Return the name above one robot, and the ring around it."""
    name = make_marker(robot_id, Marker.TEXT_VIEW_FACING, "names", place + "base_link", ColorRGBA(0.1, 0.1, 0.1, 1.0))
    name.text = "hero_%d" % robot_id
    name.pose.position.z = NAME_Z_M
    name.scale.z = NAME_SIZE_M
    ring = make_marker(robot_id, Marker.LINE_STRIP, "rings", place + "base_link", ColorRGBA(*color_of(robot_id), 1.0))
    angles_rad = [math.tau * index / (RING_POINTS - 1) for index in range(RING_POINTS)]
    radius_m = model.body_radius_m + RING_GAP_M
    ring.points = [Point(radius_m * math.cos(angle), radius_m * math.sin(angle), 0.0) for angle in angles_rad]
    ring.scale.x = RING_WIDTH_M
    return [name, ring]


def main() -> None:
    """Publish names and rings again and again, and a sphere for each color."""
    with Program("hero_lights") as program:
        groups = {group: Parameter((), read_ids) for group in ("hero_plus", "simulated")}
        parameters = read_parameters({"robots": Parameter("0", parse_explicit_ids), **groups})
        robots = parameters["robots"]
        places = {robot_id: TRUE + "/" for robot_id in parameters["simulated"]}
        publisher = rospy.Publisher(LIGHTS_TOPIC, MarkerArray, queue_size=len(robots) + 10)

        def show(color: ColorRGBA, robot_id: int) -> None:
            with suppress(rospy.ROSException):  # while the node ends, its topic is closed
                publisher.publish(MarkerArray([make_light(robot_id, color, places.get(robot_id, ""))]))

        for robot_id in robots:
            rospy.Subscriber("/hero_%d/led" % robot_id, ColorRGBA, show, robot_id, queue_size=5)
        models = {robot_id: MODELS["hero_plus"] for robot_id in parameters["hero_plus"]}
        identities = MarkerArray()
        for robot_id in robots:
            identities.markers += make_identity(robot_id, places.get(robot_id, ""), models.get(robot_id, HERO))
        for _ in program.rate(1.0 / REPEAT_S):
            publisher.publish(identities)
