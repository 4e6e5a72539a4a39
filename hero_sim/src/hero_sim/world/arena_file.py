"""Arenas from YAML files, ours and those of maps; a wrong file is refused with its name and the reason.

The README has the format.
"""

import io
import math
import os
import warnings
from typing import Any, Callable, Dict, List

import numpy as np
import yaml

from hero_node import Pose, shorten
from hero_node.files import decode_text, parse_yaml, read_file

from ..errors import OptionError
from ..robot_constants import BODY_RADIUS_M
from .arena import Arena, is_free, outline
from .map_file import build_map_arena, check_size
from .pushing.shapes import Disc, Polygon, PushedBody, Shape

SHIPPED = ("empty", "obstacles", "maze", "box", "discs")
"""Arenas that come with the simulator; --arena takes these names too."""

_MAX_COORDINATE_M = 1000.0
_MAX_STARTS = 1000
_KEYS = ("name", "bounds_m", "walls_m", "circles_m", "polygons_m", "objects", "starts_m_deg")
_OBJECT_KEYS = ("circle_m", "polygon_m", "mass_kg", "friction")


def load_arena(name: str, read: Callable[[str], bytes] = read_file) -> Arena:
    """Return the arena of a shipped name or of the file at that path; read: how all its files are read.

    Raises: OptionError with file and reason.
    """
    path = name
    if name in SHIPPED:
        path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "arenas", name + ".yaml")
    try:
        # Numbers stay texts: what YAML takes for dates, booleans or objects has no meaning here.
        content = parse_yaml(decode_text(read(path)), yaml.BaseLoader)
        if isinstance(content, dict) and "image" in content:
            return _build_from_map(content, path, read)
        return _build_arena(content, os.path.basename(path))
    except OSError as error:
        text = "arena %s cannot be read: %s; shipped are %s"
        raise OptionError(text % (path, error.strerror, ", ".join(SHIPPED))) from error
    except ValueError as error:
        raise OptionError(f"arena {path}: {error}") from error


def _build_from_map(content: Dict[str, Any], path: str, read: Callable[[str], bytes]) -> Arena:
    """Return the arena of a map of map_server. Raises: ValueError."""
    try:
        from PIL import Image, UnidentifiedImageError
    except ImportError:
        raise ValueError("pictures of maps need python3-pil: install it") from None
    picture = os.path.join(os.path.dirname(path), str(content["image"]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # check_size() refuses it
            image = Image.open(io.BytesIO(read(picture)))
        check_size(*image.size)  # by its header: nothing is decoded yet
        gray = np.asarray(image.convert("L"), dtype=float)
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"its picture {picture} cannot be read: {reason}") from error
    return build_map_arena(os.path.basename(path), content, gray)


def _build_arena(content: Any, file_name: str) -> Arena:
    """Return the arena of a file's content. Raises: ValueError."""
    if not isinstance(content, dict):
        raise ValueError("must be a mapping with the keys " + ", ".join(_KEYS))
    for key in content:
        if key not in _KEYS:
            raise ValueError(f"unknown key {shorten(key)}; known are {', '.join(_KEYS)}")
    name = content.get("name", file_name)
    if not isinstance(name, str) or not name.isprintable():  # it is printed in terminals
        raise ValueError("name must be one line of text, not " + shorten(name))
    walls_m = [_read_rows("walls_m", wall, 2, least=2) for wall in _list_items(content, "walls_m")]
    polygons_m = [_read_rows("polygons_m", corners, 2, least=3) for corners in _list_items(content, "polygons_m")]
    circles_m = _read_rows("circles_m", _list_items(content, "circles_m"), 3)
    if not (circles_m[:, 2] > 0.0).all():
        raise ValueError("circles_m: a radius must be more than 0")
    edges_m = [np.hstack((points_m[:-1], points_m[1:])) for points_m in walls_m]
    edges_m += [outline(corners_m) for corners_m in polygons_m]
    segments_m = np.vstack([np.empty((0, 4)), *edges_m])
    bounds_m = _read_bounds(content, segments_m)
    objects = tuple(_read_object(item) for item in _list_items(content, "objects"))
    arena = Arena(name, segments_m, circles_m, (), bounds_m, tuple(polygons_m), objects)
    rows = _read_rows("starts_m_deg", _list_items(content, "starts_m_deg"), 3)
    if len(rows) > _MAX_STARTS:  # each is compared with all before it
        raise ValueError("starts_m_deg has %d starts, more than %d" % (len(rows), _MAX_STARTS))
    for row, (x_m, y_m, _) in enumerate(rows.tolist()):
        if not is_free(Pose(x_m, y_m, 0.0), rows[:row], arena, BODY_RADIUS_M):
            raise ValueError(
                "the start at (%g, %g) touches a wall, an obstacle or another start; robots need %.3f m"
                " around their center" % (x_m, y_m, BODY_RADIUS_M)
            )
    starts = tuple(Pose(x_m, y_m, math.radians(heading_deg)) for x_m, y_m, heading_deg in rows.tolist())
    return arena._replace(starts=starts)


def _read_object(item: Any) -> PushedBody:
    """Return what robots can push. Raises: ValueError."""
    known = isinstance(item, dict) and set(item) <= set(_OBJECT_KEYS)
    if not known or ("circle_m" in item) == ("polygon_m" in item):
        raise ValueError(f"objects: {shorten(item)} must be a mapping with circle_m or polygon_m, mass_kg and friction")
    mass_kg, friction = (_read_rows(key, [[item.get(key)]], 1)[0, 0] for key in ("mass_kg", "friction"))
    shape: Shape
    if "circle_m" in item:
        x_m, y_m, radius_m = _read_rows("circle_m", [item["circle_m"]], 3)[0].tolist()
        shape, center = Disc(radius_m), Pose(x_m, y_m, 0.0)
    else:
        corners_m = _read_rows("polygon_m", item["polygon_m"], 2, least=3).tolist()
        shape = Polygon([(x_m, y_m) for x_m, y_m in corners_m])
        center = Pose(corners_m[0][0] - shape.corners_m[0][0], corners_m[0][1] - shape.corners_m[0][1], 0.0)
    return PushedBody(shape, center, float(mass_kg), float(friction))


def _read_bounds(content: Dict[str, Any], segments_m: np.ndarray) -> np.ndarray:
    if "bounds_m" in content:
        bounds_m = _read_rows("bounds_m", [content["bounds_m"]], 4)[0]
        if not (bounds_m[:2] < bounds_m[2:]).all():
            raise ValueError("bounds_m: the minimum must be less than the maximum")
        return bounds_m
    if not len(segments_m):
        raise ValueError("an arena without walls needs bounds_m: [x min, y min, x max, y max]")
    ends_m = segments_m.reshape(-1, 2)
    return np.hstack((ends_m.min(axis=0), ends_m.max(axis=0)))


def _list_items(content: Dict[str, Any], key: str) -> List[Any]:
    items = content.get(key) or []
    if not isinstance(items, list):
        raise ValueError(f"{key} must be a list, not {shorten(items)}")
    return items


def _read_rows(key: str, value: Any, columns: int, least: int = 0) -> np.ndarray:
    """Return a list of lists of columns numbers as an array (rows, columns). Raises: ValueError."""
    try:
        rows = np.array(value, dtype=float).reshape(-1, columns) if value else np.empty((0, columns))
    except (TypeError, ValueError):
        rows = np.full((1, columns), np.nan)
    nested = isinstance(value, list) and all(isinstance(row, list) and len(row) == columns for row in value)
    if not nested or len(rows) < least or not (np.abs(rows) <= _MAX_COORDINATE_M).all():
        raise ValueError(
            "%s: %s is not a list of %sentries of %d numbers, each from -1000 to 1000"
            % (key, shorten(value), "at least %d " % least if least else "", columns)
        )
    return rows
