"""The assignment with the least sum, for any costs."""

import itertools

import numpy as np
import pytest

from hero_client.values.assignment import assign_rows


def sum_costs(costs, columns):
    return sum(costs[row, column] for row, column in enumerate(columns))


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (3, 3), (4, 6), (6, 6)])
def test_no_other_assignment_costs_less(shape):
    rng = np.random.RandomState(7)
    for round_number in range(40):
        # Small whole numbers: many assignments that cost the same. Negative ones: prices below zero.
        costs = rng.randint(-3, 4, shape).astype(float) if round_number % 2 else rng.uniform(0.0, 9.0, shape)
        columns = assign_rows(costs)
        assert len(set(columns)) == shape[0]
        least = min(sum_costs(costs, chosen) for chosen in itertools.permutations(range(shape[1]), shape[0]))
        assert sum_costs(costs, columns) == pytest.approx(least)


def test_a_hundred_robots_are_assigned_as_scipy_does():
    optimize = pytest.importorskip("scipy.optimize", reason="scipy is the reference")
    costs = np.random.RandomState(1).uniform(0.0, 1.0, (100, 120))
    rows, columns = optimize.linear_sum_assignment(costs)
    assert sum_costs(costs, assign_rows(costs)) == pytest.approx(costs[rows, columns].sum())
