"""The nearest allowed velocity, beside all candidates: the wanted one, and places on one and on two borders."""

import itertools

import numpy as np
import pytest

from hero_client.controllers import half_planes
from hero_client.controllers.half_planes import nearest_allowed

NO_LIMIT_M_S = 100.0


def find_nearest(wanted, normals, bounds):
    """Return the nearest allowed velocity of one robot, None if none is allowed."""
    candidates = [wanted]
    candidates += [wanted + normal * (bound - normal @ wanted) for normal, bound in zip(normals, bounds)]
    for first, second in itertools.combinations(range(len(bounds)), 2):
        pair = np.array((normals[first], normals[second]))
        if abs(np.linalg.det(pair)) > 1e-6:
            candidates.append(np.linalg.solve(pair, (bounds[first], bounds[second])))
    allowed = [found for found in candidates if (normals @ found >= bounds - 1e-9).all()]
    return min(allowed, key=lambda found: np.hypot(*(found - wanted)), default=None)


@pytest.mark.parametrize("planes", [1, 2, 4])
def test_the_nearest_allowed_velocities_are_found(planes, monkeypatch):
    monkeypatch.setattr(half_planes, "_SWEEPS", 2000)
    random = np.random.RandomState(planes)
    wanted = random.normal(size=(40, 2))
    angles_rad = random.uniform(-np.pi, np.pi, (40, planes))
    normals = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
    bounds = random.normal(-0.3, 0.5, (40, planes))
    found = nearest_allowed(wanted, normals, bounds, NO_LIMIT_M_S)
    nearest = [find_nearest(*one) for one in zip(wanted, normals, bounds)]
    # Borders that meet far away are almost parallel, where the method takes its time.
    solvable = [row for row, velocity in enumerate(nearest) if velocity is not None and np.hypot(*velocity) < 4.0]
    assert len(solvable) > 20
    assert found[solvable] == pytest.approx(np.array([nearest[row] for row in solvable]), abs=1e-3)


def test_half_planes_that_are_not_there_change_nothing():
    wanted = np.array(((0.1, 0.2), (0.0, 0.0)))
    nothing = np.full((2, 3), -np.inf)
    assert nearest_allowed(wanted, np.full((2, 3, 2), np.nan), nothing, 1.0) == pytest.approx(wanted)
    some = np.array(((-np.inf, 0.3), (-np.inf, -np.inf)))
    normals = np.array((((np.nan, np.nan), (0.0, 1.0)), ((np.nan, np.nan), (np.nan, np.nan))))
    assert nearest_allowed(wanted, normals, some, 1.0) == pytest.approx(np.array(((0.1, 0.3), (0.0, 0.0))))


def test_a_compromise_is_not_faster_than_the_limit():
    wanted, normals = np.array(((3.0, 4.0), (0.03, 0.04))), np.zeros((2, 0, 2))
    found = nearest_allowed(wanted, normals, np.zeros((2, 0)), 0.1)
    assert found == pytest.approx(np.array(((0.06, 0.08), (0.03, 0.04))))
    opposite = np.array((((1.0, 0.0), (-1.0, 0.0)),))
    found = nearest_allowed(np.zeros((1, 2)), opposite, np.ones((1, 2)), 0.1)
    assert np.hypot(*found[0]) <= 0.1 + 1e-9


def test_soft_half_planes_that_exclude_each_other_give_way_alike():
    normals, bounds = np.array([[(1.0, 0.0), (-1.0, 0.0)]]), np.array([[0.06, 0.02]])
    found = nearest_allowed(np.zeros((1, 2)), normals, bounds, 0.1, softness=0.1)
    assert bounds[0] - normals[0] @ found[0] == pytest.approx([0.04, 0.04], abs=5e-3)
