"""Loops over pairs of robots, used where numba compiles them: they give what sense_binary() and sense_neighbors() give.

Pure.
"""

import math
from typing import Any

import numpy as np


def find_touched(places_m: Any, cosines: Any, sines: Any, radius_m: float, range_m: float, touched: Any) -> None:
    """Set touched (W, N) for robots whose beam, from the front rim, touches another body of the same world.

    places_m: x and y (2, W, N); cosines, sines (W, N): of the headings; NaN where a pose is not known.
    """
    _, worlds, robots = places_m.shape
    square_m2 = radius_m * radius_m
    for world in range(worlds):
        x_m, y_m = places_m[0, world], places_m[1, world]
        for i in range(robots):
            own_x_m, own_y_m, cosine, sine = x_m[i], y_m[i], cosines[world, i], sines[world, i]
            is_touched = False
            for j in range(robots):  # without a branch, several at once
                to_x_m, to_y_m = x_m[j] - own_x_m, y_m[j] - own_y_m
                left_m = cosine * to_y_m - sine * to_x_m
                ahead_m = cosine * to_x_m + sine * to_y_m - radius_m
                gap_m = ahead_m - math.sqrt(max(square_m2 - left_m * left_m, 0.0))
                is_hit = (abs(left_m) < radius_m) & (ahead_m > 0.0) & (gap_m <= range_m)
                is_inside = ahead_m * ahead_m + left_m * left_m <= square_m2
                is_touched |= (is_hit | is_inside) & (i != j)
            touched[world, i] = is_touched


def find_near(poses: Any, cosines: Any, sines: Any, range_m: float, seen: Any, found: Any) -> None:
    """Set seen (W, N, N), and in found (3, W, N, N) what is forward and left, and the heading, of those in range, or 0.

    poses (W, N, 3), NaN where one is not known; cosines, sines (W, N): of the headings.
    """
    worlds, robots, _ = poses.shape
    for world in range(worlds):
        for i in range(robots):
            own_x_m, own_y_m, own_rad = poses[world, i, 0], poses[world, i, 1], poses[world, i, 2]
            cosine, sine = cosines[world, i], sines[world, i]
            for j in range(robots):  # without a branch, which would be hard to predict
                to_x_m, to_y_m = poses[world, j, 0] - own_x_m, poses[world, j, 1] - own_y_m
                forward_m, left_m = cosine * to_x_m + sine * to_y_m, cosine * to_y_m - sine * to_x_m
                heading_rad = poses[world, j, 2] - own_rad
                heading_rad -= 2.0 * math.pi * np.rint(heading_rad / (2.0 * math.pi))
                is_near = (i != j) & (math.sqrt(forward_m * forward_m + left_m * left_m) <= range_m)
                seen[world, i, j] = is_near
                found[0, world, i, j] = forward_m if is_near else 0.0
                found[1, world, i, j] = left_m if is_near else 0.0
                found[2, world, i, j] = heading_rad if is_near else 0.0
