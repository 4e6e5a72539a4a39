"""Own readings of robots over ROS, as arrays with the names of RobotRows; NaN for what is not fresh."""

from contextlib import suppress
from typing import Any, Callable, Mapping

import numpy as np

from hero_client import Swarm
from hero_client.values import StaleDataError

from ..sensors.own import Distance, Odometry, Proximity

TOPICS = {Proximity: ("proximity", "laser"), Odometry: ("odom",), Distance: ("distance",)}
"""Topics that each sensor reads; others subscribe to none of them."""


class OwnReadings:
    """The newest readings of all robots of a swarm."""

    def __init__(self, swarm: Swarm, sensors: Mapping[str, Any]) -> None:
        """Subscribe to what the sensors of a behavior read."""
        self._swarm = swarm
        for topic in {topic for sensor in sensors.values() for topic in TOPICS.get(type(sensor), ())}:
            for robot in swarm:
                robot.watch(topic)

    @property
    def proximity_m(self) -> np.ndarray:
        """Ranges of the infrared sensors (R, 8), front first."""
        return np.array([robot.fresh_proximity() for robot in self._swarm])

    @property
    def counts(self) -> np.ndarray:
        """Counts of the infrared sensors (R, 8), rear first."""
        return np.roll(self._read("laser", lambda robot: robot.infrared_counts, 8), 4, axis=1)

    @property
    def distance_m(self) -> np.ndarray:
        """Distances ahead of HeRo+ (R,)."""
        return self._read("distance", lambda robot: [robot.distance], 1)[:, 0]

    @property
    def odometry(self) -> np.ndarray:
        """Poses by odometry (R, 3), each in its robot's own frame."""
        return np.array([robot.fresh_pose() or [np.nan] * 3 for robot in self._swarm])

    @property
    def velocities(self) -> np.ndarray:
        """Linear m/s and angular rad/s by odometry (R, 2)."""
        return np.array([robot.fresh_velocity() or [np.nan] * 2 for robot in self._swarm])

    def _read(self, topic: str, read: Callable[[Any], Any], columns: int) -> np.ndarray:
        """Return what robots tell, without waiting for what they did not send yet."""
        values = np.full((len(self._swarm), columns), np.nan)
        for row, robot in enumerate(self._swarm):
            with suppress(StaleDataError):
                if robot.age_s(topic) < np.inf:
                    values[row] = read(robot)
        return values
