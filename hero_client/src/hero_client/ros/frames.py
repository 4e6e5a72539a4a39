"""Poses of frames by tf2, in the plane: heights and tilts are ignored.

Odometry alone gives the pose relative to where the robot was switched on. The link to another frame comes from tf
(frame -> hero_N/odom): from a tracking system, the simulator, or a static transform.
"""

import time
from functools import lru_cache

import rospy
import tf2_ros

from hero_node import Pose, one_line, pose_of

from ..values.errors import FrameError, StaleDataError
from ..values.readings import FRESH_S

POLL_PERIOD_S = 0.02


@lru_cache(maxsize=None)
def listen() -> tf2_ros.Buffer:
    """Return the transforms that all robots of the program share; the first call subscribes to /tf.

    That carries about 150 transforms per second and robot.
    """
    buffer = tf2_ros.Buffer(debug=False)
    buffer.listener = tf2_ros.TransformListener(buffer, queue_size=100, tcp_nodelay=True)
    return buffer


def find_origin(frame: str, within: str, timeout_s: float) -> Pose:
    """Return the newest pose of the frame's origin in the frame within.

    Raises: FrameError if tf does not connect the two within timeout_s; after the start that takes a moment.
    StaleDataError if it is stamped ahead: newer ones would not count until then.
    """
    deadline_s = time.monotonic() + timeout_s
    while True:
        try:
            found = listen().lookup_transform(within, frame, rospy.Time(0))
            ahead_s = (found.header.stamp - rospy.Time.now()).to_sec()
            if ahead_s > FRESH_S:
                text = "the transform from %s to %s is stamped %.1f s ahead: do the clocks of its publishers agree?"
                raise StaleDataError(text % (within, frame, ahead_s))
            return pose_of(found.transform.translation, found.transform.rotation)
        except tf2_ros.TransformException as error:
            if time.monotonic() >= deadline_s or rospy.is_shutdown():
                raise FrameError(
                    "no transform from %s to %s (%s): start what publishes it, such as localize for map;"
                    " simulated robots have the frame world" % (frame, within, one_line(error).rstrip(" ."))
                ) from None
        time.sleep(POLL_PERIOD_S)
