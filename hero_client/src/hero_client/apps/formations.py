"""Formations: read from YAML, placed in a frame, and assigned to robots. Pure.

shape: circle           # or line, grid, points
center: [0.0, 0.0]      # m, of the whole
spacing_m: 0.25         # between neighbors
turn_deg: 0.0           # of the whole, counter-clockwise
columns: 4              # grid only; default: as square as it gets
points: [[0, 0], [0.3, 0]]   # points only: m, relative to center
"""

import math
from itertools import combinations
from typing import Any, Dict, List, Sequence, Tuple

import numpy as np

from hero_node.files import Entry, EntryError, mark_values, read_entries
from hero_node.parameters import MAX_COORDINATE_M

Point = Tuple[float, float]

SHAPES = ("circle", "grid", "line", "points")

KEYS = ("shape", "center", "spacing_m", "turn_deg", "columns", "points")

DEFAULT_SPACING_M = 0.25

MAX_COLUMNS = 1000

ASSIGNMENTS = 10
"""Number of tries: their best was the best of all for ten robots, in 60 of 60 cases."""

ROUNDING = 1e-9
"""Share of the largest cost by which a swap must help: sums are this exact."""


def place_formation(formation: Any, count: int, min_spacing_m: float) -> List[Point]:
    """Return count places [x, y], m, in the frame in which center is given.

    formation: a table, or its text in YAML. min_spacing_m: closer together robots could not reach their places.
    Raises: EntryError with the key, the value and what it must be.
    """
    if isinstance(formation, str):
        root = read_entries(formation, "formation", "shape: circle")
    else:
        root = mark_values(formation, "formation")
    return _place(root.mapping(KEYS), count, min_spacing_m)


def _place(fields: Dict[str, Entry], count: int, min_spacing_m: float) -> List[Point]:
    shape = fields["shape"].choice(SHAPES) if "shape" in fields else "circle"
    center = _read_point(fields["center"]) if "center" in fields else (0.0, 0.0)
    spacing_m = _read_number(fields, "spacing_m", DEFAULT_SPACING_M)
    angle_rad = math.radians(_read_number(fields, "turn_deg", 0.0))
    if shape == "circle":
        places = _circle(count, spacing_m)
    elif shape == "line":
        places = [((index - (count - 1) / 2.0) * spacing_m, 0.0) for index in range(count)]
    elif shape == "grid":
        columns = fields["columns"].whole(1, MAX_COLUMNS) if "columns" in fields else math.ceil(math.sqrt(count))
        places = _grid(count, spacing_m, columns)
    else:
        places = [_read_point(entry) for entry in fields["points"].entries()] if "points" in fields else []
        if len(places) < count:
            raise EntryError("formation: points must be a list of at least %d places [x, y] in m" % count)
    apart_m = min((math.dist(*pair) for pair in combinations(places, 2)), default=math.inf)
    if apart_m < min_spacing_m:
        text = "formation: two places are %.3f m apart, but robots need %.2f m: make spacing_m larger"
        raise EntryError(text % (apart_m, min_spacing_m))
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return [(center[0] + x * cos - y * sin, center[1] + x * sin + y * cos) for x, y in places]


def _circle(count: int, spacing_m: float) -> List[Point]:
    """Return places on a circle on which neighbors are spacing_m apart, as the crow flies."""
    if count == 1:
        return [(0.0, 0.0)]
    radius_m = spacing_m / (2.0 * math.sin(math.pi / count))
    angles = [2.0 * math.pi * index / count for index in range(count)]
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles]


def _grid(count: int, spacing_m: float, columns: int) -> List[Point]:
    left, top = (columns - 1) / 2.0, (math.ceil(count / columns) - 1) / 2.0
    cells = [(index % columns, index // columns) for index in range(count)]
    return [((column - left) * spacing_m, (top - row) * spacing_m) for column, row in cells]


def _read_number(fields: Dict[str, Entry], key: str, default: float) -> float:
    return fields[key].number(-MAX_COORDINATE_M, MAX_COORDINATE_M, "") if key in fields else default


def _read_point(entry: Entry) -> Point:
    x_m, y_m = entry.numbers(2, -MAX_COORDINATE_M, MAX_COORDINATE_M, "[x, y] in m")
    return x_m, y_m


def assign_goals(starts: Sequence[Point], goals: Sequence[Point]) -> List[int]:
    """Return for each start the index of its goal, so that no two robots would do better with each other's.

    Then those that drive straight there, all in the same time, do not meet. Better is a smaller sum of squared
    distances; of several such assignments the best is taken. Raises: ValueError if there are more starts than goals.
    Source: M. Turpin, N. Michael, V. Kumar, CAPT: Concurrent assignment and planning of trajectories, IJRR 2014.
    """
    if len(starts) > len(goals):
        raise ValueError(f"{len(starts)} robots cannot take {len(goals)} goals, one each")
    if not starts:
        return []
    rows = np.arange(len(goals))
    costs_m2 = np.zeros((len(goals), len(goals)))  # of goals that stay free: none
    between_m = np.asarray(starts, dtype=float)[:, np.newaxis] - np.asarray(goals, dtype=float)
    costs_m2[: len(starts)] = np.sum(between_m**2, axis=2)
    found = [_swap_goals(costs_m2, np.random.RandomState(seed).permutation(rows)) for seed in range(ASSIGNMENTS)]
    best = min(found, key=lambda columns: float(costs_m2[rows, columns].sum()))
    return [int(column) for column in best[: len(starts)]]


def _swap_goals(costs_m2: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the columns of rows (N,) after every swap of two that makes the sum of costs (N, N) smaller."""
    while True:
        swapped_m2 = costs_m2[:, columns]
        own_m2 = np.diag(swapped_m2)
        gains_m2 = own_m2[:, np.newaxis] + own_m2 - swapped_m2 - swapped_m2.T
        pair = list(divmod(int(np.argmax(gains_m2)), len(columns)))
        if gains_m2[pair[0], pair[1]] <= ROUNDING * costs_m2.max():
            return columns
        columns[pair] = columns[pair[::-1]]
