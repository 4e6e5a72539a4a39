"""Ground truth of the simulated world in ROS: true poses, markers for RViz, and the simulated time.

Publishes only; called by the simulator's thread after a physics step, so nothing here may wait.
Frame of everything: `world`, the arena's own.
"""

from typing import Iterable, List, Optional, Tuple

import rospy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from hero_node import Pose
from hero_node.ros_messages import encode_odometry, encode_transforms

from .scene import FRAME, START_S, Shape, draw_arena, draw_objects, draw_robots, encode_markers
from .simulator import Simulator

POSE_PERIOD_MS = 50
MARKER_PERIOD_MS = 100
"""Simulated time between two publications."""


def make_markers(shapes: Iterable[Shape], time_ns: int = 0) -> MarkerArray:
    """Return shapes as the message, for RViz and the monitor's map; time_ns: of its stamp."""
    markers: MarkerArray = MarkerArray().deserialize(encode_markers(time_ns, shapes))
    return markers


class GroundTruth:
    """The publishers of one simulator."""

    def __init__(self, simulator: Simulator, with_clock: bool, with_tf: bool) -> None:
        """Advertise everything; with_clock also drives /clock, with_tf places the odom frames in the world."""
        self._swarm = simulator.swarm
        self._clock = rospy.Publisher("/clock", Clock, queue_size=10) if with_clock else None
        self._markers = rospy.Publisher("~markers", MarkerArray, queue_size=2)
        self._arena = rospy.Publisher("~arena", MarkerArray, queue_size=1, latch=True)
        self._objects: Optional[rospy.Publisher] = None
        self._object_markers = rospy.Publisher("~object_markers", MarkerArray, queue_size=1, latch=True)
        self._drawn: List[List[float]] = []
        self._static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True) if with_tf else None
        self._poses = [
            rospy.Publisher(f"/{robot.name}/ground_truth", Odometry, queue_size=2) for robot in self._swarm.robots
        ]
        self._odom_origins: List[Tuple[str, str, Pose]] = []
        self._arena.publish(make_markers(draw_arena(self._swarm.world.arena)))
        self._object_markers.publish(make_markers([]))  # those of an earlier simulator are gone
        self._swarm.after_step = self.publish
        self.publish(self._swarm.world.time_ms)

    def publish(self, time_ms: int) -> None:
        """Publish what is due at time_ms of the world."""
        if self._clock is not None:
            stamp = rospy.Time(START_S + time_ms // 1000, time_ms % 1000 * 10**6)
            self._clock.publish(Clock(stamp))
        else:
            stamp = rospy.Time.now()
        if time_ms % POSE_PERIOD_MS == 0:
            self._publish_poses(stamp)
            if self._static is not None:
                self._publish_odom_frames(self._static, stamp)
            self._publish_objects(stamp)
        if time_ms % MARKER_PERIOD_MS == 0 and self._markers.get_num_connections():
            names = [robot.name for robot in self._swarm.robots]
            lights = [robot.sensing.show_light(robot.to_millis(time_ms)) for robot in self._swarm.robots]
            self._markers.publish(make_markers(draw_robots(self._swarm.world, names, lights), stamp.to_nsec()))

    def _publish_poses(self, stamp: rospy.Time) -> None:
        watched = [index for index, publisher in enumerate(self._poses) if publisher.get_num_connections()]
        if not watched:
            return
        speeds = self._swarm.world.measure_body_speeds().tolist()
        for index in watched:
            robot = self._swarm.robots[index]
            place = FRAME, robot.name + "/base_link", (stamp.secs, stamp.nsecs), robot.body.true_pose
            content = encode_odometry(*place, speeds[index])
            self._poses[index].publish(Odometry().deserialize(content))

    def _publish_objects(self, stamp: rospy.Time) -> None:
        """Publish where objects are, and draw them anew when they have moved."""
        poses = self._swarm.world.object_poses[0].tolist()
        if not poses:
            return
        from hero_msgs.msg import ObjectPose, ObjectPoses  # takes 20 ms, and few arenas have objects

        if self._objects is None:
            self._objects = rospy.Publisher("~objects", ObjectPoses, queue_size=2)
        message = ObjectPoses(objects=[ObjectPose("object_%d" % index, *pose) for index, pose in enumerate(poses)])
        message.header.stamp, message.header.frame_id = stamp, FRAME
        self._objects.publish(message)
        if poses != self._drawn:
            self._drawn = poses
            self._object_markers.publish(make_markers(draw_objects(self._swarm.world.list_objects())))

    def _publish_odom_frames(self, publisher: rospy.Publisher, stamp: rospy.Time) -> None:
        """Place each robot's odom frame in the world, anew whenever its odometry was set."""
        origins = [(FRAME, robot.name + "/odom", robot.body.odom_origin) for robot in self._swarm.robots]
        if origins != self._odom_origins:
            self._odom_origins = origins
            publisher.publish(TFMessage().deserialize(encode_transforms((stamp.secs, stamp.nsecs), origins)))
