"""Display values of one robot: rate, pose, distance driven and nearest obstacle, from its topics.

Unlike Robot it decodes messages only when asked: a swarm sends far more of them than a program reads.
"""

from collections import deque
from typing import Any, Callable, Deque, Dict, Optional, Sequence, Set, Tuple

import genpy
import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from hero_node import Pose, Velocity, measure_distance, wrap_angle

from ..values.readings import Obstacle, find_nearest, front_first, is_free, read_pose
from .extra_topics import find_class, load_fleet_file, read_field

RATE_WINDOW_S = 3.0
"""Long enough that 5 Hz reads steadily, short enough to see a robot fall silent."""


class NewestMessage:
    """A subscription of which only the newest message counts; it is kept as bytes until it is read."""

    def __init__(self, topic: str, message_class: Any) -> None:
        """Subscribe; messages of another layout than message_class's are ignored."""
        self.count = 0
        self._message_class = message_class
        self._bytes: Optional[bytes] = None
        self._subscriber = rospy.Subscriber(topic, rospy.AnyMsg, self._keep, queue_size=10)

    def _keep(self, message: rospy.AnyMsg) -> None:
        if message._connection_header["md5sum"] == self._message_class._md5sum:
            self._bytes = message._buff
            self.count += 1

    @property
    def has_publisher(self) -> bool:
        """Return whether a node that publishes the topic is connected."""
        return bool(self._subscriber.get_num_connections() > 0)

    def take(self) -> Any:
        """Return the newest message; None if no readable one has arrived since the last call."""
        kept, self._bytes = self._bytes, None
        if kept is None:
            return None
        try:
            return self._message_class().deserialize(kept)
        except genpy.DeserializationError:
            return None

    def close(self) -> None:
        """Unsubscribe; may be called twice."""
        self._subscriber.unregister()


class RateMeter:
    """Measures how often something arrived in the last RATE_WINDOW_S; total: how often so far."""

    def __init__(self) -> None:
        self.total = 0
        self._counts: Deque[Tuple[float, int]] = deque()

    def rate_hz(self, now_s: float) -> float:
        """Return the rate since about RATE_WINDOW_S ago; call it more often than that."""
        self._counts.append((now_s, self.total))
        while len(self._counts) > 2 and self._counts[1][0] <= now_s - RATE_WINDOW_S:
            self._counts.popleft()
        (first_s, first), (last_s, last) = self._counts[0], self._counts[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0


class RobotTrack:
    """Readings of one robot's odometry and proximity so far.

    Attributes:
        nearest: obstacle; None if nothing is in range, if is_free, or else because that is not known.
    """

    def __init__(self) -> None:
        self.odometry = RateMeter()
        self.pose: Optional[Pose] = None
        self.velocity: Optional[Velocity] = None
        self.distance_m = 0.0
        self.turned_rad = 0.0
        self.proximity_seen = False
        self.is_free = False
        self.nearest: Optional[Obstacle] = None

    def receive_pose(self, pose: Optional[Pose]) -> None:
        """Take the newest pose, None for an implausible one, and add to distance_m and turned_rad."""
        if pose is not None and self.pose is not None:
            self.distance_m += measure_distance(self.pose, pose)
            self.turned_rad += abs(wrap_angle(pose.yaw_rad - self.pose.yaw_rad))
        self.pose = pose

    def receive_proximity(self, ranges_m: Sequence[float]) -> None:
        """Take the newest ranges, as front_first() gives them; none: the newest scan is invalid."""
        self.proximity_seen = len(ranges_m) > 0
        self.is_free = is_free(ranges_m)
        self.nearest = find_nearest(ranges_m)


class RobotListener:
    """Subscriptions to one robot's odometry and proximity, and to topics that fleet.yaml declares.

    Attributes:
        values: newest values of those topics, by their names.
    """

    def __init__(self, namespace: str) -> None:
        self.track = RobotTrack()
        self.values: Dict[str, Any] = {}
        self._extras = {
            topic: NewestMessage(f"{namespace}/{topic.topic}", find_class(topic)) for topic in load_fleet_file().topics
        }
        self.ranges_m: Sequence[float] = ()
        self._odometry = NewestMessage(namespace + "/odom", Odometry)
        self._proximity = NewestMessage(namespace + "/proximity", LaserScan)

    def read_newest(self) -> None:
        """Read what arrived since the last call."""
        self.track.odometry.total = self._odometry.count
        odometry = self._odometry.take()
        if odometry is not None:
            self.track.receive_pose(read_pose(odometry.pose.pose))
            self.track.velocity = Velocity(odometry.twist.twist.linear.x, odometry.twist.twist.angular.z)
        scan = self._proximity.take()
        for topic, newest in self._extras.items():
            message = newest.take()
            if message is not None:
                self.values[topic.name] = read_field(message, topic)
        if scan is not None:
            self.ranges_m = front_first(scan)
            self.track.receive_proximity(self.ranges_m)

    def close(self) -> None:
        """Unsubscribe."""
        for subscription in (self._odometry, self._proximity, *self._extras.values()):
            subscription.close()


def follow(sources: Dict[str, Any], wanted: Set[str], open_source: Callable[[str], Any]) -> None:
    """Open the sources that are wanted and close the others, one by one: other threads read them meanwhile."""
    for name in sorted(wanted - set(sources)):
        sources[name] = open_source(name)
    for name in set(sources) - wanted:
        sources.pop(name).close()
