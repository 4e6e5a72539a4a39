"""Fits how far wheels really roll, and how far apart they are, to poses in a fixed frame. Pure.

Odometry by the ticks is laid over the poses of each short stretch; what does not fit is the body's (the idea is that of
J. Borenstein, L. Feng, Measurement and correction of systematic odometry errors in mobile robots, IEEE T-RA 1996,
on any path instead of a square).
"""

from typing import Iterator, List

import numpy as np
from scipy.optimize import least_squares

from hero_client.values import WHEEL_SEPARATION_M, follow_wheels

from .recording import Recording, find_slips, measure_wheels

STRETCH_S = 8.0
POSE_PERIOD_S = 0.1
HEADING_M = 0.1
"""An error of one radian counts as one of this many meters."""

MIN_TURN_RAD = 6.0
"""Less turning tells too little of the distance between the wheels."""


def follow_body(wheels_m: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Return poses (K, 3) from 0, 0, 0 for what the ticks of both wheels say (K, 2).

    body: travel by travel of the ticks, left and right, and distance between the wheels by the nominal one (3,).
    """
    return follow_wheels(wheels_m * body[:2], WHEEL_SEPARATION_M * body[2])


def fit_body(recordings: List[Recording]) -> np.ndarray:
    """Return the body (3,), as follow_body() takes it, from what was recorded of one robot.

    Raises: ValueError if the robot did not move enough.
    """
    stretches = [stretch for recording in recordings for stretch in _list_stretches(recording)]
    turned_rad = sum(float(np.abs(np.diff(np.unwrap(poses[:, 2]))).sum()) for _, poses in stretches)
    if turned_rad < MIN_TURN_RAD:
        text = "turned by %.1f rad only where it touched no wall; %.0f are needed, with poses"
        raise ValueError(text % (turned_rad, MIN_TURN_RAD))
    return np.clip(least_squares(lambda body: _compare(stretches, body), np.ones(3)).x, 0.5, 2.0)


def _list_stretches(recording: Recording) -> Iterator[List[np.ndarray]]:
    """Yield wheels (K, 2) and poses (K, 3) of stretches of the recording that have poses throughout."""
    times_s = recording.poses[:, 0]
    if not len(times_s):
        return
    slips_s = find_slips(recording)
    for start_s in np.arange(times_s[0], times_s[-1] - STRETCH_S, STRETCH_S):
        wanted_s = start_s + np.arange(0.0, STRETCH_S, POSE_PERIOD_S)
        index = np.unique(np.searchsorted(times_s, wanted_s))
        index = index[index < len(times_s)]
        chosen = recording.poses[index]
        slips = ((slips_s >= start_s) & (slips_s <= start_s + STRETCH_S)).any()
        if not slips and len(chosen) > STRETCH_S and np.diff(chosen[:, 0]).max() < 1.0:
            yield [measure_wheels(recording, chosen[:, 0]), chosen[:, 1:]]


def _compare(stretches: List[List[np.ndarray]], body: np.ndarray) -> np.ndarray:
    """Return the differences in m of all poses, with the odometry of each stretch laid over them as well as it goes."""
    differences = []
    for wheels_m, poses in stretches:
        path = follow_body(wheels_m, body)
        angle_rad = np.unwrap(poses[:, 2]) - path[:, 2]
        yaw_rad = angle_rad.mean()
        rotation = np.array(((np.cos(yaw_rad), -np.sin(yaw_rad)), (np.sin(yaw_rad), np.cos(yaw_rad))))
        places_m: np.ndarray = poses[:, :2] - path[:, :2] @ rotation.T
        differences += [(places_m - places_m.mean(axis=0)).ravel(), HEADING_M * (angle_rad - yaw_rad)]
    return np.concatenate(differences)
