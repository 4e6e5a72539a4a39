"""Arenas from YAML files; a wrong file is refused with file, line and reason. The format is in the README."""

import math
import os
from typing import Any, List, Tuple

import numpy as np

from ..errors import OptionError
from ..robot_constants import BODY_RADIUS_M
from ..yaml_file import describe_node, fail_at, read_mapping, read_nodes
from .arena import Arena, Segment, is_free, outline
from .kinematics import Pose

__all__ = ["SHIPPED", "load_arena"]

SHIPPED = ("empty", "obstacles", "maze")
"""Arenas that come with the simulator; --arena takes these names too."""

_LARGEST_M = 1000.0
_KEYS = ("name", "bounds_m", "walls_m", "circles_m", "polygons_m", "starts_m_deg")


def load_arena(name: str) -> Arena:
    """Return the arena of a shipped name or of the file at that path.

    Raises: OptionError with file, line and reason.
    """
    path = name
    if name in SHIPPED:
        path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "arenas", name + ".yaml")
    root = read_nodes(path, "arena " + path, "shipped are " + ", ".join(SHIPPED))
    return _Reader(path).read(root)


class _Reader:
    """Reads the nodes of one file, which know their lines."""

    def __init__(self, path: str) -> None:
        self._path = path

    def _fail(self, node: Any, reason: str) -> OptionError:
        return fail_at(self._path, node, reason)

    def read(self, root: Any) -> Arena:
        known = ", ".join(_KEYS)
        entries = read_mapping(self._path, root, "an arena is a mapping with the keys " + known)
        for key, (key_node, _) in entries.items():
            if key not in _KEYS:
                raise self._fail(key_node, "unknown key %s; known are %s" % (describe_node(key_node), known))
        nodes = {key: entries[key][1] if key in entries else None for key in _KEYS}
        walls = [self._read_points(node, 2, "a wall") for node in self._list_items(nodes, "walls_m")]
        polygons = [self._read_points(node, 3, "a polygon") for node in self._list_items(nodes, "polygons_m")]
        circles = [self._read_circle(node) for node in self._list_items(nodes, "circles_m")]
        segments = [(*start, *end) for points in walls for start, end in zip(points, points[1:])]
        segments += [edge for corners in polygons for edge in outline(corners)]
        arena = Arena(
            self._read_name(nodes["name"]),
            np.array(segments, dtype=float).reshape(-1, 4),
            np.array(circles, dtype=float).reshape(-1, 3),
            (),
            self._read_bounds(nodes["bounds_m"], root, segments),
            tuple(np.array(corners) for corners in polygons),
        )
        starts: List[Pose] = []
        for node in self._list_items(nodes, "starts_m_deg"):
            starts.append(self._read_start(node, starts, arena))
        return arena._replace(starts=tuple(starts))

    def _read_name(self, node: Any) -> str:
        if node is None:
            return os.path.basename(self._path)
        # It is printed in terminals.
        if node.id != "scalar" or not node.value.isprintable():
            raise self._fail(node, "name must be one line of text, not %s" % describe_node(node))
        return str(node.value)

    def _read_circle(self, node: Any) -> List[float]:
        circle = self._read_numbers(node, 3, "a circle: x, y, radius")
        if circle[2] <= 0:
            raise self._fail(node, "a circle's radius must be more than 0, not %g" % circle[2])
        return circle

    def _read_start(self, node: Any, others: List[Pose], arena: Arena) -> Pose:
        x_m, y_m, heading_deg = self._read_numbers(node, 3, "a start: x, y, heading in degrees")
        start = Pose(x_m, y_m, math.radians(heading_deg))
        if not is_free(start, others, arena, BODY_RADIUS_M):
            reason = "the start at (%g, %g) touches a wall, an obstacle or another start; " % (x_m, y_m)
            raise self._fail(node, reason + "robots need %.3f m around their center" % BODY_RADIUS_M)
        return start

    def _read_bounds(self, node: Any, root: Any, segments: List[Segment]) -> Segment:
        if node is not None:
            x_min, y_min, x_max, y_max = self._read_numbers(node, 4, "bounds_m: x min, y min, x max, y max")
            if not (x_min < x_max and y_min < y_max):
                raise self._fail(node, "bounds_m: the minimum must be less than the maximum")
            return x_min, y_min, x_max, y_max
        if not segments:
            raise self._fail(root, "an arena without walls needs bounds_m: [x min, y min, x max, y max]")
        ends_m = np.array(segments).reshape(-1, 2)
        return (*ends_m.min(axis=0).tolist(), *ends_m.max(axis=0).tolist())

    def _list_items(self, nodes: Any, key: str) -> List[Any]:
        node = nodes[key]
        if node is None or node.id == "scalar" and node.value in ("", "null", "~"):
            return []
        if node.id != "sequence":
            raise self._fail(node, "%s must be a list" % key)
        return list(node.value)

    def _read_points(self, node: Any, least: int, what: str) -> List[Tuple[float, float]]:
        if node.id != "sequence" or len(node.value) < least:
            raise self._fail(node, "%s must be a list of at least %d points [x, y]" % (what, least))
        points = [self._read_numbers(point, 2, "a point: x, y") for point in node.value]
        return [(x_m, y_m) for x_m, y_m in points]

    def _read_numbers(self, node: Any, count: int, what: str) -> List[float]:
        if node.id != "sequence" or len(node.value) != count:
            raise self._fail(node, "expected %d numbers for %s" % (count, what))
        return [self._read_number(item, what) for item in node.value]

    def _read_number(self, node: Any, what: str) -> float:
        try:
            number = float(node.value)
        except (TypeError, ValueError) as error:
            raise self._fail(node, "%s is not a number (%s)" % (describe_node(node), what)) from error
        if not abs(number) <= _LARGEST_M:
            raise self._fail(node, "%s is not between -1000 and 1000 (%s)" % (describe_node(node), what))
        return number
