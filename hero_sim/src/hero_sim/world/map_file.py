"""Arenas from maps as map_server keeps them, such as those that robots made of a real arena: a YAML file and a picture.

What is not free is solid: obstacles, and unknown cells. Source: wiki.ros.org/map_server.
"""

from typing import Dict, List, Tuple

import numpy as np

from hero_node.files import Entry

from .arena import Arena

_MAX_CELLS = 4_000_000
_MAX_ORIGIN_M = 1000.0


def check_size(width: int, height: int) -> None:
    """Check the size of a picture before it is decoded. Raises: ValueError."""
    if width * height > _MAX_CELLS:
        raise ValueError("the picture has %d x %d pixels, more than %d in all" % (width, height, _MAX_CELLS))


def build_map_arena(name: str, content: Dict[str, Entry], gray: np.ndarray) -> Arena:
    """Return the arena of a map's YAML content, whose values are texts, and its picture (rows, columns), 0..1.

    Raises: EntryError for invalid values or a turned map, ValueError for one without a free cell.
    """
    cell_m = content["resolution"].number(0.001, 1.0, "m") if "resolution" in content else 0.05
    free_share = content["free_thresh"].number(1e-6, 1.0, "(0.25 is 25 %)") if "free_thresh" in content else 0.196
    is_negated = "negate" in content and content["negate"].choice(("0", "1")) == "1"
    x_m = y_m = 0.0
    if "origin" in content:
        origin = content["origin"]
        x_m, y_m, yaw_rad = origin.numbers(3, -_MAX_ORIGIN_M, _MAX_ORIGIN_M, "a list of x m, y m and yaw")
        if yaw_rad:
            origin.refuse("a list of x m, y m and a yaw of 0")
    shade = gray[::-1]  # the first row of a picture is its upper one
    occupied_share = shade if is_negated else 1.0 - shade
    solid = occupied_share >= free_share
    rows, columns = np.nonzero(~solid)
    if not len(rows):
        raise ValueError("the map has no free cell")

    def place(column: float, row: float) -> Tuple[float, float]:
        return x_m + column * cell_m, y_m + row * cell_m

    segments_m = [(*place(*start), *place(*end)) for start, end in _find_borders(solid)]
    polygons_m = [
        np.array([place(left, low), place(right, low), place(right, high), place(left, high)])
        for left, low, right, high in _cover(solid)
    ]
    bounds_m = np.array([*place(columns.min(), rows.min()), *place(columns.max() + 1, rows.max() + 1)])
    return Arena(name, np.array(segments_m).reshape(-1, 4), np.empty((0, 3)), (), bounds_m, tuple(polygons_m))


def _find_borders(solid: np.ndarray) -> List[Tuple[Tuple[int, int], Tuple[int, int]]]:
    """Return the lines between free and solid cells as start and end (column, row), each as long as it goes straight.

    Beyond the picture all is solid.
    """
    padded = np.pad(solid, 1, constant_values=True)
    borders = []
    for row, column, length in _find_runs(padded[1:, 1:-1] != padded[:-1, 1:-1]):
        borders.append(((column, row), (column + length, row)))
    for column, row, length in _find_runs((padded[1:-1, 1:] != padded[1:-1, :-1]).T):
        borders.append(((column, row), (column, row + length)))
    return borders


def _cover(solid: np.ndarray) -> List[Tuple[int, int, int, int]]:
    """Return rectangles of solid cells that cover them all: left, low, right, high, in columns and rows."""
    rectangles: List[Tuple[int, int, int, int]] = []
    open_runs: Dict[Tuple[int, int], int] = {}
    runs_by_row: List[Dict[Tuple[int, int], int]] = [{} for _ in range(len(solid) + 1)]
    for row, column, length in _find_runs(solid):
        runs_by_row[row][column, column + length] = row
    for row, runs in enumerate(runs_by_row):
        for run in [run for run in open_runs if run not in runs]:
            rectangles.append((run[0], open_runs.pop(run), run[1], row))
        for run in runs:
            open_runs.setdefault(run, row)
    return rectangles


def _find_runs(cells: np.ndarray) -> List[Tuple[int, int, int]]:
    """Return row, first column and length of each run of true cells in a row."""
    edges = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    _, ends = np.nonzero(edges == -1)
    return list(zip(rows.tolist(), starts.tolist(), (ends - starts).tolist()))
