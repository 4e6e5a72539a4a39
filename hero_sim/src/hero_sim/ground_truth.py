"""Ground truth of the simulated world in ROS: true poses, markers for RViz, and the simulated time.

Publishes only; called by the simulator's thread after a physics step, so nothing here may wait.
Frame of everything: `world`, the arena's own.
"""

import math
from typing import List, Sequence

import rospy
from geometry_msgs.msg import Point, Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from hero_msgs.msg import ObjectPose, ObjectPoses
from hero_node.geometry import Pose

from .robot.firmware import Firmware
from .robot_constants import BODY_RADIUS_M
from .simulator import Simulator
from .world.arena import Arena
from .world.pushing.shapes import Body, Disc

__all__ = ["GroundTruth"]

FRAME = "world"

POSE_PERIOD_MS = 50
MARKER_PERIOD_MS = 100
"""Simulated time between two publications."""

CLOCK_START_S = 1600000000
"""Initial time of /clock: late enough not to be taken for a robot's uptime."""

BODY_HEIGHT_M = 0.045
WALL_HEIGHT_M = 0.05
_WALL_THICKNESS_M = 0.005

_WALL_COLOR = ColorRGBA(0.6, 0.6, 0.6, 1.0)
_OBJECT_COLOR = ColorRGBA(0.8, 0.5, 0.2, 1.0)
_DARK_COLOR = ColorRGBA(0.15, 0.15, 0.15, 1.0)
_NOSE_COLOR = ColorRGBA(1.0, 1.0, 1.0, 1.0)


class GroundTruth:
    """The publishers of one simulator."""

    def __init__(self, simulator: Simulator, with_clock: bool, with_tf: bool) -> None:
        """Advertise everything; with_clock also drives /clock, with_tf places the odom frames in the world."""
        self._swarm = simulator.swarm
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10) if with_clock else None
        self._markers = rospy.Publisher("~markers", MarkerArray, queue_size=2)
        self._arena = rospy.Publisher("~arena", MarkerArray, queue_size=1, latch=True)
        self._objects = rospy.Publisher("~objects", ObjectPoses, queue_size=2)
        self._object_markers = rospy.Publisher("~object_markers", MarkerArray, queue_size=1, latch=True)
        self._drawn: List[List[float]] = []
        self._static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True) if with_tf else None
        self._poses = [
            rospy.Publisher("/%s/ground_truth" % robot.name, Odometry, queue_size=2) for robot in self._swarm.robots
        ]
        self._odom_origins: List[Pose] = []
        self._arena.publish(MarkerArray(_draw_arena(self._swarm.world.arena)))
        self._swarm.after_step = self.publish
        self.publish(self._swarm.world.time_ms)

    def publish(self, time_ms: int) -> None:
        """Publish what is due at time_ms of the world."""
        if self._clock is not None:
            stamp = rospy.Time(CLOCK_START_S + time_ms // 1000, time_ms % 1000 * 10**6)
            self._clock.publish(Clock(stamp))
        else:
            stamp = rospy.Time.now()
        if time_ms % POSE_PERIOD_MS == 0:
            self._publish_poses(stamp)
            if self._static is not None:
                self._publish_odom_frames(self._static, stamp)
            self._publish_objects(stamp)
        if time_ms % MARKER_PERIOD_MS == 0 and self._markers.get_num_connections():
            markers = [marker for robot in self._swarm.robots for marker in self._draw_robot(robot, time_ms)]
            for marker in markers:
                marker.header.stamp = stamp
            self._markers.publish(MarkerArray(markers))

    def _publish_poses(self, stamp: rospy.Time) -> None:
        watched = [index for index, publisher in enumerate(self._poses) if publisher.get_num_connections()]
        if not watched:
            return
        speeds = self._swarm.world.measure_body_speeds().tolist()
        for index in watched:
            robot = self._swarm.robots[index]
            pose = robot.body.true_pose
            message = Odometry()
            message.header.stamp = stamp
            message.header.frame_id = FRAME
            message.child_frame_id = robot.name + "/base_link"
            message.pose.pose.position = Point(pose.x_m, pose.y_m, 0.0)
            message.pose.pose.orientation = _rotate_about_z(pose.yaw_rad)
            message.twist.twist.linear.x, message.twist.twist.angular.z = speeds[index]
            self._poses[index].publish(message)

    def _publish_objects(self, stamp: rospy.Time) -> None:
        """Publish where objects are, and draw them anew when they have moved."""
        poses = self._swarm.world.object_poses[0].tolist()
        if not poses:
            return
        message = ObjectPoses(objects=[ObjectPose("object_%d" % index, *pose) for index, pose in enumerate(poses)])
        message.header.stamp, message.header.frame_id = stamp, FRAME
        self._objects.publish(message)
        if poses != self._drawn:
            self._drawn = poses
            self._object_markers.publish(MarkerArray(_draw_objects(self._swarm.world.list_objects())))

    def _publish_odom_frames(self, publisher: rospy.Publisher, stamp: rospy.Time) -> None:
        """Place each robot's odom frame in the world, anew whenever its odometry was set."""
        robots = self._swarm.robots
        origins = [robot.body.odom_origin for robot in robots]
        if origins != self._odom_origins:
            self._odom_origins = origins
            publisher.publish(TFMessage([_place_odom(robot, stamp) for robot in robots]))

    @staticmethod
    def _draw_robot(robot: Firmware, time_ms: int) -> List[Marker]:
        index = robot.body.index
        pose = robot.body.true_pose
        red, green, blue, alpha = robot.sensing.show_light(robot.to_millis(time_ms))
        lit = alpha > 0.0 and max(red, green, blue) > 0.0
        color = ColorRGBA(red, green, blue, 1.0) if lit else _DARK_COLOR
        body = _make_marker("robots", index, Marker.CYLINDER, color, pose, BODY_HEIGHT_M / 2.0)
        body.scale.x = body.scale.y = 2.0 * robot.model.radius_m
        body.scale.z = BODY_HEIGHT_M
        nose = _make_marker("headings", index, Marker.ARROW, _NOSE_COLOR, pose, BODY_HEIGHT_M + 0.002)
        nose.scale.x, nose.scale.y, nose.scale.z = BODY_RADIUS_M, 0.008, 0.004
        name = _make_marker("names", index, Marker.TEXT_VIEW_FACING, _NOSE_COLOR, pose, BODY_HEIGHT_M + 0.04)
        name.scale.z = 0.03
        name.text = robot.name
        return [body, nose, name]


def _draw_objects(bodies: Sequence[Body]) -> List[Marker]:
    """Return discs, and the edges of polygons, where they are."""
    markers: List[Marker] = []
    for body in bodies:
        if isinstance(body.shape, Disc):
            circle = (body.x_m, body.y_m, body.shape.reach_m)
            markers.append(_draw_circle("objects", len(markers), circle, _OBJECT_COLOR))
        for start_m, end_m in zip(body.corners_m, [*body.corners_m[1:], *body.corners_m[:1]]):
            markers.append(_draw_wall("objects", len(markers), (*start_m, *end_m), _OBJECT_COLOR))
    return markers


def _rotate_about_z(angle_rad: float) -> Quaternion:
    return Quaternion(0.0, 0.0, math.sin(angle_rad / 2.0), math.cos(angle_rad / 2.0))


def _place_odom(robot: Firmware, stamp: rospy.Time) -> TransformStamped:
    origin = robot.body.odom_origin
    transform = TransformStamped()
    transform.header.stamp = stamp
    transform.header.frame_id = FRAME
    transform.child_frame_id = robot.name + "/odom"
    transform.transform.translation.x = origin.x_m
    transform.transform.translation.y = origin.y_m
    transform.transform.rotation = _rotate_about_z(origin.yaw_rad)
    return transform


def _draw_arena(arena: Arena) -> List[Marker]:
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
    marker.pose.orientation = _rotate_about_z(pose.yaw_rad)
    marker.color = color
    return marker
