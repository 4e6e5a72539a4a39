"""A YAML file -> an Arena, or one line that says where the file is wrong.

The format is in the README.
"""

import math
import os
from typing import Any, List, Tuple

import numpy as np

from ..errors import OptionError
from ..robot_constants import BODY_RADIUS_M
from ..yaml_file import describe_node, fail_at, read_mapping, read_nodes
from .arena import Arena, is_free, outline
from .kinematics import Pose

SHIPPED = ("empty", "obstacles", "maze")
"""Arenas that come with the simulator; --arena takes these names too."""

_LARGEST_M = 1000.0
_KEYS = ("name", "bounds_m", "walls_m", "circles_m", "polygons_m", "starts_m_deg")


def find_arena(name: str) -> str:
    """Return the path of a shipped arena, or name itself as a path."""
    if name in SHIPPED:
        return os.path.join(os.path.dirname(os.path.abspath(__file__)), "arenas", name + ".yaml")
    return name


def load_arena(name: str) -> Arena:
    """Return the arena of a shipped name or of the file at that path.

    Raises: OptionError with file, line and reason.
    """
    path = find_arena(name)
    root = read_nodes(path, "arena " + path, "shipped are " + ", ".join(SHIPPED))
    return _Reader(path).read(root)


class _Reader:
    """Reads the nodes of one file, which know their lines."""

    def __init__(self, path: str) -> None:
        self._path = path

    def _fail(self, node: Any, reason: str) -> OptionError:
        return fail_at(self._path, node, reason)

    def read(self, root: Any) -> Arena:
        entries = read_mapping(
            self._path, root, "an arena is a mapping with the keys %s" % ", ".join(_KEYS)
        )
        for key, (key_node, _) in entries.items():
            if key not in _KEYS:
                raise self._fail(
                    key_node, "unknown key %s; known are %s" % (describe_node(key_node), ", ".join(_KEYS))
                )
        nodes = {key: value_node for key, (_, value_node) in entries.items()}
        segments: List[Tuple[float, float, float, float]] = []
        for node in self._items(nodes.get("walls_m"), "walls_m"):
            points = self._points(node, 2, "a wall")
            segments += [(x1, y1, x2, y2) for (x1, y1), (x2, y2) in zip(points, points[1:])]
        polygons: List[np.ndarray] = []
        for node in self._items(nodes.get("polygons_m"), "polygons_m"):
            corners = self._points(node, 3, "a polygon")
            segments += outline(corners)
            polygons.append(np.array(corners))
        circles = []
        for node in self._items(nodes.get("circles_m"), "circles_m"):
            x_m, y_m, radius_m = self._numbers(node, 3, "a circle: x, y, radius")
            if radius_m <= 0:
                raise self._fail(node, "a circle's radius must be more than 0, not %g" % radius_m)
            circles.append((x_m, y_m, radius_m))
        bounds_m = self._bounds(nodes.get("bounds_m"), root, segments)
        arena = Arena(
            self._name(nodes.get("name")),
            np.array(segments, dtype=float).reshape(-1, 4),
            np.array(circles, dtype=float).reshape(-1, 3),
            (),
            bounds_m,
            tuple(polygons),
        )
        return arena._replace(starts=self._starts(nodes.get("starts_m_deg"), arena))

    def _name(self, node: Any) -> str:
        if node is None:
            return os.path.basename(self._path)
        # It is printed in terminals.
        if node.id != "scalar" or not node.value.isprintable():
            raise self._fail(node, "name must be one line of text, not %s" % describe_node(node))
        return str(node.value)

    def _starts(self, node: Any, arena: Arena) -> Tuple[Pose, ...]:
        starts: List[Pose] = []
        for item in self._items(node, "starts_m_deg"):
            x_m, y_m, heading_deg = self._numbers(item, 3, "a start: x, y, heading in degrees")
            start = (x_m, y_m, math.radians(heading_deg))
            if not is_free(start, starts, arena, BODY_RADIUS_M):
                raise self._fail(
                    item,
                    "the start at (%g, %g) touches a wall, an obstacle or another start; robots need %.3f m around "
                    "their centre" % (x_m, y_m, BODY_RADIUS_M),
                )
            starts.append(start)
        return tuple(starts)

    def _bounds(
        self, node: Any, root: Any, segments: List[Tuple[float, float, float, float]]
    ) -> Tuple[float, float, float, float]:
        if node is not None:
            x_min, y_min, x_max, y_max = self._numbers(node, 4, "bounds_m: x min, y min, x max, y max")
            if not (x_min < x_max and y_min < y_max):
                raise self._fail(node, "bounds_m: the minimum must be less than the maximum")
            return x_min, y_min, x_max, y_max
        if not segments:
            raise self._fail(root, "an arena without walls needs bounds_m: [x min, y min, x max, y max]")
        ends = np.array(segments).reshape(-1, 2)
        return (
            float(ends[:, 0].min()),
            float(ends[:, 1].min()),
            float(ends[:, 0].max()),
            float(ends[:, 1].max()),
        )

    def _items(self, node: Any, key: str) -> List[Any]:
        if node is None or node.id == "scalar" and node.value in ("", "null", "~"):
            return []
        if node.id != "sequence":
            raise self._fail(node, "%s must be a list" % key)
        items: List[Any] = node.value
        return items

    def _points(self, node: Any, least: int, what: str) -> List[Tuple[float, float]]:
        if node.id != "sequence" or len(node.value) < least:
            raise self._fail(node, "%s must be a list of at least %d points [x, y]" % (what, least))
        points = []
        for point in node.value:
            x_m, y_m = self._numbers(point, 2, "a point: x, y")
            points.append((x_m, y_m))
        return points

    def _numbers(self, node: Any, count: int, what: str) -> List[float]:
        if node.id != "sequence" or len(node.value) != count:
            raise self._fail(node, "expected %d numbers for %s" % (count, what))
        numbers = []
        for item in node.value:
            try:
                number = float(item.value)
            except (TypeError, ValueError) as error:
                raise self._fail(item, "%s is not a number (%s)" % (describe_node(item), what)) from error
            if not abs(number) <= _LARGEST_M:
                raise self._fail(item, "%s is not between -1000 and 1000 (%s)" % (describe_node(item), what))
            numbers.append(number)
        return numbers
