"""Loops over the rays of infrared sensors, used where numba compiles them, which give what range_sensors.py gives.

Pure: the same operations in the same order as there, so the same bytes.
"""

import math
from typing import Any

import numpy as np


def measure_brightness(
    places_m: Any, headings: Any, bodies_m: Any, radii_m: Any, starts_m: Any, alongs_m: Any, lengths_m2: Any,
    circles_m: Any, rays: Any, weights: Any, limits_m: Any, brightest: Any,
) -> None:  # fmt: skip
    """Set brightest (K, B), in 1/m^2, of the B sensors of each robot, of a Sight whose fields come first.

    rays (2, A): directions in the body frame, the middles of all cones first; weights (A / B,) of each ray of a cone.
    limits_m: reach, what is nothing, radius of the body.
    """
    reach_m, far_m, radius_m = limits_m
    beams = brightest.shape[1]
    x, y, distance_m, cosine = np.empty((4, rays.shape[1]))
    for robot in range(len(places_m)):
        place_x_m, place_y_m = places_m[robot]
        ahead_x, ahead_y = headings[robot]
        for ray in range(len(x)):
            x[ray] = ahead_x * rays[0, ray] - ahead_y * rays[1, ray]
            y[ray] = ahead_y * rays[0, ray] + ahead_x * rays[1, ray]
        distance_m[:], cosine[:] = far_m, 0.0
        for wall in range(len(lengths_m2)):
            start_x_m, start_y_m = starts_m[0, wall] - place_x_m, starts_m[1, wall] - place_y_m
            along_x_m, along_y_m = alongs_m[0, wall], alongs_m[1, wall]
            area_m2 = start_x_m * along_y_m - start_y_m * along_x_m
            if area_m2 * area_m2 < (reach_m * reach_m) * lengths_m2[wall]:
                for ray in range(len(x)):
                    cross = x[ray] * along_y_m - y[ray] * along_x_m
                    across_m2 = start_x_m * y[ray] - start_y_m * x[ray]
                    if area_m2 * cross > 0.0 and across_m2 * cross >= 0.0 and abs(across_m2) <= abs(cross):
                        met_m = area_m2 / cross
                        if met_m < distance_m[ray]:
                            distance_m[ray], cosine[ray] = met_m, abs(cross) / math.sqrt(lengths_m2[wall])
        for body in range(len(radii_m)):
            to_x_m, to_y_m = bodies_m[robot, body, 0] - place_x_m, bodies_m[robot, body, 1] - place_y_m
            meet_circle(x, y, distance_m, cosine, to_x_m, to_y_m, radii_m[body], reach_m)
        for circle in range(len(circles_m)):
            to_x_m, to_y_m = circles_m[circle, 0] - place_x_m, circles_m[circle, 1] - place_y_m
            meet_circle(x, y, distance_m, cosine, to_x_m, to_y_m, circles_m[circle, 2], reach_m)
        brightest[robot] = 0.0
        for ray in range(len(x)):
            gap_m = max(distance_m[ray] - radius_m, 1e-3)
            bright = cosine[ray] / (gap_m * gap_m) * weights[ray // beams]
            brightest[robot, ray % beams] = max(brightest[robot, ray % beams], bright)


def meet_circle(
    x: Any, y: Any, distance_m: Any, cosine: Any, to_x_m: float, to_y_m: float, radius_m: float, reach_m: float
) -> None:
    """Cut the rays of one robot, x and y, at a circle whose center is to_x_m and to_y_m away, unless around itself."""
    center_m2 = to_x_m * to_x_m + to_y_m * to_y_m
    if 0.0 < center_m2 < (reach_m + radius_m) * (reach_m + radius_m):
        for ray in range(len(x)):
            across_m = x[ray] * to_y_m - y[ray] * to_x_m
            along_m = x[ray] * to_x_m + y[ray] * to_y_m
            if across_m * across_m < radius_m * radius_m and along_m > 0.0:
                depth_m = math.sqrt(radius_m * radius_m - across_m * across_m)
                met_m = max(along_m - depth_m, 0.0)
                if met_m < distance_m[ray]:
                    distance_m[ray], cosine[ray] = met_m, depth_m / radius_m
