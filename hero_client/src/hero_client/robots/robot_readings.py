"""Readings of one robot's sensors and odometry: the part of a Robot that only reads. Pure.

Units and frames: see robot_base.
"""

import math
from contextlib import suppress
from typing import List, Optional, Tuple

from hero_node import Pose, Velocity, transform_pose, wrap_angle
from hero_node.robot_constants import RobotModel

from ..values.errors import NotCalibratedError, StaleDataError
from ..values.readings import FRESH_S, NOT_CALIBRATED, Obstacle, find_nearest, is_blind, is_free
from ..values.robot_link import RobotLink
from ..values.sensing import Neighbor
from .group import Group

NEXT_ODOM_S = 5.0
"""The next odometry comes within 0.1 s, on a busy machine within a second."""


class RobotReadings(Group):
    """The readings and the state of one robot."""

    name: str
    namespace: str
    _link: RobotLink
    _first_data_s: float

    def age_s(self, topic: str) -> float:
        """Return the seconds since the last message of "odom", "proximity" or "encoder" arrived.

        inf before the first message.
        """
        return self._link.age_s(topic)

    def await_first(self, topic: str) -> None:
        """Wait for the first message of "odom" or "proximity", in the first 2 s of this object only."""
        if self._link.age_s(topic) == math.inf and self.now_s < self._first_data_s:
            with suppress(StaleDataError):  # reported by those who read it
                self._link.wait_for_next(topic, self._first_data_s - self.now_s)

    def _check_fresh(self, topic: str) -> None:
        age_s = self._link.age_s(topic)
        if age_s == math.inf:
            self.await_first(topic)
            age_s = self._link.age_s(topic)
        if age_s <= FRESH_S:
            return
        name = f"{self.namespace}/{topic}"
        if age_s == math.inf:
            raise StaleDataError(f"no message on {name} yet: is the robot on, and does the driver run?")
        raise StaleDataError(f"the last message on {name} came {age_s:.1f} s ago: has the robot gone?")

    def _check_asked(self, topic: str) -> None:
        """Check that a topic, which only its readers subscribe to, has fresh data. Raises: StaleDataError."""
        self._link.subscribe(topic)
        if self._link.age_s(topic) == math.inf:
            self._link.wait_for_next(topic, NEXT_ODOM_S)
        self._check_fresh(topic)

    @property
    def pose(self) -> Pose:
        """The robot's pose by its odometry, in the frame hero_N/odom: 0, 0, 0 where it was switched on.

        In the first 2 s of a Robot it waits for the first odometry, as other data properties wait for theirs.
        Raises: StaleDataError if odometry is older than 1 s.
        """
        self._check_fresh("odom")
        return self._link.read_pose()

    def pose_in(self, frame: str, timeout_s: float = 2.0) -> Pose:
        """Return where the robot is in another frame, such as "map", which hero_localization gives all robots.

        A frame that localize does not know, such as "world" of simulated robots, is looked up in tf: the first such
        call subscribes to /tf, which is a load with many robots. What is not known yet is waited for up to timeout_s.

        Raises: StaleDataError as `pose`, or if the robot drove on where nothing measures it. FrameError if the robot
        was never measured, or tf does not connect frame with hero_N/odom.
        """
        frame = frame.lstrip("/")
        localized = self._link.find_localized(frame, timeout_s)
        pose = localized or transform_pose(self._link.find_origin(frame, timeout_s), self.pose)
        return pose._replace(yaw_rad=wrap_angle(pose.yaw_rad))

    @property
    def velocity(self) -> Velocity:
        """Velocity by odometry, in hero_N/base_link. Raises: StaleDataError as `pose`."""
        self._check_fresh("odom")
        return self._link.read_velocity()

    @property
    def proximity(self) -> List[float]:
        """Eight ranges in m from the robot's center, front first, counter-clockwise, 45 degrees apart.

        Index 0 is the front, 2 left, 4 rear, 6 right. inf: nothing in range (0.24 m); 0.0: too close to measure (0.047
        m); nan: not calibrated. The topic /hero_N/proximity has the same ranges rear first (index 4 is the front), and
        -Inf for too close.

        Raises: StaleDataError if they are older than 1 s.
        """
        self._check_fresh("proximity")
        return self._link.read_ranges()

    @property
    def wheel_speeds(self) -> Tuple[float, float]:
        """Speeds of the left and right wheel at the rim, m/s, by the odometry. Raises: StaleDataError as `pose`."""
        linear_m_s, angular_rad_s = self.velocity
        turning_m_s = angular_rad_s * self.model.wheel_separation_m / 2.0
        return linear_m_s - turning_m_s, linear_m_s + turning_m_s

    @property
    def infrared_counts(self) -> List[float]:
        """Readings of the eight infrared sensors without ambient light, in counts; in the order of `proximity`.

        The first use subscribes, and waits up to 5 s. Raises: StaleDataError if they are older than 1 s.
        """
        self._check_asked("laser")
        return self._link.read_infrared_counts()

    @property
    def distance(self) -> float:
        """The distance ahead by HeRo+'s sensor, in m from the robot's center; it sees 0.04 to 2.9 m.

        The first use waits up to 5 s. Raises: StaleDataError as `pose`, also on a robot without the sensor.
        """
        self._check_asked("distance")
        return self._link.read_distance()

    @property
    def neighbors(self) -> List[Neighbor]:
        """Robots around, nearest first, by `rosrun hero_swarm virtual_sensors`; in process, all of the world.

        The first use waits up to 5 s. Raises: StaleDataError if they are older than 1 s, or the own pose is not known.
        """
        try:
            self._check_asked("neighbors")
        except StaleDataError as error:
            raise StaleDataError(f"{str(error).split(':')[0]}: does `rosrun hero_swarm virtual_sensors` run?") from None
        return self._link.read_neighbors()

    def wait_for_scan(self, timeout_s: float = 2.0) -> List[float]:
        """Wait for the next scan, which comes 5 times a second, and return its ranges as `proximity` does.

        Raises: StaleDataError if none comes within timeout_s.
        """
        self._link.subscribe("proximity")
        self._link.wait_for_next("proximity", timeout_s)
        return self._link.read_ranges()

    def watch(self, topic: str) -> None:
        """Subscribe to a topic, such as "laser", so that the first reading need not wait."""
        self._link.subscribe(topic)

    def fresh_pose(self) -> Optional[Pose]:
        """Return `pose` without waiting, or None if it is not fresh."""
        return self._link.read_pose() if self._link.age_s("odom") <= FRESH_S else None

    def fresh_velocity(self) -> Optional[Velocity]:
        """Return `velocity` without waiting, or None if it is not fresh."""
        return self._link.read_velocity() if self._link.age_s("odom") <= FRESH_S else None

    def fresh_proximity(self) -> List[float]:
        """Return `proximity` without waiting, or eight times nan (not known) if it is not fresh."""
        return self._link.read_ranges() if self._link.age_s("proximity") <= FRESH_S else [math.nan] * 8

    def nearest(self) -> Optional[Obstacle]:
        """Return range (m, from the center) and bearing (rad) of the nearest obstacle; None if nothing is in range.

        Raises: as `pose`. NotCalibratedError if no obstacle is seen, but a sensor that is not calibrated may miss one.
        """
        ranges = self.proximity
        nearest = find_nearest(ranges)
        if nearest is None and not is_free(ranges):
            raise NotCalibratedError(f"what is near {self.name} is not known: {NOT_CALIBRATED}")
        return nearest

    def missing_ranges(self) -> Optional[str]:
        """Return why it is not known what is near the robot, as text for users; None if its sensors tell."""
        age_s = self.age_s("proximity")
        if age_s > FRESH_S:
            late = "it has sent no ranges yet" if age_s == math.inf else f"its last ranges came {age_s:.1f} s ago"
            return self.missing() or late
        return (self.missing() or NOT_CALIBRATED) if is_blind(self.fresh_proximity()) else None

    @property
    def connected(self) -> bool:
        """True while the driver subscribes to the robot's commands, as it does while it knows the robot."""
        return self._link.connected

    @property
    def model(self) -> RobotModel:
        """Dimensions, such as model.body_radius_m; the stock robot's until the driver has reported. Never waits."""
        return self._link.model

    @property
    def is_stopped(self) -> bool:
        """True while the robot takes no motion, as its driver has stopped all robots (emergency stop).

        Never waits. False until the robot's driver has reported, which wait_until_ready() waits for.
        """
        return self._link.is_stopped

    def missing(self) -> Optional[str]:
        """Return why the robot cannot be driven now, as text for users; None if it can."""
        return self._link.missing()
