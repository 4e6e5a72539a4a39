"""The simulated world as markers for RViz and the monitor's map: arena, objects and robots, in the frame `world`."""

import math
from typing import List, Sequence

from geometry_msgs.msg import Point, Quaternion
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from hero_node.geometry import Pose

from .robot_constants import BODY_RADIUS_M
from .world.arena import Arena
from .world.pushing.shapes import Body, Disc

__all__ = ["FRAME", "draw_arena", "draw_objects", "draw_robot", "rotate_about_z"]

FRAME = "world"

BODY_HEIGHT_M = 0.045
WALL_HEIGHT_M = 0.05
_WALL_THICKNESS_M = 0.005

_WALL_COLOR = ColorRGBA(0.6, 0.6, 0.6, 1.0)
_OBJECT_COLOR = ColorRGBA(0.8, 0.5, 0.2, 1.0)
_DARK_COLOR = ColorRGBA(0.15, 0.15, 0.15, 1.0)
_NOSE_COLOR = ColorRGBA(1.0, 1.0, 1.0, 1.0)


def draw_robot(
    index: int, name: str, pose: Pose, light: Sequence[float], radius_m: float = BODY_RADIUS_M
) -> List[Marker]:
    """Return a robot with its heading and name; light: red green blue alpha, dark if it is off."""
    red, green, blue, alpha = light
    lit = alpha > 0.0 and max(red, green, blue) > 0.0
    color = ColorRGBA(red, green, blue, 1.0) if lit else _DARK_COLOR
    body = _make_marker("robots", index, Marker.CYLINDER, color, pose, BODY_HEIGHT_M / 2.0)
    body.scale.x = body.scale.y = 2.0 * radius_m
    body.scale.z = BODY_HEIGHT_M
    nose = _make_marker("headings", index, Marker.ARROW, _NOSE_COLOR, pose, BODY_HEIGHT_M + 0.002)
    nose.scale.x, nose.scale.y, nose.scale.z = BODY_RADIUS_M, 0.008, 0.004
    text = _make_marker("names", index, Marker.TEXT_VIEW_FACING, _NOSE_COLOR, pose, BODY_HEIGHT_M + 0.04)
    text.scale.z = 0.03
    text.text = name
    return [body, nose, text]


def draw_objects(bodies: Sequence[Body]) -> List[Marker]:
    """Return discs, and the edges of polygons, where they are."""
    markers: List[Marker] = []
    for body in bodies:
        if isinstance(body.shape, Disc):
            circle = (body.x_m, body.y_m, body.shape.reach_m)
            markers.append(_draw_circle("objects", len(markers), circle, _OBJECT_COLOR))
        for start_m, end_m in zip(body.corners_m, [*body.corners_m[1:], *body.corners_m[:1]]):
            markers.append(_draw_wall("objects", len(markers), (*start_m, *end_m), _OBJECT_COLOR))
    return markers


def rotate_about_z(angle_rad: float) -> Quaternion:
    """Return the rotation by an angle about z."""
    return Quaternion(0.0, 0.0, math.sin(angle_rad / 2.0), math.cos(angle_rad / 2.0))


def draw_arena(arena: Arena) -> List[Marker]:
    """Return walls and obstacles."""
    walls = [_draw_wall("walls", *item, _WALL_COLOR) for item in enumerate(arena.segments_m.tolist())]
    return walls + [_draw_circle("obstacles", *item, _WALL_COLOR) for item in enumerate(arena.circles_m.tolist())]


def _draw_wall(namespace: str, number: int, ends_m: Sequence[float], color: ColorRGBA) -> Marker:
    x1_m, y1_m, x2_m, y2_m = ends_m
    middle = Pose((x1_m + x2_m) / 2.0, (y1_m + y2_m) / 2.0, math.atan2(y2_m - y1_m, x2_m - x1_m))
    marker = _make_marker(namespace, number, Marker.CUBE, color, middle, WALL_HEIGHT_M / 2.0)
    marker.scale.x = math.hypot(x2_m - x1_m, y2_m - y1_m) + _WALL_THICKNESS_M
    marker.scale.y, marker.scale.z = _WALL_THICKNESS_M, WALL_HEIGHT_M
    return marker


def _draw_circle(namespace: str, number: int, circle_m: Sequence[float], color: ColorRGBA) -> Marker:
    x_m, y_m, radius_m = circle_m
    marker = _make_marker(namespace, number, Marker.CYLINDER, color, Pose(x_m, y_m, 0.0), WALL_HEIGHT_M / 2.0)
    marker.scale.x = marker.scale.y = 2.0 * radius_m
    marker.scale.z = WALL_HEIGHT_M
    return marker


def _make_marker(namespace: str, number: int, kind: int, color: ColorRGBA, pose: Pose, z_m: float) -> Marker:
    marker = Marker()
    marker.header.frame_id = FRAME
    marker.ns, marker.id, marker.type, marker.action = namespace, number, kind, Marker.ADD
    marker.pose.position = Point(pose.x_m, pose.y_m, z_m)
    marker.pose.orientation = rotate_about_z(pose.yaw_rad)
    marker.color = color
    return marker
