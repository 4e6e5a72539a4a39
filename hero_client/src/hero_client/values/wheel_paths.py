"""The path of a robot by its two wheels. Pure."""

import numpy as np


def follow_wheels(rolled_m: np.ndarray, separation_m: float) -> np.ndarray:
    """Return poses (K, 3) from 0, 0, 0 for how far the left and right wheel have rolled (K, 2); yaw is not wrapped."""
    left_m, right_m = np.diff(rolled_m, axis=0).T
    yaw_rad = np.concatenate(([0.0], np.cumsum((right_m - left_m) / separation_m)))
    middle_rad = (yaw_rad[1:] + yaw_rad[:-1]) / 2.0
    paths_m = (left_m + right_m) / 2.0
    places_m = np.cumsum(np.column_stack((paths_m * np.cos(middle_rad), paths_m * np.sin(middle_rad))), axis=0)
    return np.column_stack((np.vstack(([(0.0, 0.0)], places_m)), yaw_rad))
