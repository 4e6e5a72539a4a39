"""Fits the infrared sensors to the signals that they had in a known arena, at known poses. Pure."""

from typing import Dict, List, NamedTuple, Tuple

import numpy as np
from scipy.optimize import least_squares

from hero_sim.robot_constants import BODY_RADIUS_M
from hero_sim.world import (
    ALPHA_COUNTS_M2,
    BEAMS,
    BETA_COUNTS,
    NOISE_COUNTS,
    Arena,
    Segments,
    Sight,
    find_offset,
    measure_brightness,
)

from .recording import Recording, interpolate_poses

_MIN_DISTANCE_M, _MAX_DISTANCE_M = 0.03, 0.20
"""Distances that are used: nearer, errors of poses and saturation prevail; farther, there is no signal."""

_POSE_SD_M = 0.003
_MAX_GAP_S = 0.5
"""Time between poses: where a robot is within a longer gap is not known."""

_MIN_READINGS = 20
_FAR_SDS = 1.5
"""Readings farther off, at edges of walls and of bodies, count as if they were this far off (P. Huber)."""


class InfraredFit(NamedTuple):
    """The sensors of one robot.

    Attributes:
        values: by key, as --error takes them.
        before_counts, after_counts: median error of held-out signals, of a nominal robot and of this one.
    """

    values: Dict[str, float]
    before_counts: float
    after_counts: float


def fit_infrared(recordings: List[Recording], arena: Arena, end_share: float) -> InfraredFit:
    """Return the sensors of one robot from the first share of each recording; those that saw too little have no value.

    Raises: ValueError if none saw enough.
    """
    tables = [_list_readings(recording, arena, end_share) for recording in recordings]
    sensors, bright, counts, is_held_out = (np.concatenate(columns) for columns in zip(*tables))
    seen = np.bincount(sensors[~is_held_out], minlength=BEAMS)
    fitted_beams = (seen >= _MIN_READINGS).nonzero()[0]
    if not len(fitted_beams) or not is_held_out.any():
        limits_cm = 100.0 * _MIN_DISTANCE_M, 100.0 * _MAX_DISTANCE_M
        text = "infrared sensors saw %d things at most at %g to %g cm in a recording with laser (--raw); %d are needed"
        raise ValueError(text % (seen.max(), *limits_cm, _MIN_READINGS))
    enough = np.isin(sensors, fitted_beams)
    sensors, bright, counts, is_held_out = (array[enough] for array in (sensors, bright, counts, is_held_out))
    # The signal depends linearly on the alphas and on beta.
    fixed = find_offset(bright, np.zeros(1))
    by_beta = find_offset(bright, np.ones(1)) - fixed
    terms = np.column_stack((bright[:, None] * (sensors[:, None] == fitted_beams), by_beta))
    drawn = np.append(np.full(len(fitted_beams), ALPHA_COUNTS_M2), BETA_COUNTS)
    slopes_m = 2.0 * ALPHA_COUNTS_M2 * bright**1.5  # counts for each m that the distance is wrong
    sds = np.hypot(NOISE_COUNTS, slopes_m * _POSE_SD_M)
    own = ~is_held_out
    slopes, zero = (terms / sds[:, None])[own], ((fixed - counts) / sds)[own]
    fitted = least_squares(lambda one: slopes @ one + zero, drawn, loss="huber", f_scale=_FAR_SDS).x
    before, after = (float(np.median(np.abs(terms @ one + fixed - counts)[is_held_out])) for one in (drawn, fitted))
    keys = ["alpha%d_counts_m2" % beam for beam in fitted_beams] + ["beta_counts"]
    return InfraredFit(dict(zip(keys, fitted.tolist())), before, after)


def _list_readings(
    recording: Recording, arena: Arena, end_share: float
) -> Tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return sensor, brightness, counts of readings of something near, and whether they are held out (K,) each."""
    times_s, counts = recording.scans[:, 0], recording.scans[:, 1:]
    places = [_find_poses(poses, times_s) for poses in (recording.poses, *recording.others)]
    known = np.isfinite(np.hstack(places)).all(axis=1)
    own, *others = (poses[known] for poses in places)
    bodies_m = np.stack([poses[:, :2] for poses in others], axis=1) if others else np.empty((len(own), 0, 2))
    headings = np.column_stack((np.cos(own[:, 2]), np.sin(own[:, 2])))
    radii_m, walls = np.full(len(others), BODY_RADIUS_M), Segments.from_ends(arena.segments_m)
    bright = measure_brightness(Sight(own[:, :2], headings, bodies_m, radii_m, walls, arena.circles_m))
    scans, sensors = ((bright > _MAX_DISTANCE_M**-2) & (bright < _MIN_DISTANCE_M**-2)).nonzero()
    is_held_out = times_s[known][scans] > end_share * recording.time_s
    return sensors, bright[scans, sensors], counts[known][scans, sensors], is_held_out


def _find_poses(poses: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """Return the poses (K, 3) at these times (K,); nan where they are not known."""
    ends = np.searchsorted(poses[:, 0], times_s)
    bounds_s = np.concatenate(([-np.inf], poses[:, 0], [np.inf]))
    gaps_s = bounds_s[ends + 1] - bounds_s[ends]
    return np.where(gaps_s[:, None] < _MAX_GAP_S, interpolate_poses(poses, times_s), np.nan)
