"""Scores of missions, one number for each world, once per second: of areas by their names and colors."""

import numpy as np


def _count(state, wanted):
    """Return which robots are on areas of which wanted(area) holds (W, N)."""
    x_m, y_m = state.poses[..., 0], state.poses[..., 1]
    places = [area.covers(x_m, y_m) for area in state.arena.areas if wanted(area)]
    return np.any([np.zeros_like(x_m, dtype=bool), *places], axis=0)


def robots_on_black(state):
    """Return how many robots are on black floor."""
    return _count(state, lambda area: max(area.color) < 0.25).sum(axis=1)


def items(state):
    """Return how many items were carried from areas called source to the one called nest."""
    sources, nest = _count(state, lambda area: "source" in area.name), _count(state, lambda area: area.name == "nest")
    carries = state.kept.get("carries", np.zeros_like(nest)) | sources
    state.kept["items"] = state.kept.get("items", 0) + (carries & nest).sum(axis=1)
    state.kept["carries"] = carries & ~nest
    return state.kept["items"]


def freshness_s(state, cells=10):
    """Return minus the mean age of the cells of a grid over the arena: the time since a robot was in each."""
    low_m, high_m = state.arena.bounds_m.reshape(2, 2)
    visits_s = state.kept.setdefault("visits_s", np.zeros((len(state.poses), cells, cells)))
    columns, rows = np.clip((state.poses[..., :2] - low_m) / (high_m - low_m) * cells, 0, cells - 1).astype(int).T
    visits_s[np.arange(len(visits_s)), rows, columns] = state.time_s
    return visits_s.mean(axis=(1, 2)) - state.time_s


def sortedness(state, groups=2):
    """Return the share of robots whose nearest robot is of their group, by number, as segregation colors them.

    Not by what they show: robots that all show one color would be sorted best.
    """
    off_m = state.poses[:, :, None, :2] - state.poses[:, None, :, :2]
    apart_m = np.hypot(off_m[..., 0], off_m[..., 1]) + 1e9 * np.eye(off_m.shape[1])
    own = np.arange(off_m.shape[1]) % groups
    return (own == own[apart_m.argmin(axis=2)]).mean(axis=1)
