"""Poses of frames by tf2, in the plane: heights and tilts are ignored.

Odometry alone gives the pose relative to where the robot was switched on. The link to another frame comes from tf
(frame -> hero_N/odom): from a tracking system, the simulator, or a static transform.
"""

import time
from functools import lru_cache
from typing import Any

import rospy
import tf2_ros

from .errors import FrameError
from .geometry import Pose, yaw_of

__all__ = ["FrameListener", "share_frames", "strip_slash"]

POLL_PERIOD_S = 0.02


class FrameListener:
    """Looks up transforms, and listens to /tf only from the first lookup until close().

    /tf of a swarm carries about 150 transforms per second and robot, which a Python program should not read in vain.
    """

    def __init__(self) -> None:
        self._buffer: Any = None
        self._listener: Any = None

    def close(self) -> None:
        """Unsubscribe from /tf until the next lookup; safe twice."""
        if self._listener is not None:
            self._listener.unregister()
            self._buffer = self._listener = None

    def origin_of(self, frame: str, within: str) -> Pose:
        """Return the newest pose of the frame's origin in the frame within.

        Raises: FrameError while tf does not connect the two; after the first lookup that takes a moment.
        """
        if self._listener is None:
            self._buffer = tf2_ros.Buffer(debug=False)
            self._listener = tf2_ros.TransformListener(self._buffer, queue_size=100, tcp_nodelay=True)
        try:
            found = self._buffer.lookup_transform(within, frame, rospy.Time(0)).transform
        except tf2_ros.TransformException as error:
            raise FrameError("no transform from %s to %s: %s" % (frame, within, error)) from None
        return Pose(found.translation.x, found.translation.y, yaw_of(found.rotation))


    def wait_for_origin(self, frame: str, within: str, timeout_s: float) -> Pose:
        """As origin_of(), but wait for the transform. Raises: FrameError after timeout_s."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            try:
                return self.origin_of(frame, within)
            except FrameError:
                if time.monotonic() >= deadline_s or rospy.is_shutdown():
                    raise
            time.sleep(POLL_PERIOD_S)


@lru_cache(maxsize=None)
def share_frames() -> FrameListener:
    """Return the listener that all Robot objects of the program share."""
    return FrameListener()


def strip_slash(frame: str) -> str:
    """Return the frame's name without the leading slash of tf's first version."""
    return frame.lstrip("/")


