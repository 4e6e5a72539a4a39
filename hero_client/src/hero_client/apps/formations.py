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

from hero_node import ProgramError, shorten
from hero_node.files import YamlError, parse_yaml
from hero_node.parameters import is_number, is_whole_number

from ..values.assignment import assign_rows

Point = Tuple[float, float]

SHAPES = ("circle", "grid", "line", "points")

KEYS = ("shape", "center", "spacing_m", "turn_deg", "columns", "points")

DEFAULT_SPACING_M = 0.25


class FormationError(ProgramError):
    """A formation that cannot be taken; the text names the key, the value and what it must be."""


def place_formation(formation: Any, count: int, min_spacing_m: float) -> List[Point]:
    """Return count places [x, y], m, in the frame in which center is given.

    formation: a table, or its text in YAML. min_spacing_m: closer together robots could not reach their places.
    Raises: FormationError.
    """
    if isinstance(formation, str):
        try:
            formation = parse_yaml(formation)
        except YamlError as error:
            raise FormationError(f"formation: not YAML: {error}") from None
    if not isinstance(formation, dict):
        raise FormationError(f"formation: must be a table with {', '.join(KEYS)}, not {shorten(formation)}")
    unknown = sorted(set(formation) - set(KEYS), key=str)
    if unknown:
        raise FormationError(f"formation: unknown key {shorten(unknown[0])}; known are: {', '.join(KEYS)}")
    shape = formation.get("shape", "circle")
    if shape not in SHAPES:
        raise FormationError(f"formation: shape is {shorten(shape)}, but must be one of: {', '.join(SHAPES)}")
    center = _read_point("center", formation.get("center", [0.0, 0.0]))
    spacing_m = _read_number("spacing_m", formation.get("spacing_m", DEFAULT_SPACING_M))
    angle_rad = math.radians(_read_number("turn_deg", formation.get("turn_deg", 0.0)))
    if shape == "circle":
        places = _circle(count, spacing_m)
    elif shape == "line":
        places = [((index - (count - 1) / 2.0) * spacing_m, 0.0) for index in range(count)]
    elif shape == "grid":
        places = _grid(count, spacing_m, formation)
    else:
        places = _read_points(formation, count)
    _check_spacing(places, min_spacing_m)
    cos, sin = math.cos(angle_rad), math.sin(angle_rad)
    return [(center[0] + x * cos - y * sin, center[1] + x * sin + y * cos) for x, y in places]


def _circle(count: int, spacing_m: float) -> List[Point]:
    """Return places on a circle on which neighbors are spacing_m apart, as the crow flies."""
    if count == 1:
        return [(0.0, 0.0)]
    radius_m = spacing_m / (2.0 * math.sin(math.pi / count))
    angles = [2.0 * math.pi * index / count for index in range(count)]
    return [(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles]


def _grid(count: int, spacing_m: float, formation: Dict[str, Any]) -> List[Point]:
    columns = formation.get("columns", math.ceil(math.sqrt(count)))
    if not is_whole_number(columns, low=1):
        raise FormationError(f"formation: columns is {shorten(columns)}, but must be a whole number, 1 or more")
    rows = math.ceil(count / columns)
    return [
        (
            (index % columns - (columns - 1) / 2.0) * spacing_m,
            ((rows - 1) / 2.0 - index // columns) * spacing_m,
        )
        for index in range(count)
    ]


def _read_points(formation: Dict[str, Any], count: int) -> List[Point]:
    points = formation.get("points")
    if not isinstance(points, list) or len(points) < count:
        raise FormationError("formation: points must be a list of at least %d places [x, y] in m" % count)
    return [_read_point("points", point) for point in points]


def _check_spacing(places: List[Point], min_spacing_m: float) -> None:
    apart_m = min((math.dist(*pair) for pair in combinations(places, 2)), default=math.inf)
    if apart_m < min_spacing_m:
        text = "formation: two places are %.3f m apart, but robots need %.2f m: make spacing_m larger"
        raise FormationError(text % (apart_m, min_spacing_m))


def _read_number(key: str, value: Any) -> float:
    if not is_number(value):
        raise FormationError(f"formation: {key} is {shorten(value)}, but must be a number")
    return float(value)


def _read_point(key: str, value: Any) -> Point:
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise FormationError(f"formation: {key} holds {shorten(value)}, but must hold [x, y] in m")
    return _read_number(key, value[0]), _read_number(key, value[1])


def assign_goals(starts: Sequence[Point], goals: Sequence[Point]) -> List[int]:
    """Return for each start the index of its goal, with the least sum of squared distances.

    Then paths that are straight do not cross. Raises: ValueError if there are more starts than goals.
    """
    if len(starts) > len(goals):
        raise ValueError(f"{len(starts)} robots cannot take {len(goals)} goals, one each")
    if not starts:
        return []
    between_m = np.asarray(starts, dtype=float)[:, np.newaxis] - np.asarray(goals, dtype=float)
    return assign_rows(np.sum(between_m**2, axis=2))
