"""A robot that is stepped in process, for a BaseRobot. Pure."""

import math
import sys
from typing import Callable, List, Optional, Tuple

import numpy as np

from hero_client import values
from hero_node import Pose, Velocity, find_frame, say

from .step_clock import StepClock, StepMotion

WORLD = "world"


class StepLink(values.RobotLink):
    """One robot: a row of RobotRows.

    Attributes:
        clock: the robots' time.
        row: which robot it is.
        is_stopped: whether it takes no motion because all robots are stopped.
        localize: returns where the robot is in the frame map; its ground truth, unless a program sets it.
    """

    connected = True
    is_stopped = False

    def __init__(self, clock: StepClock, row: int, robot_id: int) -> None:
        """Be the robot at row, whose odometry begins where it is."""
        self.clock = clock
        self.row = row
        self._robot_id = robot_id
        self._name = "hero_%d" % robot_id
        self._rows = rows = clock.rows
        self._arrivals_ms = {
            **dict.fromkeys(("odom", "encoder", "neighbors"), rows.odometry_ms),
            **dict.fromkeys(("proximity", "laser"), rows.scan_ms),
            "distance": rows.distance_ms,
        }
        self._origin = self.true_pose
        self.localize: Callable[[], Pose] = lambda: self.true_pose

    @property
    def true_pose(self) -> Pose:
        """The robot's pose in the world."""
        return Pose(*self._rows.world.poses[self.row].tolist())

    @property
    def model(self) -> values.RobotModel:
        return self._rows.models[self.row].dimensions

    def missing(self) -> Optional[str]:
        for topic in ("odom", "proximity"):
            if self.age_s(topic) > values.FRESH_S:
                return f"no message on /{self._name}/{topic}: is the robot on and in reach?"
        return None

    def subscribe(self, topic: str) -> None:
        """Do nothing: everything arrives."""

    def age_s(self, topic: str) -> float:
        arrival_ms = self._arrivals_ms[topic].item(self.row)
        return math.inf if arrival_ms < 0 else (self._rows.now_ms - arrival_ms) / 1000.0

    def wait_for_next(self, topic: str, timeout_s: float, count: int = 1) -> None:
        arrivals_ms = self._arrivals_ms[topic]
        deadline_s = self.clock.now_s + timeout_s
        for _ in range(count):
            last_ms = arrivals_ms[self.row]
            while arrivals_ms[self.row] == last_ms:
                if self.clock.now_s >= deadline_s:
                    raise values.StaleDataError(f"no message on /{self._name}/{topic} within {timeout_s:.1f} s")
                self.clock.sleep(0.001)

    def read_pose(self) -> Pose:
        return Pose(*self._rows.odometry[self.row].tolist())

    def read_velocity(self) -> Velocity:
        return Velocity(*self._rows.velocities[self.row].tolist())

    def read_ranges(self) -> List[float]:
        ranges_m: List[float] = self._rows.proximity_m[self.row].tolist()
        return ranges_m

    def read_infrared_counts(self) -> List[float]:
        counts: List[float] = np.roll(self._rows.counts[self.row], 4).tolist()
        return counts

    def read_distance(self) -> float:
        return float(self._rows.distance_m[self.row])

    def read_neighbors(self) -> List[values.Neighbor]:
        """All robots of the same world are sensed, where they are."""
        world = self._rows.world
        poses = world.poses.reshape(world.worlds, -1, 3)
        robots = poses.shape[1]
        world_row, number = divmod(self.row, robots)
        first_id = self._robot_id - number
        near = values.sense_neighbors(poses[world_row : world_row + 1], values.Neighbors())
        return values.list_neighbors(near, number, range(first_id, first_id + robots))

    def find_localized(self, frame: str, timeout_s: float) -> Optional[Pose]:
        """There is always a localization."""
        return self.localize() if frame == values.MAP else None

    def find_origin(self, frame: str, timeout_s: float) -> Pose:
        """Known are "world" and the robot's own odometry."""
        if frame == WORLD:
            return self._origin
        if frame == self._name + "/odom":
            return Pose(0.0, 0.0, 0.0)
        raise values.FrameError(f"no transform from {self._name}/odom to {frame}: robots in process know map and world")

    def send_velocity(self, linear_m_s: float, angular_rad_s: float) -> None:
        if not self.is_stopped:
            self._rows.send_velocity(self.row, linear_m_s, angular_rad_s)

    def send_color(self, rgb: Tuple[float, float, float]) -> None:
        self._rows.send_light(self.row, (*rgb, 1.0))

    def set_odometry(self, pose: Pose) -> None:
        self._rows.set_odometry(self.row, *pose)
        self._origin = find_frame(self.true_pose, pose)

    def describe_stop(self) -> str:
        return "all robots are stopped. Release them with StepSwarm.release_stop()"

    def start(self, steps: values.Steps) -> values.BackgroundMotion:
        """Take steps while the program waits."""
        return StepMotion(self.clock, steps)

    def log_warning(self, text: str) -> None:
        say(text, sys.stderr)

    def close(self) -> None:
        """Do nothing: there is no connection."""
