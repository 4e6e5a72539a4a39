"""Fits servos and delay: replays recorded commands on simulated robots until their wheels roll as recorded. Pure.

Only servo pulses tell them: after the same velocities, the firmware's controller makes wheels of any servos roll alike,
but for small swings that no two drives share.
"""

from typing import Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_sim.world.robot_errors import KINDS, RobotErrors, draw_errors

from .recording import PULSES, SAMPLE_S, Recording, measure_wheels, replay_commands, sample_times

__all__ = ["SLIP_MEAN", "Fit", "build_errors", "fit_motors", "predict_ends"]

DELAY = "delay_s"

_PARAMETERS = {  # start, step of the slope, least, most
    "left_gain": (1.0, 0.03, 0.3, 3.0),
    "right_gain": (1.0, 0.03, 0.3, 3.0),
    "dead_zone_us": (30.0, 4.0, 0.0, 150.0),
    "lag_s": (0.08, 0.02, 0.005, 1.0),
    DELAY: (0.0, 0.03, 0.0, 1.0),
    "left_center_us": (1500.0, 4.0, 1300.0, 1700.0),
    "right_center_us": (1500.0, 4.0, 1300.0, 1700.0),
}
_DAMPINGS = (1e-3, 1e-2, 0.1, 1.0, 10.0)
_ITERATIONS = 12
_END = 1e-3
"""It ends when an iteration makes the error smaller by less than this share."""

_WINDOW = 4
"""Samples, over which wheel speeds are compared."""

SLIP_MEAN = float(np.sqrt(2.0 / np.pi))
"""Mean share of travel that is lost, by the sd that `slip` is."""


class Fit(NamedTuple):
    """The differences of one robot.

    Attributes:
        values: by key, as --error takes them.
        delay_s: how much later than in the simulator commands work.
        before_m, after_m: median error at the ends of held-out paths, of a robot as on the drawing and of this one.
    """

    name: str
    values: Dict[str, float]
    delay_s: float
    before_m: float
    after_m: float


def build_errors(candidates: Sequence[Dict[str, float]]) -> RobotErrors:
    """Return robots as on the drawing, without chance, but for the given values."""
    errors = draw_errors((np.random.RandomState(0) for _ in candidates), 0.0)
    for row, values in enumerate(candidates):
        for key, value in values.items():
            kind = KINDS[key]
            getattr(errors, kind.array)[row, kind.columns] = min(max(value, kind.least), kind.most)
    return errors


def _split(values: np.ndarray, names: Sequence[str]) -> Tuple[Dict[str, float], float]:
    named = dict(zip(names, values.tolist()))
    delay_s = round(max(named.pop(DELAY), 0.0), 3)
    return named, delay_s


def fit_motors(recordings: List[Recording], end_share: float) -> Tuple[Dict[str, float], float]:
    """Return values by key and the delay (s), from the first share of each recording of one robot.

    Nothing, and no delay, without servo pulses.
    """
    if not any((recording.commands[:, 1] == PULSES).any() for recording in recordings):
        return {}, 0.0
    names = list(_PARAMETERS)
    values, steps, least, most = np.array([_PARAMETERS[name] for name in names]).T

    def compare(candidates: np.ndarray) -> np.ndarray:
        return np.hstack([_compare(recording, candidates, names, end_share) for recording in recordings])

    for _ in range(_ITERATIONS):
        differences = compare(np.vstack((values, values + np.diag(steps))))
        slopes = (differences[1:] - differences[0]).T  # by steps
        square, gradient = slopes.T @ slopes, slopes.T @ differences[0]
        scale = np.diag(np.maximum(np.diag(square), 1e-12))
        moves = [np.linalg.solve(square + damping * scale, gradient) for damping in _DAMPINGS]
        candidates = np.clip([values - steps * move for move in moves], least, most)
        costs = (compare(candidates) ** 2).sum(axis=1)
        last = float((differences[0] ** 2).sum())
        if costs.min() < last:
            values = candidates[int(costs.argmin())]
        if costs.min() > (1.0 - _END) * last:
            break
    return _split(values, names)


def _compare(recording: Recording, candidates: np.ndarray, names: Sequence[str], end_share: float) -> np.ndarray:
    """Return the differences of wheel speeds (m/s) of each candidate from those recorded (R, M)."""
    split = [_split(values, names) for values in candidates]
    end_s = end_share * recording.time_s
    part = recording._replace(odometry=recording.odometry[recording.odometry[:, 0] <= end_s])
    travels_m = replay_commands(part, build_errors([named for named, _ in split]), [delay_s for _, delay_s in split])[0]
    recorded_m = measure_wheels(part, sample_times(part))
    off_m = travels_m - recorded_m[:, None]
    speeds_m_s = (off_m[_WINDOW:] - off_m[:-_WINDOW]) / (_WINDOW * SAMPLE_S)
    return speeds_m_s.transpose(1, 0, 2).reshape(len(candidates), -1)


def predict_ends(
    recording: Recording, robots: Sequence[Tuple[Dict[str, float], float]], start_share: float, path_s: float
) -> np.ndarray:
    """Return how far off (m) the ends of paths of path_s are that start after a share of the recording (R, paths).

    Each path begins where the robot was; the simulated robots, values by key and delay, know the commands alone.
    """
    errors, delays_s = build_errors([values for values, _ in robots]), [delay_s for _, delay_s in robots]
    poses = replay_commands(recording, errors, delays_s)[1]
    times_s = sample_times(recording)
    measured = np.column_stack(
        [np.interp(times_s, recording.poses[:, 0], column)
         for column in (*recording.poses[:, 1:3].T, np.unwrap(recording.poses[:, 3]))]
    )  # fmt: skip
    span = round(path_s / SAMPLE_S)
    first = np.searchsorted(times_s, max(start_share * recording.time_s, recording.poses[0, 0]))
    starts = np.arange(first, np.searchsorted(times_s, recording.poses[-1, 0]) - span, span)
    if not len(starts):
        return np.empty((len(robots), 0))
    true_m = _see_from(measured[starts], measured[starts + span])
    ends_m = _see_from(poses[starts], poses[starts + span])
    off_m = ends_m - true_m[:, None]
    distances_m: np.ndarray = np.hypot(off_m[..., 0], off_m[..., 1]).T
    return distances_m


def _see_from(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return where poses end (..., 3) are as seen from poses start, forward and left m (..., 2)."""
    x_m, y_m = end[..., 0] - start[..., 0], end[..., 1] - start[..., 1]
    cosine, sine = np.cos(start[..., 2]), np.sin(start[..., 2])
    return np.stack((cosine * x_m + sine * y_m, cosine * y_m - sine * x_m), axis=-1)
