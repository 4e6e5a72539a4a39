"""Motion of a robot's wheels in the simulator by the commands of a recording. Pure."""

from collections import deque
from operator import itemgetter
from typing import Dict, NamedTuple, Sequence

import numpy as np

from hero_sim.stepped import RobotRows
from hero_sim.world import KINDS, STEP_MS, RobotErrors, World, draw_errors

from ..trial import OPEN
from .recording import PULSES, Recording, sample_times

_STEP_S = STEP_MS / 1000.0


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
    times_s = np.arange(0.0, recording.time_s + phases_s.max(), _STEP_S)
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
