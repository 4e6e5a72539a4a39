"""Discs and convex polygons that can be pushed over the floor, and where they touch robots, walls and each other.

Pure: floats, and of what moves only + - * / and roots, so that a world gives the same bytes on every machine.
"""

import copy
import math
from typing import List, NamedTuple, Sequence, Tuple, Union

from hero_node import Pose

GRAVITY_M_S2 = 9.81

Point = Tuple[float, float]

Motion = Tuple[float, float, float]
"""x m, y m, rotation rad."""


class Contact(NamedTuple):
    """The contact of two bodies; frame world.

    Attributes:
        x_m, y_m: the point.
        normal_x, normal_y: from the first body into the second, of length 1.
        depth_m: how far they overlap; negative: their distance.
    """

    x_m: float
    y_m: float
    normal_x: float
    normal_y: float
    depth_m: float

    def turned(self) -> "Contact":
        """Return the same contact for the bodies the other way round."""
        return self._replace(normal_x=-self.normal_x, normal_y=-self.normal_y)


class Disc:
    """A round body.

    Attributes:
        reach_m: distance of its farthest point from its center.
        friction_radius_m: mean distance of the area's points from its center: the largest moment of friction about the
            center, divided by the largest force, for uniform pressure (Goyal et al. 1991).
    """

    def __init__(self, radius_m: float) -> None:
        """Raises: ValueError for a radius that is not more than 0."""
        if not 0.0 < radius_m < math.inf:
            raise ValueError(f"a radius must be more than 0, not {radius_m:g}")
        self.reach_m = self.radius_m = radius_m
        self.friction_radius_m = radius_m * (2.0 / 3.0)


class Polygon:
    """A convex body with corners.

    Attributes:
        corners_m: counter-clockwise, from its center of area.
        reach_m, friction_radius_m: as of a disc.
    """

    def __init__(self, corners_m: Sequence[Point]) -> None:
        """Take the corners in any frame, counter-clockwise; its origin becomes the center of area.

        Raises: ValueError for fewer than three corners, or if the polygon is not convex and counter-clockwise.
        """
        center_m = _find_center(corners_m)
        self.corners_m: List[Point] = [(x_m - center_m[0], y_m - center_m[1]) for x_m, y_m in corners_m]
        self.reach_m = max(math.sqrt(x_m * x_m + y_m * y_m) for x_m, y_m in self.corners_m)
        self.friction_radius_m = _find_friction_radius(self.corners_m)


Shape = Union[Disc, Polygon]


def _list_edges(corners_m: Sequence[Point]) -> List[Tuple[Point, Point]]:
    return list(zip(corners_m, [*corners_m[1:], *corners_m[:1]]))


def _find_center(corners_m: Sequence[Point]) -> Point:
    """Return the center of area of a convex polygon. Raises: ValueError if it is not one."""
    edges = _list_edges(corners_m)
    turns = [
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        for (a, b), (_, c) in zip(edges, edges[1:] + edges[:1])
    ]
    if len(corners_m) < 3 or not min(turns) > 0.0:
        raise ValueError("corners must be those of a convex polygon, counter-clockwise")
    crosses = [ax * by - bx * ay for (ax, ay), (bx, by) in edges]
    total = sum(crosses)
    x_m = sum((a[0] + b[0]) * cross for (a, b), cross in zip(edges, crosses)) / (3.0 * total)
    y_m = sum((a[1] + b[1]) * cross for (a, b), cross in zip(edges, crosses)) / (3.0 * total)
    return x_m, y_m


def _find_friction_radius(corners_m: Sequence[Point]) -> float:
    """Return the mean distance of a polygon's points from its center, rounded so that all machines agree."""
    moment, area_m2 = 0.0, 0.0
    for (ax, ay), (bx, by) in _list_edges(corners_m):
        # The triangle of an edge and the center: with the angle t from the foot of its height h, the sum of the
        # distances is the integral of h^3 / (3 cos^3 t).
        length_m = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
        height_m = (ax * by - bx * ay) / length_m
        ends = [((x * (bx - ax) + y * (by - ay)) / length_m) / height_m for x, y in ((ax, ay), (bx, by))]
        integrals = [(tangent * math.sqrt(1.0 + tangent * tangent) + math.asinh(tangent)) / 2.0 for tangent in ends]
        moment += height_m**3 / 3.0 * (integrals[1] - integrals[0])
        area_m2 += height_m * length_m / 2.0
    return float(f"{moment / area_m2:.7g}")


class PushedBody:
    """One body on the floor, which moves only while it is pushed.

    Its friction with the floor is an ellipsoid limit surface (Goyal, Ruina and Papadopoulos 1991; Lynch and Mason
    1996): a force f through its center and a moment m about it turn into the twist (vx, vy, w) ~ (fx, fy, m / c^2),
    with c the friction radius of its shape.

    Attributes:
        pose: of its center, frame world; x_m, y_m: its place.
        corners_m: frame world; none of a disc.
        friction_n: the force through its center that just moves it.
    """

    def __init__(self, shape: Shape, pose: Pose, mass_kg: float, friction: float) -> None:
        """Put it down; friction is the coefficient between it and the floor.

        Raises: ValueError for a number that is not more than 0.
        """
        for name, value in (("mass_kg", mass_kg), ("friction", friction)):
            if not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be more than 0, not {value:g}")
        self.friction_n = mass_kg * friction * GRAVITY_M_S2
        self.shape = shape
        self._set(pose, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad))

    def _set(self, pose: Pose, cosine: float, sine: float) -> None:
        x_m, y_m, _ = pose
        self.pose, self.x_m, self.y_m, self._heading = pose, x_m, y_m, (cosine, sine)
        corners = self.shape.corners_m if isinstance(self.shape, Polygon) else ()
        self.corners_m = [(x_m + cosine * x - sine * y, y_m + sine * x + cosine * y) for x, y in corners]

    def put(self, pose: Pose) -> "PushedBody":
        """Return a copy at pose."""
        body = copy.copy(self)
        body._set(pose, math.cos(pose.yaw_rad), math.sin(pose.yaw_rad))
        return body

    def move(self, motion: Motion) -> None:
        """Move by less than half a radian."""
        x_m, y_m, rotation_rad = motion
        cosine, sine = self._heading
        # The half-angle form keeps the heading's length to the second order; the rest is divided out.
        half = rotation_rad * (0.5 + rotation_rad * rotation_rad / 24.0)
        scale = 1.0 / (1.0 + half * half)
        turn_cosine, turn_sine = (1.0 - half * half) * scale, 2.0 * half * scale
        cosine, sine = cosine * turn_cosine - sine * turn_sine, cosine * turn_sine + sine * turn_cosine
        length = math.sqrt(cosine * cosine + sine * sine)
        pose = Pose(self.pose.x_m + x_m, self.pose.y_m + y_m, self.pose.yaw_rad + rotation_rad)
        self._set(pose, cosine / length, sine / length)


def list_outlines(bodies: Sequence[PushedBody]) -> Tuple[Sequence[Tuple[float, ...]], Sequence[Tuple[float, ...]]]:
    """Return the edges of polygons, x1 y1 x2 y2, and the discs, x y radius."""
    edges_m = [start_m + end_m for body in bodies for start_m, end_m in _list_edges(body.corners_m)]
    return edges_m, [(body.x_m, body.y_m, body.shape.reach_m) for body in bodies if not body.corners_m]


def touch_circle(x_m: float, y_m: float, radius_m: float, body: PushedBody) -> Contact:
    """Return where a circle, the first body, is nearest to body, the second."""
    if isinstance(body.shape, Disc):
        away_x, away_y = body.x_m - x_m, body.y_m - y_m
        distance_m = math.sqrt(away_x * away_x + away_y * away_y) or 1e-9
        normal_x, normal_y = away_x / distance_m, away_y / distance_m
        depth_m = radius_m + body.shape.radius_m - distance_m
        return Contact(x_m + normal_x * radius_m, y_m + normal_y * radius_m, normal_x, normal_y, depth_m)
    inside = _find_edge((x_m, y_m), body.corners_m)
    if inside.depth_m > 0.0:
        # The center lies in the body: out through the nearest edge.
        return inside.turned()._replace(depth_m=radius_m + inside.depth_m)
    best_m2, best_m = math.inf, (0.0, 0.0)
    for start_m, end_m in _list_edges(body.corners_m):
        point_m = _find_nearest((x_m, y_m), start_m, end_m)
        away_x, away_y = point_m[0] - x_m, point_m[1] - y_m
        if away_x * away_x + away_y * away_y < best_m2:
            best_m2, best_m = away_x * away_x + away_y * away_y, point_m
    distance_m = math.sqrt(best_m2) or 1e-9
    normal_x, normal_y = (best_m[0] - x_m) / distance_m, (best_m[1] - y_m) / distance_m
    return Contact(best_m[0], best_m[1], normal_x, normal_y, radius_m - distance_m)


def _find_nearest(place_m: Point, start_m: Point, end_m: Point) -> Point:
    """Return the point of a line from start to end that is nearest to a place."""
    along_x, along_y = end_m[0] - start_m[0], end_m[1] - start_m[1]
    share = ((place_m[0] - start_m[0]) * along_x + (place_m[1] - start_m[1]) * along_y) / (
        along_x * along_x + along_y * along_y
    )
    share = min(max(share, 0.0), 1.0)
    return start_m[0] + share * along_x, start_m[1] + share * along_y


def _find_edge(point_m: Point, corners_m: Sequence[Point]) -> Contact:
    """Return where a point is least deep in a convex polygon; the normal is the edge's, outwards."""
    best = None
    for (ax, ay), (bx, by) in _list_edges(corners_m):
        length_m = math.sqrt((bx - ax) * (bx - ax) + (by - ay) * (by - ay))
        normal_x, normal_y = (by - ay) / length_m, (ax - bx) / length_m
        depth_m = (ax - point_m[0]) * normal_x + (ay - point_m[1]) * normal_y
        if best is None or depth_m < best.depth_m:
            best = Contact(point_m[0], point_m[1], normal_x, normal_y, depth_m)
    assert best is not None
    return best


def find_contacts(first: PushedBody, second: PushedBody, margin_m: float) -> List[Contact]:
    """Return where first touches second, or is nearer than margin_m."""
    if isinstance(first.shape, Disc):
        contacts = [touch_circle(first.x_m, first.y_m, first.shape.radius_m, second)]
    elif isinstance(second.shape, Disc):
        contacts = [touch_circle(second.x_m, second.y_m, second.shape.radius_m, first).turned()]
    else:
        own, others = _find_facing(first, second), _find_facing(second, first)
        # Of two that are alike the first body's edge: two boxes side by side touch along it, whichever rounds better.
        if own[0] + _ALIKE_M >= others[0]:
            contacts = _touch_edge(own[1], second)
        else:
            contacts = [contact.turned() for contact in _touch_edge(others[1], first)]
    return [contact for contact in contacts if contact.depth_m > -margin_m]


_ALIKE_M = 1e-9


def _find_facing(body: PushedBody, other: PushedBody) -> Tuple[float, Tuple[Point, Point]]:
    """Return the edge of body that is farthest from other, and how far (negative: they overlap)."""
    found = []
    for start_m, end_m in _list_edges(body.corners_m):
        _, (normal_x, normal_y), _ = _measure_edge(start_m, end_m)
        found.append(min((x - start_m[0]) * normal_x + (y - start_m[1]) * normal_y for x, y in other.corners_m))
    best = max(range(len(found)), key=found.__getitem__)
    return found[best], _list_edges(body.corners_m)[best]


def _measure_edge(start_m: Point, end_m: Point) -> Tuple[Point, Point, float]:
    """Return the direction of an edge, its normal to the outside, and its length (m)."""
    x_m, y_m = end_m[0] - start_m[0], end_m[1] - start_m[1]
    length_m = math.sqrt(x_m * x_m + y_m * y_m)
    return (x_m / length_m, y_m / length_m), (y_m / length_m, -x_m / length_m), length_m


def _touch_edge(edge: Tuple[Point, Point], body: PushedBody) -> List[Contact]:
    """Return where the edge of another body touches body: the ends of what of body's nearest edge is beside it."""
    (start_x, start_y), _ = edge
    (along_x, along_y), (normal_x, normal_y), length_m = _measure_edge(*edge)

    def face(ends: Tuple[Point, Point]) -> float:
        _, (x, y), _ = _measure_edge(*ends)
        return x * normal_x + y * normal_y

    ends = min(_list_edges(body.corners_m), key=face)
    beside = [
        ((x - start_x) * along_x + (y - start_y) * along_y, (x - start_x) * normal_x + (y - start_y) * normal_y)
        for x, y in ends
    ]
    contacts = []
    for (share_m, depth_m), (other_m, other_depth_m) in (beside, beside[::-1]):
        kept_m = min(max(share_m, 0.0), length_m)
        if abs(kept_m - share_m) < _ALIKE_M:
            kept_m = share_m
        elif (kept_m - share_m) * (other_m - kept_m) <= 0.0:
            continue  # all of it is beyond this end
        else:
            depth_m += (other_depth_m - depth_m) * ((kept_m - share_m) / (other_m - share_m))
        x_m, y_m = start_x + along_x * kept_m + normal_x * depth_m, start_y + along_y * kept_m + normal_y * depth_m
        contacts.append(Contact(x_m, y_m, normal_x, normal_y, -depth_m))
    return contacts


def touch_walls(
    body: PushedBody, walls_m: Sequence[Tuple[float, float, float, float]], margin_m: float
) -> List[Contact]:
    """Return where walls x1 y1 x2 y2, the first body, touch body, or are nearer than margin_m."""
    contacts: List[Contact] = []
    for x1_m, y1_m, x2_m, y2_m in walls_m:
        start_m, end_m = (x1_m, y1_m), (x2_m, y2_m)
        near_m = _find_nearest((body.x_m, body.y_m), start_m, end_m)
        away_x, away_y = body.x_m - near_m[0], body.y_m - near_m[1]
        reach_m = body.shape.reach_m + margin_m
        if away_x * away_x + away_y * away_y > reach_m * reach_m:
            continue
        if isinstance(body.shape, Disc):
            contacts.append(touch_circle(*near_m, 0.0, body))
        else:
            contacts += _touch_wall(body, start_m, end_m, margin_m)
    return [contact for contact in contacts if contact.depth_m > -margin_m]


def _touch_wall(body: PushedBody, start_m: Point, end_m: Point, margin_m: float) -> List[Contact]:
    """Return where a wall is near the corners of a polygon, and where its ends are near the polygon's edges."""
    along_x, along_y = end_m[0] - start_m[0], end_m[1] - start_m[1]
    length_m = math.sqrt(along_x * along_x + along_y * along_y)
    normal_x, normal_y = -along_y / length_m, along_x / length_m
    if (body.x_m - start_m[0]) * normal_x + (body.y_m - start_m[1]) * normal_y < 0.0:
        normal_x, normal_y = -normal_x, -normal_y
    contacts = []
    for x_m, y_m in body.corners_m:
        share = ((x_m - start_m[0]) * along_x + (y_m - start_m[1]) * along_y) / (length_m * length_m)
        depth_m = (start_m[0] - x_m) * normal_x + (start_m[1] - y_m) * normal_y
        # A corner that is deeper went past the wall's end, not through the wall.
        if 0.0 <= share <= 1.0 and depth_m < margin_m:
            contacts.append(Contact(x_m, y_m, normal_x, normal_y, depth_m))
    return contacts + [_find_edge(point_m, body.corners_m).turned() for point_m in (start_m, end_m)]
