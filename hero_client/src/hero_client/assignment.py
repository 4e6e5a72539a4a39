"""A table of costs -> who goes where, so that the sum is least. Pure; uses scipy's solver where there is one.

Robots that are sent to goals take squared distances as costs: then paths of an optimal assignment do not cross.
Source of the own solver: the Hungarian method as successive shortest augmenting paths (R. Jonker, A. Volgenant, A
shortest augmenting path algorithm for dense and sparse linear assignment problems, Computing 38, 1987).
"""

import math
from typing import List, Sequence, Tuple

try:
    from scipy.optimize import linear_sum_assignment
except ImportError:
    linear_sum_assignment = None

Point = Tuple[float, float]


def assign_goals(starts: Sequence[Point], goals: Sequence[Point]) -> List[int]:
    """Return for each start the index of its goal, with the least sum of squared distances.

    Raises: ValueError if there are more starts than goals.
    """
    costs = [[(sx - gx) ** 2 + (sy - gy) ** 2 for gx, gy in goals] for sx, sy in starts]
    return assign(costs, len(goals))


def assign(costs: Sequence[Sequence[float]], columns: int) -> List[int]:
    """Return for each row its column, each column at most once, with the least sum.

    Raises: ValueError if there are more rows than columns.
    """
    if len(costs) > columns:
        raise ValueError("%d robots cannot take %d goals, one each" % (len(costs), columns))
    if not costs:
        return []
    if linear_sum_assignment is not None:
        return [int(column) for column in linear_sum_assignment(costs)[1]]
    return assign_without_scipy(costs)


def assign_without_scipy(costs: Sequence[Sequence[float]]) -> List[int]:
    """Return what assign() does; rows are added one by one, each along the cheapest chain of changes. O(n^3)."""
    rows, columns = len(costs), len(costs[0])
    row_of = [-1] * columns
    row_price = [0.0] * rows
    column_price = [0.0] * columns
    for new_row in range(rows):
        distance = [math.inf] * columns  # of the cheapest chain from new_row to a column
        came_from = [-1] * columns
        done = [False] * columns
        row, column, reached = new_row, -1, 0.0
        while True:
            for other in range(columns):
                if not done[other]:
                    through = reached + costs[row][other] - row_price[row] - column_price[other]
                    if through < distance[other]:
                        distance[other], came_from[other] = through, column
            column = min((other for other in range(columns) if not done[other]), key=distance.__getitem__)
            reached = distance[column]
            done[column] = True
            if row_of[column] < 0:
                break
            row = row_of[column]
        for other in range(columns):
            if done[other]:
                if row_of[other] >= 0:
                    row_price[row_of[other]] += reached - distance[other]
                column_price[other] += distance[other] - reached
        row_price[new_row] += reached
        while came_from[column] >= 0:
            row_of[column] = row_of[came_from[column]]
            column = came_from[column]
        row_of[column] = new_row
    return [row_of.index(row) for row in range(rows)]
