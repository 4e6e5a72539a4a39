"""Shapes of the simulated world as viewers draw them: arena, objects and robots, in the frame `world`. Pure."""

import itertools
import math
import struct
from typing import Iterable, Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np

from hero_node import Pose
from hero_node.robot_constants import BODY_RADIUS_M
from hero_node.ros_messages import encode_header, encode_list, encode_pose, encode_text

from .world.arena import Area, Arena
from .world.pushing.shapes import PushedBody, list_outlines
from .world.world import World

FRAME = "world"

START_S = 1600000000
"""Stamp of simulated second 0: late enough not to be taken for a robot's uptime."""

ARROW, CUBE, CYLINDER, TEXT = 0, 1, 3, 9
"""Types of visualization_msgs/Marker."""

BODY_HEIGHT_M = 0.045
WALL_HEIGHT_M = 0.05
_WALL_THICKNESS_M = 0.005

Color = Tuple[float, float, float, float]
"""Red, green, blue, alpha, each 0..1."""

_WALL_COLOR = (0.6, 0.6, 0.6, 1.0)
_OBJECT_COLOR = (0.8, 0.5, 0.2, 1.0)
_LAMP_COLOR, _LAMP_M = (1.0, 0.85, 0.2, 1.0), 0.02
_PLATE_M = 0.0005
_MAX_CELLS, _LEVELS = 32, 20
"""Rows and columns in which pictures on the floor are drawn, and steps of gray between black and white."""
_DARK_COLOR = (0.15, 0.15, 0.15, 1.0)
_NOSE_COLOR = (1.0, 1.0, 1.0, 1.0)


class Shape(NamedTuple):
    """One visualization_msgs/Marker: namespace and number together name it; pose and z_m are those of its middle."""

    namespace: str
    number: int
    kind: int
    color: Color
    pose: Pose
    z_m: float
    size_m: Tuple[float, float, float]
    text: str = ""


def draw_robots(world: World, names: Sequence[str], lights: Sequence[Sequence[float]]) -> List[Shape]:
    """Return the first robots of a world with headings and names; lights: red green blue alpha, dark if off."""
    shapes: List[Shape] = []
    poses, radii_m = world.poses.tolist(), world.errors.radius_m[:, 0].tolist()
    nose_m = (BODY_RADIUS_M, 0.008, 0.004)
    for index, (name, light) in enumerate(zip(names, lights)):
        red, green, blue, alpha = light
        color = (red, green, blue, 1.0) if alpha > 0.0 and max(red, green, blue) > 0.0 else _DARK_COLOR
        pose, body_m = Pose(*poses[index]), (2.0 * radii_m[index], 2.0 * radii_m[index], BODY_HEIGHT_M)
        shapes += [
            Shape("robots", index, CYLINDER, color, pose, BODY_HEIGHT_M / 2.0, body_m),
            Shape("headings", index, ARROW, _NOSE_COLOR, pose, BODY_HEIGHT_M + 0.002, nose_m),
            Shape("names", index, TEXT, _NOSE_COLOR, pose, BODY_HEIGHT_M + 0.04, (0.0, 0.0, 0.03), name),
        ]
    return shapes


def draw_objects(bodies: Sequence[PushedBody]) -> List[Shape]:
    """Return discs, and the edges of polygons, where they are."""
    edges_m, discs_m = list_outlines(bodies)
    discs = [_draw_circle("objects", *item, _OBJECT_COLOR) for item in enumerate(discs_m)]
    return discs + [_draw_wall("objects", *item, _OBJECT_COLOR) for item in enumerate(edges_m, len(discs))]


def draw_arena(arena: Arena) -> List[Shape]:
    """Return areas, lamps, walls and obstacles."""
    floor = [_draw_area(number, *item) for number, item in enumerate(_list_plates(arena.areas))]
    lamps = [
        _draw_circle("lamps", number, (*lamp_m, _LAMP_M), _LAMP_COLOR)
        for number, lamp_m in enumerate(arena.lamps_m.tolist())
    ]
    walls = [_draw_wall("walls", *item, _WALL_COLOR) for item in enumerate(arena.segments_m.tolist())]
    return (
        floor
        + lamps
        + walls
        + [_draw_circle("obstacles", *item, _WALL_COLOR) for item in enumerate(arena.circles_m.tolist())]
    )


def _list_plates(areas: Sequence[Area]) -> Iterator[Tuple[int, Area]]:
    """Yield areas with their places in the order, from 1; a picture as rectangles of one gray, in coarser steps."""
    for order, area in enumerate(areas, 1):
        if area.gray is None:
            yield order, area
            continue
        rows, columns = (np.linspace(0, count, min(count, _MAX_CELLS) + 1).astype(int) for count in area.gray.shape)
        x_min, y_min, x_max, y_max = area.shape_m
        x_m = (x_min + (x_max - x_min) * columns / columns[-1]).tolist()
        y_m = (y_max - (y_max - y_min) * rows / rows[-1]).tolist()
        sums = np.add.reduceat(np.add.reduceat(area.gray, rows[:-1]), columns[:-1], axis=1)
        grays = np.rint(sums / np.outer(np.diff(rows), np.diff(columns)) * _LEVELS) / _LEVELS
        for row, strip in enumerate(grays.tolist()):
            first = 0
            for gray, run in itertools.groupby(strip):
                end = first + len(list(run))
                yield order, Area(area.name, (x_m[first], y_m[row + 1], x_m[end], y_m[row]), (gray,) * 3)
                first = end


def _draw_area(number: int, order: int, area: Area) -> Shape:
    """Return a thin plate, later ones above earlier ones."""
    color = (*area.color, 1.0)
    z_m = _PLATE_M * order
    if len(area.shape_m) == 3:
        x_m, y_m, radius_m = area.shape_m
        return Shape(
            "areas", number, CYLINDER, color, Pose(x_m, y_m, 0.0), z_m, (2.0 * radius_m, 2.0 * radius_m, _PLATE_M)
        )
    x_min, y_min, x_max, y_max = area.shape_m
    middle = Pose((x_min + x_max) / 2.0, (y_min + y_max) / 2.0, 0.0)
    return Shape("areas", number, CUBE, color, middle, z_m, (x_max - x_min, y_max - y_min, _PLATE_M))


def _draw_wall(namespace: str, number: int, ends_m: Sequence[float], color: Color) -> Shape:
    x1_m, y1_m, x2_m, y2_m = ends_m
    middle = Pose((x1_m + x2_m) / 2.0, (y1_m + y2_m) / 2.0, math.atan2(y2_m - y1_m, x2_m - x1_m))
    size_m = (math.hypot(x2_m - x1_m, y2_m - y1_m) + _WALL_THICKNESS_M, _WALL_THICKNESS_M, WALL_HEIGHT_M)
    return Shape(namespace, number, CUBE, color, middle, WALL_HEIGHT_M / 2.0, size_m)


def _draw_circle(namespace: str, number: int, circle_m: Sequence[float], color: Color) -> Shape:
    x_m, y_m, radius_m = circle_m
    size_m = (2.0 * radius_m, 2.0 * radius_m, WALL_HEIGHT_M)
    return Shape(namespace, number, CYLINDER, color, Pose(x_m, y_m, 0.0), WALL_HEIGHT_M / 2.0, size_m)


_MARKER_KIND = struct.Struct("<3i")
"""visualization_msgs/Marker between its namespace and its pose: id, type, action."""

_MARKER_SIZE = struct.Struct("<3d4f2i?2I")
"""Behind its pose: scale, color, lifetime, frame_locked, and the numbers of its points and their colors."""


def encode_markers(time_ns: int, shapes: Iterable[Shape]) -> bytes:
    """Return the visualization_msgs/MarkerArray that adds or moves shapes; time_ns: of its stamp."""
    header, encoded = encode_header(0, FRAME, divmod(time_ns, 10**9)), []
    for shape in shapes:
        kind = _MARKER_KIND.pack(shape.number, shape.kind, 0)
        size = _MARKER_SIZE.pack(*shape.size_m, *shape.color, 0, 0, False, 0, 0)
        head = header + encode_text(shape.namespace) + kind + encode_pose(*shape.pose, shape.z_m)
        encoded.append(head + size + encode_text(shape.text) + encode_text("") + b"\0")
    return encode_list(encoded)
