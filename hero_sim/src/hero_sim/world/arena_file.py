"""Arenas from YAML files; a wrong file is refused with its name and the reason.

The README has the format.
"""

import io
import math
import os
import warnings
from typing import Callable, Dict, List

import numpy as np

from hero_node import Pose
from hero_node.files import Entry, EntryError, load_entries, read_file
from hero_node.robot_constants import BODY_RADIUS_M

from ..errors import OptionError
from .arena import Area, Arena, is_free, outline
from .pushing.shapes import Disc, Polygon, PushedBody, Shape

SHIPPED = ("empty", "obstacles", "maze", "box", "discs")
"""Arenas that come with the simulator; --arena takes these names too."""

_MAX_COORDINATE_M = 1000.0
_MAX_STARTS = 1000
_MAX_PIXELS = 4_000_000
_KEYS = ("name", "bounds_m", "walls_m", "circles_m", "polygons_m", "objects", "starts_m_deg", "areas", "lamps_m")
_AREA_KEYS = ("name", "circle_m", "rectangle_m", "color", "picture")
_OBJECT_KEYS = ("circle_m", "polygon_m", "mass_kg", "friction")


def locate_arena(path: str, arena: str) -> str:
    """Return the arena that a file at path names: one that is shipped, or a path from there."""
    return arena if not arena or arena in SHIPPED else os.path.join(os.path.dirname(path), arena)


def load_arena(name: str, read: Callable[[str], bytes] = read_file) -> Arena:
    """Return the arena of a shipped name or of the file at that path; read: how all its files are read.

    Raises: OptionError with file, line and reason.
    """
    path = name
    if name in SHIPPED:
        path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "arenas", name + ".yaml")
    try:
        # Numbers stay texts: what YAML takes for dates, booleans or objects has no meaning here.
        return _build_arena(load_entries(path, "bounds_m: [-1, -1, 1, 1]", as_texts=True, read=read), path, read)
    except EntryError as error:
        hint = f"; shipped are {', '.join(SHIPPED)}" if isinstance(error.__cause__, OSError) else ""
        raise OptionError(f"arena {error}{hint}") from error
    except ValueError as error:
        raise OptionError(f"arena {path}: {error}") from error


def _read_picture(entry: Entry, path: str, read: Callable[[str], bytes]) -> np.ndarray:
    """Return the gray levels of a picture from 0, black, to 1, white (rows, columns), the upper row first.

    entry: its file, relative to that of the arena, path. Raises: EntryError for one that cannot be used.
    """
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError:
        raise EntryError(f"{entry.place}: pictures need python3-pil: install it") from None
    picture = os.path.join(os.path.dirname(path), entry.text())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # it is refused below
            image = Image.open(io.BytesIO(read(picture)))
        if image.width * image.height > _MAX_PIXELS:  # by its header: nothing is decoded yet
            text = "it has %d x %d pixels, more than %d in all"
            raise ValueError(text % (*image.size, _MAX_PIXELS))
        if image.mode.startswith("I"):
            return np.asarray(image, dtype=float) / 65535.0
        return np.asarray(image.convert("L"), dtype=float) / 255.0
    except (OSError, ValueError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        reason = getattr(error, "strerror", None) or error
        remedy = "give a PNG or PGM, its path relative to this file"
        raise EntryError(f"{entry.place}: picture {picture} cannot be read: {reason}; {remedy}") from error


def _build_arena(root: Entry, path: str, read: Callable[[str], bytes]) -> Arena:
    """Return the arena of a file's content. Raises: EntryError, ValueError."""
    content = root.mapping(_KEYS)
    name = content["name"].text() if "name" in content else os.path.basename(path)
    if not name.isprintable():  # it is printed in terminals
        content["name"].refuse("one line of text")
    walls_m = [_read_points(entry, 2) for entry in _list_items(content, "walls_m")]
    polygons_m = [_read_points(entry, 3) for entry in _list_items(content, "polygons_m")]
    circles_m = [_read_circle(entry) for entry in _list_items(content, "circles_m")]
    edges_m = [np.hstack((points_m[:-1], points_m[1:])) for points_m in walls_m]
    edges_m += [outline(corners_m) for corners_m in polygons_m]
    segments_m = np.vstack([np.empty((0, 4)), *edges_m])
    bounds_m = _read_bounds(content, segments_m)
    objects = tuple(_read_object(entry) for entry in _list_items(content, "objects"))
    areas = tuple(_read_area(entry, path, read) for entry in _list_items(content, "areas"))
    lamps_m = np.reshape([_read_row(entry, "x and y") for entry in _list_items(content, "lamps_m")], (-1, 2))
    circles = np.reshape(circles_m, (-1, 3))
    rims_m = tuple(points_m for points_m in walls_m if _is_rim(points_m, segments_m))
    arena = Arena(name, segments_m, circles, (), bounds_m, tuple(polygons_m), objects, areas, lamps_m, rims_m)
    entries = _list_items(content, "starts_m_deg")
    if len(entries) > _MAX_STARTS:  # each is compared with all before it
        raise ValueError("starts_m_deg has %d starts, more than %d" % (len(entries), _MAX_STARTS))
    rows = np.reshape([_read_row(entry, "x, y and heading") for entry in entries], (-1, 3))
    for row, (x_m, y_m, _) in enumerate(rows.tolist()):
        if not is_free(Pose(x_m, y_m, 0.0), rows[:row], arena, BODY_RADIUS_M):
            raise EntryError(
                "%s: the start at (%g, %g) touches a wall, an obstacle or another start, or is outside; robots need"
                " %.3f m around their center" % (entries[row].place, x_m, y_m, BODY_RADIUS_M)
            )
    starts = tuple(Pose(x_m, y_m, math.radians(heading_deg)) for x_m, y_m, heading_deg in rows.tolist())
    return arena._replace(starts=starts)


def _read_area(entry: Entry, path: str, read: Callable[[str], bytes]) -> Area:
    """Return a painted part of the floor, of the arena's file path. Raises: EntryError."""
    item = entry.mapping(_AREA_KEYS, ("name",))
    if ("circle_m" in item) == ("rectangle_m" in item) or ("color" in item) == ("picture" in item):
        entry.refuse("a mapping with circle_m or rectangle_m, name, and color or picture")
    name = item["name"].text()
    if "circle_m" in item:
        shape_m = _read_circle(item["circle_m"])
    else:
        shape_m = _read_row(item["rectangle_m"], "x min, y min, x max and y max")
        if shape_m[0] >= shape_m[2] or shape_m[1] >= shape_m[3]:
            item["rectangle_m"].refuse("[x min, y min, x max, y max], each minimum less than its maximum")
    if "picture" in item:
        if "circle_m" in item:
            item["picture"].refuse("left out, or have a rectangle_m that it fills")
        gray = _read_picture(item["picture"], path, read)
        return Area(name, tuple(shape_m), (float(gray.mean()),) * 3, gray)
    color = item["color"]
    if isinstance(color.value, list):
        red, green, blue = color.numbers(3, 0.0, 1.0, "[red, green, blue]")
        return Area(name, tuple(shape_m), (red, green, blue))
    return Area(name, tuple(shape_m), (color.number(0.0, 1.0, "(gray), or [red, green, blue]"),) * 3)


def _read_object(entry: Entry) -> PushedBody:
    """Return what robots can push. Raises: EntryError, ValueError."""
    item = entry.mapping(_OBJECT_KEYS, ("mass_kg", "friction"))
    if ("circle_m" in item) == ("polygon_m" in item):
        entry.refuse("a mapping with circle_m or polygon_m, mass_kg and friction")
    mass_kg, friction = (item[key].number(-_MAX_COORDINATE_M, _MAX_COORDINATE_M, "") for key in ("mass_kg", "friction"))
    shape: Shape
    if "circle_m" in item:
        x_m, y_m, radius_m = _read_row(item["circle_m"], "x, y and radius")
        shape, center = Disc(radius_m), Pose(x_m, y_m, 0.0)
    else:
        corners_m = _read_points(item["polygon_m"], 3).tolist()
        shape = Polygon([(x_m, y_m) for x_m, y_m in corners_m])
        center = Pose(corners_m[0][0] - shape.corners_m[0][0], corners_m[0][1] - shape.corners_m[0][1], 0.0)
    return PushedBody(shape, center, mass_kg, friction)


def _read_bounds(content: Dict[str, Entry], segments_m: np.ndarray) -> np.ndarray:
    if "bounds_m" in content:
        bounds_m = np.array(_read_row(content["bounds_m"], "x min, y min, x max and y max"))
        if not (bounds_m[:2] < bounds_m[2:]).all():
            content["bounds_m"].refuse("[x min, y min, x max, y max], each minimum less than its maximum")
        return bounds_m
    if not len(segments_m):
        raise ValueError("an arena without walls needs bounds_m: [x min, y min, x max, y max]")
    return _measure_extent(segments_m.reshape(-1, 2))


def _measure_extent(points_m: np.ndarray) -> np.ndarray:
    """Return x min, y min, x max, y max of points (P, 2)."""
    return np.hstack((points_m.min(axis=0), points_m.max(axis=0)))


def _is_rim(points_m: np.ndarray, segments_m: np.ndarray) -> bool:
    """Return whether a wall is closed, and reaches as far to all sides as all walls and polygons together."""
    is_closed = len(points_m) > 3 and bool((points_m[0] == points_m[-1]).all())
    return is_closed and bool((_measure_extent(points_m) == _measure_extent(segments_m.reshape(-1, 2))).all())


def _list_items(content: Dict[str, Entry], key: str) -> List[Entry]:
    return content[key].entries() if key in content and content[key].value else []


def _read_row(entry: Entry, what: str) -> List[float]:
    """Return as many numbers as what names."""
    count = 1 + what.count(",") + what.count(" and ")
    return entry.numbers(count, -_MAX_COORDINATE_M, _MAX_COORDINATE_M, f"a list of %d numbers: {what}" % count)


def _read_circle(entry: Entry) -> List[float]:
    row = _read_row(entry, "x, y and radius")
    return row if row[2] > 0.0 else entry.refuse("a circle whose radius is more than 0")


def _read_points(entry: Entry, least: int) -> np.ndarray:
    """Return corners (K, 2), m, in a list of at least least points."""
    points = [_read_row(item, "x and y") for item in entry.entries()]
    return np.array(points) if len(points) >= least else entry.refuse("a list of at least %d points [x, y]" % least)
