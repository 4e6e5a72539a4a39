"""What was recorded of one robot, and how it drives in the simulator by the same commands. Pure."""

from typing import Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_client.values.robot_constants import WHEEL_SEPARATION_M
from hero_sim.stepped.robot_rows import RobotRows
from hero_sim.world.robot_errors import RobotErrors
from hero_sim.world.world import World

from ..trial import OPEN

__all__ = ["PULSES", "SAMPLE_S", "VELOCITY", "Recording", "measure_wheels", "replay_commands", "sample_times"]

VELOCITY, PULSES = 0, 1
"""Kinds of commands."""

SAMPLE_S = 0.05


class Recording(NamedTuple):
    """One robot; times in s from the start.

    Attributes:
        commands: time, kind, linear m/s and angular rad/s or left and right servo pulse us (C, 4).
        odometry: time, x m, y m, yaw rad, by the ticks of wheels as on the drawing (T, 4).
        poses: time, x m, y m, yaw rad in a fixed frame (P, 4).
    """

    name: str
    commands: np.ndarray
    odometry: np.ndarray
    poses: np.ndarray

    @property
    def time_s(self) -> float:
        """Time of the last odometry."""
        return float(self.odometry[-1, 0])

    def cut(self, start_s: float, end_s: float) -> "Recording":
        """Return the poses of a part, with all commands and odometry."""
        inside = (self.poses[:, 0] >= start_s) & (self.poses[:, 0] <= end_s)
        return self._replace(poses=self.poses[inside])


def sample_times(recording: Recording) -> np.ndarray:
    """Return the times (s) at which replay_commands() yields travels and poses."""
    return np.arange(1, int(recording.time_s / SAMPLE_S)) * SAMPLE_S


def measure_wheels(recording: Recording, times_s: np.ndarray) -> np.ndarray:
    """Return how far the ticks say that both wheels have rolled at these times, m (T, 2)."""
    _, x_m, y_m, yaw_rad = recording.odometry.T
    turns_rad = np.diff(np.unwrap(yaw_rad))
    middle_rad = yaw_rad[:-1] + turns_rad / 2.0
    paths_m = np.diff(x_m) * np.cos(middle_rad) + np.diff(y_m) * np.sin(middle_rad)
    halves_m = turns_rad * (WHEEL_SEPARATION_M / 2.0)
    rolled_m = np.cumsum(np.vstack(([(0.0, 0.0)], np.column_stack((paths_m - halves_m, paths_m + halves_m)))), axis=0)
    return np.column_stack([np.interp(times_s, recording.odometry[:, 0], column) for column in rolled_m.T])


def replay_commands(
    recording: Recording, errors: RobotErrors, delays_s: Sequence[float]
) -> Tuple[np.ndarray, np.ndarray]:
    """Return travels of both wheels (T, R, 2) and poses (T, R, 3) at sample_times() of simulated robots, each alone.

    errors: of R robots; delays_s (R,): so much later than recorded each of them gets the commands.
    """
    robots = len(errors.slip)
    starts = np.zeros((robots, 3))
    rows = RobotRows(World(OPEN, starts, [np.random.RandomState(0) for _ in range(robots)], errors))
    events = _list_events(recording, delays_s)
    pending = next(events, None)
    travels, poses = [], []
    for time_s in sample_times(recording):
        while pending is not None and pending[0] <= time_s:
            rows.advance(max(rows.now_ms, round(1000.0 * pending[0])))
            _, receivers, (_, kind, first, second) = pending
            send = rows.send_pulses if kind == PULSES else rows.send_velocity
            send(np.array(receivers), np.full(len(receivers), first), np.full(len(receivers), second))
            pending = next(events, None)
        rows.advance(max(rows.now_ms, round(1000.0 * time_s)))
        travels.append(rows.world.travels_m.copy())
        poses.append(rows.world.poses.copy())
    return np.array(travels), np.array(poses)


def _list_events(
    recording: Recording, delays_s: Sequence[float]
) -> Iterator[Tuple[float, List[int], Tuple[float, float, float, float]]]:
    """Yield time, receivers and command, sorted by time; those with the same delay get a command together."""
    groups = {delay_s: [row for row, own_s in enumerate(delays_s) if own_s == delay_s] for delay_s in set(delays_s)}
    commands = [tuple(command) for command in recording.commands.tolist()]
    events = [(command[0] + delay_s, rows, command) for delay_s, rows in groups.items() for command in commands]
    return iter(sorted(events))
