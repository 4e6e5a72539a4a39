"""Fits servos and delay: replays recorded commands on simulated robots until their wheels roll as recorded. Pure.

After the same velocities, the firmware's controller makes wheels of any servos roll alike, but for small swings that no
two drives share: only servo pulses tell motors.
"""

from collections import deque
from operator import itemgetter
from typing import Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_sim.robot import SPIN_MS
from hero_sim.stepped import RobotRows
from hero_sim.world import KINDS, STEP_MS, RobotErrors, World, draw_errors

from ..trial import OPEN
from .body_fit import follow_body
from .recording import PULSES, SAMPLE_S, Recording, find_slips, interpolate_poses, measure_wheels, sample_times

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

_PHASES_S = np.arange(0.0, SPIN_MS, 8.0) / 1000.0
"""Phases tried for the cycle in which the firmware reads commands; messages do not tell it."""


class Motors(NamedTuple):
    """Motors of one robot, and when commands reach them.

    Attributes:
        values: by key, as --error takes them; others are nominal.
        delay_s: how much later than in the simulator commands work.
        phase_s: simulated time at which the recording's commands begin, which is a time in the cycle in which the
            firmware reads commands.
    """

    values: Dict[str, float]
    delay_s: float = 0.0
    phase_s: float = 0.0


def replay_commands(recording: Recording, motors: Sequence[Motors]) -> np.ndarray:
    """Return how far both wheels (m) of simulated robots have rolled at sample_times(), each alone (T, R, 2)."""
    robots = len(motors)
    rngs = [np.random.RandomState(0) for _ in motors]
    rows = RobotRows(World(OPEN, np.zeros((robots, 3)), rngs, build_errors(motors)))
    phases_s = np.array([own.phase_s for own in motors])
    pending = deque(sorted(
        ((command[0] + phase_s, (phases_s == phase_s).nonzero()[0], command)
         for phase_s in set(phases_s.tolist()) for command in recording.commands.tolist()),
        key=itemgetter(0),
    ))  # fmt: skip
    times_s = np.arange(0.0, recording.time_s + phases_s.max(), STEP_MS / 1000.0)
    travels_m = np.empty((robots, 2, len(times_s)))
    for step, now_s in enumerate(times_s.tolist()):
        while pending and pending[0][0] <= now_s:
            time_s, which, (_, kind, first, second) = pending.popleft()
            rows.advance(max(rows.now_ms, round(1000.0 * time_s)))
            (rows.send_pulses if kind == PULSES else rows.send_velocity)(which, first, second)
        rows.advance(step * STEP_MS)
        travels_m[..., step] = rows.world.travels_m
    # A delay moves all by the same time: unlike that of single commands, of which the firmware reads each at the end
    # of a cycle, this changes the wheels without steps.
    wanted_s = [sample_times(recording) + own.phase_s - own.delay_s for own in motors]
    return np.array(
        [[np.interp(own_s, times_s, wheel_m) for wheel_m in wheels_m] for own_s, wheels_m in zip(wanted_s, travels_m)]
    ).transpose(2, 0, 1)


def build_errors(motors: Sequence[Motors]) -> RobotErrors:
    """Return nominal robots, but for the motors' values."""
    errors = draw_errors((np.random.RandomState(0) for _ in motors), 0.0)
    for row, own in enumerate(motors):
        for key, value in own.values.items():
            kind = KINDS[key]
            getattr(errors, kind.array)[row, kind.columns] = min(max(value, kind.least), kind.most)
    return errors


def fit_motors(recordings: List[Recording]) -> List[Motors]:
    """Return the motors of one robot in each of its recordings; nominal ones without servo pulses."""
    if not any(recording.has_pulses for recording in recordings):
        return [Motors({}) for _ in recordings]
    values, steps, least, most = np.array(list(_PARAMETERS.values())).T
    phases_s = np.zeros(len(recordings))
    for _ in range(_ITERATIONS):
        sloped = np.vstack((values, values + np.diag(steps)))
        differences = np.hstack(
            [
                _compare(recording, [_build_motors(own, phase_s) for own in sloped])
                for recording, phase_s in zip(recordings, phases_s)
            ]
        )
        slopes = (differences[1:] - differences[0]).T  # by steps
        square, gradient = slopes.T @ slopes, slopes.T @ differences[0]
        scale = np.diag(np.maximum(np.diag(square), 1e-12))
        moves = [np.linalg.solve(square + damping * scale, gradient) for damping in _DAMPINGS]
        candidates = np.clip([values - steps * move for move in moves], least, most)
        motors = [_build_motors(own, phase_s) for own in candidates for phase_s in _PHASES_S]
        squares = np.array([(_compare(recording, motors) ** 2).sum(axis=1) for recording in recordings])
        squares = squares.reshape(len(recordings), len(candidates), len(_PHASES_S))
        costs = squares.min(axis=2).sum(axis=0)
        best, last = int(costs.argmin()), float((differences[0] ** 2).sum())
        if costs[best] < last:
            values, phases_s = candidates[best], _PHASES_S[squares[:, best].argmin(axis=1)]
        if costs[best] > (1.0 - _END) * last:
            break
    return [_build_motors(values, phase_s) for phase_s in phases_s]


def _build_motors(values: np.ndarray, phase_s: float) -> Motors:
    named = dict(zip(_PARAMETERS, values.tolist()))
    return Motors(named, named.pop(DELAY), float(phase_s))


def _compare(recording: Recording, motors: Sequence[Motors]) -> np.ndarray:
    """Return the differences of wheel speeds (m/s) of each candidate from those recorded (R, M)."""
    off_m = replay_commands(recording, motors) - measure_wheels(recording, sample_times(recording))[:, None]
    speeds_m_s = (off_m[_WINDOW:] - off_m[:-_WINDOW]) / (_WINDOW * SAMPLE_S)
    return speeds_m_s.transpose(1, 0, 2).reshape(len(motors), -1)


def predict_ends(
    recording: Recording, robots: Sequence[Tuple[Motors, np.ndarray]], start_share: float, path_s: float
) -> np.ndarray:
    """Return how far off (m) the ends of paths of path_s are that start after a share of the recording (R, paths).

    Paths on which it touched a wall are left out.
    Each path begins where the robot was; the simulated robots, motors and body (3,), know the commands alone, or
    without servo pulses the ticks.
    """
    if recording.has_pulses:
        wheels_m = replay_commands(recording, [motors for motors, _ in robots])
    else:
        wheels_m = np.repeat(measure_wheels(recording, sample_times(recording))[:, None], len(robots), axis=1)
    poses = np.stack([follow_body(wheels_m[:, row], body) for row, (_, body) in enumerate(robots)], axis=1)
    times_s = sample_times(recording)
    measured = interpolate_poses(recording.poses, times_s)
    span = round(path_s / SAMPLE_S)
    first = np.searchsorted(times_s, max(start_share * recording.time_s, recording.poses[0, 0]))
    starts = np.arange(first, np.searchsorted(times_s, recording.poses[-1, 0]) - span, span)
    slips_s = find_slips(recording)
    starts = starts[np.searchsorted(slips_s, times_s[starts]) == np.searchsorted(slips_s, times_s[starts + span])]
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
