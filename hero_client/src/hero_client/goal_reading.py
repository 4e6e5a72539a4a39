"""A geometry_msgs/PoseStamped of somebody else's -> a Goal and a frame that a robot may be sent to, or why not.

Pure: messages are read, never made. What passes here makes no command that is not a number, and no frame name that
tf2 or a log line cannot take.
"""

import math
from typing import Any, Tuple

from .goal_pursuit import Goal
from .readings import yaw_of

LARGEST_M = 1e6
"""Largest coordinate of a goal; the driver takes poses within the same. Much more, and sums lose the robot's way."""

LARGEST_TURN = 1e3
"""Largest entry of a quaternion, which has the length 1 if it is one."""

LONGEST_FRAME = 200


class GoalError(ValueError):
    """A goal that no robot can be sent to; the text says why."""


def read_goal(message: Any, use_heading: bool) -> Tuple[Goal, str]:
    """Return the goal in message and its frame (empty: the robot's own odometry).

    A quaternion of zeros, as tools send that do not care, means no heading.
    Raises: GoalError.
    """
    frame = message.header.frame_id
    if not frame.isprintable() or len(frame) > LONGEST_FRAME:
        raise GoalError(
            "frame_id must be up to %d printable characters, not %s" % (LONGEST_FRAME, ascii(frame[:40]))
        )
    place, turn = message.pose.position, message.pose.orientation
    if not (abs(place.x) <= LARGEST_M and abs(place.y) <= LARGEST_M):
        raise GoalError(
            "a goal must be finite, not (%g, %g), and within %g m" % (place.x, place.y, LARGEST_M)
        )
    if not use_heading:
        return Goal(place.x, place.y), frame
    entries = (turn.x, turn.y, turn.z, turn.w)
    if not all(abs(entry) <= LARGEST_TURN for entry in entries):
        raise GoalError("the goal's orientation is no quaternion: (%g, %g, %g, %g)" % entries)
    known = sum(abs(entry) for entry in entries) > 1e-6
    return Goal(place.x, place.y, yaw_of(turn) if known else None), frame


def check_limits(tolerance_m: float, timeout_s: float) -> None:
    """Raises: GoalError unless both are more than 0 and finite."""
    if not (0.0 < tolerance_m < math.inf and 0.0 < timeout_s < math.inf):
        raise GoalError(
            "tolerance and timeout must be finite and not negative, not %g m, %g s" % (tolerance_m, timeout_s)
        )
