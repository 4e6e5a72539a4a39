"""A pose in any frame -> the same pose in a robot's frame, with tf2. Listens to /tf only while it is needed.

/tf of a swarm carries about 150 transforms a second and robot, which a Python program should not read for nothing.
Works in the plane: heights and tilts of frames are left out.
"""

import math
from typing import Any, Optional

import rospy
import tf2_ros

from .control_laws import Pose
from .readings import yaw_of


class FrameError(Exception):
    """There is no way from one frame to another now; the text names both."""


class FrameWatch:
    """The transforms that are known now."""

    def __init__(self) -> None:
        """Listen to nothing yet."""
        self._buffer: Any = None
        self._listener: Any = None

    def open(self) -> None:
        """Begin to listen; safe twice."""
        if self._listener is None:
            self._buffer = tf2_ros.Buffer(debug=False)
            self._listener = tf2_ros.TransformListener(self._buffer, queue_size=100, tcp_nodelay=True)

    def close(self) -> None:
        """Listen no more; safe twice."""
        if self._listener is not None:
            self._listener.unregister()
            self._buffer = self._listener = None

    def origin_of(self, frame: str, within: str) -> Pose:
        """Return the newest pose of the frame's origin in the frame within.

        Raises: FrameError while tf does not lead from one to the other.
        """
        self.open()
        try:
            found = self._buffer.lookup_transform(within, frame, rospy.Time(0)).transform
        except tf2_ros.TransformException as error:
            raise FrameError("no transform from %s to %s: %s" % (frame, within, error)) from None
        return Pose(found.translation.x, found.translation.y, yaw_of(found.rotation))


def shift_pose(origin: Pose, pose: Pose) -> Pose:
    """Return pose, given in a frame whose origin is at origin, in the frame of origin."""
    cos, sin = math.cos(origin.yaw_rad), math.sin(origin.yaw_rad)
    return Pose(
        origin.x_m + cos * pose.x_m - sin * pose.y_m,
        origin.y_m + sin * pose.x_m + cos * pose.y_m,
        origin.yaw_rad + pose.yaw_rad,
    )


def plain_frame(frame: str) -> str:
    """Return the frame's name without the slash that ROS of long ago put first."""
    return frame.lstrip("/")


def wait_for_origin(watch: FrameWatch, frame: str, within: str, timeout_s: float, sleep: Any) -> Optional[Pose]:
    """Return origin_of() as soon as there is one, None after timeout_s or when sleep says to end."""
    for _ in range(max(1, int(timeout_s / 0.05))):
        try:
            return watch.origin_of(frame, within)
        except FrameError:
            if not sleep(0.05):
                return None
    return None
