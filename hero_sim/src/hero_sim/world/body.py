"""The hardware of one robot, as its firmware sees it: one row of the world's arrays.

Pure: time is the robot's own, ms since it was switched on.
"""

from typing import Dict, List

import numpy as np

from hero_node import Pose, find_frame

from .kinematics import join_wheels
from .world import STEP_MS, World, drive_servos


class SharedReadings:
    """The infrared readings of all robots in a world.

    Those that are due in the same physics step are computed together: five cost hardly more than one.

    Attributes:
        due_ms: when each robot is expected to read its sensors (R,); one that reads at another time is computed alone.
    """

    def __init__(self, world: World) -> None:
        """Expect no reading yet."""
        self.due_ms = np.full(len(world.poses), -STEP_MS)
        self._world = world
        self._time_ms = -1
        self._readings: Dict[int, np.ndarray] = {}

    def read(self, row: int) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors of a robot; each is given once."""
        time_ms = self._world.time_ms
        if self._time_ms != time_ms:
            self._time_ms, self._readings = time_ms, {}
        if row not in self._readings:
            # A step's state is shown until its next one.
            due = (self.due_ms > time_ms) & (self.due_ms <= time_ms + STEP_MS)
            due[row] = True
            rows = due.nonzero()[0]
            self._readings = dict(zip(rows.tolist(), self._world.read_infrared(rows)))
        self.due_ms[row] = -STEP_MS
        return self._readings.pop(row)


class Body:
    """One robot's wheels, servos, infrared sensors and place.

    Attributes:
        index: its row in the world.
        booted_ms: the world's time at which it was switched on.
        odom_origin: true pose of the robot's odom frame, since its odometry was last set. A restart of the
            firmware does not change it: odometry continues where it was.
    """

    def __init__(self, world: World, index: int, infrared: SharedReadings) -> None:
        """Be the robot at index of world, whose infrared readings all its robots share."""
        self._world = world
        self.index = index
        self.booted_ms = 0
        self._infrared = infrared
        centers_us, dead_zone_us = world.errors.servo_center_us[index], world.errors.dead_zone_us[index, 0]
        self._servos = centers_us.tolist(), [float(dead_zone_us)] * 2, world.servo_gains_m_s_us[index].tolist()
        self.odom_origin = self.true_pose

    @property
    def true_pose(self) -> Pose:
        """The robot's pose in the world."""
        return Pose(*self._world.poses[self.index].tolist())

    @property
    def travels_m(self) -> List[float]:
        """The travel of the left and right wheel at the end of the last step."""
        return self._world.wheel_rows[self.index][:2]

    @property
    def angular_rad_s(self) -> float:
        """Angular velocity by the wheels."""
        left_m_s, right_m_s = self._world.speeds_m_s[self.index].tolist()
        _, angular_rad_s = join_wheels(left_m_s, right_m_s, self._world.errors.wheel_separation_m[self.index, 0])
        return float(angular_rad_s)

    def set_odometry(self, pose: Pose) -> None:
        """Place the odom frame where the robot's odometry is now pose."""
        self.odom_origin = find_frame(self.true_pose, pose)

    def read_wheels(self, now_ms: int) -> List[float]:
        """Return the travel (m) of the left and right wheel, at a time within the running step."""
        left_m, right_m, left_m_s, right_m_s = self._world.wheel_rows[self.index]
        since_step_s = (self.booted_ms + now_ms - self._world.time_ms) / 1000.0
        return [left_m + left_m_s * since_step_s, right_m + right_m_s * since_step_s]

    def expect_infrared(self, at_ms: int) -> None:
        """Note when the next reading of the eight sensors is due."""
        self._infrared.due_ms[self.index] = self.booted_ms + at_ms

    def read_infrared(self) -> np.ndarray:
        """Return one noisy reading (whole counts, 0..1023) of the eight sensors."""
        return self._infrared.read(self.index)

    def read_distance(self) -> float:
        """Return one noisy reading (m) of the distance sensor ahead, from the robot's center."""
        return float(self._world.read_distances(np.array([self.index]))[0])

    def write_pulses(self, left_us: int, right_us: int) -> None:
        """Set the servos' pulses; below its center the left wheel rolls forward."""
        pulses_us = zip((left_us, right_us), *self._servos)
        # Single numbers take a quarter of the time of arrays.
        self._world.commands_m_s[self.index] = [drive_servos(*servo, least=min, most=max) for servo in pulses_us]

    def release(self) -> None:
        """Stop the pulses: the wheels come to rest."""
        self._world.release(self.index)
