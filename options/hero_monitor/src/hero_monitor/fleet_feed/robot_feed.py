"""The topics of one robot that the page shows."""

import time
from typing import Optional, Tuple

from geometry_msgs.msg import PoseStamped
from std_msgs.msg import ColorRGBA

from hero_client.ros import NewestMessage, RobotListener
from hero_client.values import read_pose
from hero_node import Pose, measure_distance

from .page_state import encode_color
from .placement import Placement

LIGHT_S = 15.0
"""The firmware switches the LED off this long after the last command (LEDStatus.ino:76)."""

REACHED_M = 0.02
"""A goal within this distance is reached and no longer drawn; go_to_goal stops within 0.01 m."""


class RobotFeed:
    """One robot, while a page is open."""

    def __init__(self, namespace: str) -> None:
        self.name = namespace.strip("/")
        self.listener = RobotListener(namespace)
        self.light: Optional[str] = None
        self._light_end_s = 0.0
        self._goal: Optional[Tuple[str, Pose]] = None
        self._led = NewestMessage(namespace + "/led", ColorRGBA)
        self._goals = NewestMessage(namespace + "/goal", PoseStamped)

    def read_newest(self) -> None:
        """Read what arrived since the last call."""
        self.listener.read_newest()
        now_s = time.monotonic()
        color = self._led.take()
        if color is not None:
            self.light = encode_color(color.r, color.g, color.b)
            self._light_end_s = now_s + LIGHT_S
        elif now_s > self._light_end_s:
            self.light = None
        goal = self._goals.take()
        if goal is not None:
            pose = read_pose(goal.pose)
            self._goal = None if pose is None else (goal.header.frame_id.lstrip("/"), pose)

    def find_goal(self, placement: Placement) -> Optional[Pose]:
        """Return the robot's goal on the map; None if there is none, it is reached, or its frame is unknown."""
        if self._goal is None:
            return None
        frame, goal = self._goal
        if frame == self.name + "/odom":
            goal = placement.to_map(self.name, goal)
        elif frame != placement.frame:
            return None
        pose = self.listener.track.pose
        if pose is not None:
            here = placement.to_map(self.name, pose)
            if measure_distance(goal, here) < REACHED_M:
                self._goal = None
                return None
        return goal

    def close(self) -> None:
        """End the subscriptions."""
        self.listener.close()
        self._led.close()
        self._goals.close()
