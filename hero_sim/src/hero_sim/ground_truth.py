"""The simulated world -> ROS: where robots truly are, what RViz draws, and the simulated time.

Publishes only; called by the simulator's thread after a physics step, so nothing here may wait.
Frame of everything: `world`, the arena's own.
"""

import math
from typing import List, Tuple

import rospy
from geometry_msgs.msg import Point, Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import ColorRGBA
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from .robot.firmware import Firmware
from .robot_constants import BODY_RADIUS_M
from .simulator import Simulator

FRAME = "world"

POSE_PERIOD_MS = 50
MARKER_PERIOD_MS = 100
"""Simulated time between two publications."""

CLOCK_START_S = 1600000000
"""What /clock shows at the start: late enough that nobody takes it for a robot's uptime."""

BODY_HEIGHT_M = 0.045
WALL_HEIGHT_M = 0.05
_WALL_THICKNESS_M = 0.005

_WALL_COLOR = ColorRGBA(0.6, 0.6, 0.6, 1.0)
_DARK_COLOR = ColorRGBA(0.15, 0.15, 0.15, 1.0)
_NOSE_COLOR = ColorRGBA(1.0, 1.0, 1.0, 1.0)


def turn_about_z(angle_rad: float) -> Quaternion:
    """Return the rotation by angle_rad about z."""
    return Quaternion(0.0, 0.0, math.sin(angle_rad / 2.0), math.cos(angle_rad / 2.0))


class GroundTruth:
    """The publishers of one simulator."""

    def __init__(self, simulator: Simulator, with_clock: bool) -> None:
        """Advertise everything; with_clock also drives /clock."""
        self._simulator = simulator
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10) if with_clock else None
        self._markers = rospy.Publisher("~markers", MarkerArray, queue_size=2)
        self._arena = rospy.Publisher("~arena", MarkerArray, queue_size=1, latch=True)
        self._static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        self._poses = [
            rospy.Publisher("/%s/ground_truth" % robot.name, Odometry, queue_size=2)
            for robot in simulator.swarm.robots
        ]
        self._anchors: List[Tuple[float, float, float]] = []
        self._arena.publish(MarkerArray(self._draw_arena()))
        simulator.swarm.after_step = self.publish
        self.publish(simulator.swarm.world.time_ms)

    def _now(self, time_ms: int) -> rospy.Time:
        if self._clock is None:
            return rospy.Time.now()
        return rospy.Time(CLOCK_START_S + time_ms // 1000, time_ms % 1000 * 10**6)

    def publish(self, time_ms: int) -> None:
        """Publish what is due at time_ms of the world."""
        stamp = self._now(time_ms)
        if self._clock is not None:
            self._clock.publish(Clock(stamp))
        if time_ms % POSE_PERIOD_MS == 0:
            self._publish_poses(stamp)
            self._publish_odom_frames(stamp)
        if time_ms % MARKER_PERIOD_MS == 0 and self._markers.get_num_connections():
            self._markers.publish(MarkerArray(self._draw_robots(stamp, time_ms)))

    def _publish_poses(self, stamp: rospy.Time) -> None:
        world = self._simulator.swarm.world
        speeds = None
        for index, publisher in enumerate(self._poses):
            if not publisher.get_num_connections():
                continue
            if speeds is None:
                speeds = world.measure_body_speeds()
            message = Odometry()
            message.header.stamp = stamp
            message.header.frame_id = FRAME
            message.child_frame_id = self._simulator.swarm.robots[index].name + "/base_link"
            x_m, y_m, theta_rad = world.poses[index].tolist()
            message.pose.pose.position = Point(x_m, y_m, 0.0)
            message.pose.pose.orientation = turn_about_z(theta_rad)
            message.twist.twist.linear.x = float(speeds[index, 0])
            message.twist.twist.angular.z = float(speeds[index, 1])
            publisher.publish(message)

    def _publish_odom_frames(self, stamp: rospy.Time) -> None:
        """Place each robot's odom frame in the world, anew whenever its odometry was set."""
        robots = self._simulator.swarm.robots
        anchors = [robot.body.odom_origin for robot in robots]
        if anchors == self._anchors:
            return
        self._anchors = anchors
        self._static.publish(TFMessage([self._place_odom(robot, stamp) for robot in robots]))

    @staticmethod
    def _place_odom(robot: Firmware, stamp: rospy.Time) -> TransformStamped:
        x_m, y_m, theta_rad = robot.body.odom_origin
        transform = TransformStamped()
        transform.header.stamp = stamp
        transform.header.frame_id = FRAME
        transform.child_frame_id = robot.name + "/odom"
        transform.transform.translation.x = x_m
        transform.transform.translation.y = y_m
        transform.transform.rotation = turn_about_z(theta_rad)
        return transform

    def _draw_arena(self) -> List[Marker]:
        arena = self._simulator.swarm.world.arena
        markers = []
        for index, (x1_m, y1_m, x2_m, y2_m) in enumerate(arena.segments_m.tolist()):
            marker = _new_marker("walls", index, Marker.CUBE, _WALL_COLOR)
            marker.pose.position = Point((x1_m + x2_m) / 2.0, (y1_m + y2_m) / 2.0, WALL_HEIGHT_M / 2.0)
            marker.pose.orientation = turn_about_z(math.atan2(y2_m - y1_m, x2_m - x1_m))
            marker.scale.x = math.hypot(x2_m - x1_m, y2_m - y1_m) + _WALL_THICKNESS_M
            marker.scale.y, marker.scale.z = _WALL_THICKNESS_M, WALL_HEIGHT_M
            markers.append(marker)
        for index, (x_m, y_m, radius_m) in enumerate(arena.circles_m.tolist()):
            marker = _new_marker("obstacles", index, Marker.CYLINDER, _WALL_COLOR)
            marker.pose.position = Point(x_m, y_m, WALL_HEIGHT_M / 2.0)
            marker.scale.x = marker.scale.y = 2.0 * radius_m
            marker.scale.z = WALL_HEIGHT_M
            markers.append(marker)
        return markers

    def _draw_robots(self, stamp: rospy.Time, time_ms: int) -> List[Marker]:
        markers = []
        swarm = self._simulator.swarm
        for index, robot in enumerate(swarm.robots):
            x_m, y_m, theta_rad = swarm.world.poses[index].tolist()
            red, green, blue, alpha = robot.sensing.show_light(robot.to_millis(time_ms))
            lit = alpha > 0.0 and max(red, green, blue) > 0.0
            body = _new_marker(
                "robots", index, Marker.CYLINDER, ColorRGBA(red, green, blue, 1.0) if lit else _DARK_COLOR
            )
            body.pose.position = Point(x_m, y_m, BODY_HEIGHT_M / 2.0)
            body.scale.x = body.scale.y = 2.0 * BODY_RADIUS_M
            body.scale.z = BODY_HEIGHT_M
            nose = _new_marker("headings", index, Marker.ARROW, _NOSE_COLOR)
            nose.pose.position = Point(x_m, y_m, BODY_HEIGHT_M + 0.002)
            nose.pose.orientation = turn_about_z(theta_rad)
            nose.scale.x, nose.scale.y, nose.scale.z = BODY_RADIUS_M, 0.008, 0.004
            name = _new_marker("names", index, Marker.TEXT_VIEW_FACING, _NOSE_COLOR)
            name.pose.position = Point(x_m, y_m, BODY_HEIGHT_M + 0.04)
            name.scale.z = 0.03
            name.text = robot.name
            for marker in (body, nose, name):
                marker.header.stamp = stamp
                markers.append(marker)
        return markers


def _new_marker(namespace: str, number: int, kind: int, color: ColorRGBA) -> Marker:
    marker = Marker()
    marker.header.frame_id = FRAME
    marker.ns, marker.id, marker.type, marker.action = namespace, number, kind, Marker.ADD
    marker.pose.orientation.w = 1.0
    marker.color = color
    return marker
