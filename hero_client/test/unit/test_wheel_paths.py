"""Paths of a robot by what its wheels rolled, against circles."""

import math

import numpy as np
import pytest

from hero_client.values.wheel_paths import follow_wheels


def test_wheels_lead_along_circles_around_their_center():
    for radius_m, separation_m in ((0.3, 0.063), (-0.2, 0.08), (0.0, 0.063)):
        turned_rad = np.linspace(1.0, 8.0, 2000)
        rolled_m = np.outer(turned_rad, (radius_m - separation_m / 2.0, radius_m + separation_m / 2.0))
        x_m, y_m, yaw_rad = follow_wheels(rolled_m, separation_m).T
        assert yaw_rad == pytest.approx(turned_rad - 1.0)
        assert x_m == pytest.approx(radius_m * np.sin(yaw_rad), abs=1e-6)
        assert y_m == pytest.approx(radius_m * (1.0 - np.cos(yaw_rad)), abs=1e-6)
    assert follow_wheels(np.array([(1.0, 2.0)]), 0.1).tolist() == [[0.0, 0.0, 0.0]]
    quarter_m = 0.1 * math.pi / 2.0
    assert follow_wheels(np.array([(0.0, 0.0), (0.0, quarter_m)]), 0.1)[1] == pytest.approx(
        (quarter_m / 2.0 * math.sqrt(0.5), quarter_m / 2.0 * math.sqrt(0.5), math.pi / 2.0)
    ), "along the mean heading"
