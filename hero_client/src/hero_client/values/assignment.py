"""The assignment of rows to columns with the least sum of costs. Pure.

Source: the Hungarian method by shortest augmenting paths (Kuhn, 1955; Jonker and Volgenant, 1987): a row is added at a
time, along the cheapest chain of rows that change their columns.
"""

from typing import List

import numpy as np


def assign_rows(costs: np.ndarray) -> List[int]:
    """Return for each row its column, no column twice.

    costs: [rows, columns], at least as many columns as rows.
    """
    row_count, column_count = costs.shape
    row_prices, column_prices = np.zeros(row_count), np.zeros(column_count)
    row_of = np.full(column_count, -1)
    for new_row in range(row_count):
        lengths = np.full(column_count, np.inf)  # of the cheapest chain from new_row to a column
        previous = np.full(column_count, -1)  # column before it in that chain
        is_settled = np.zeros(column_count, dtype=bool)
        row, column, length = new_row, -1, 0.0
        while row >= 0:
            through = length + costs[row] - row_prices[row] - column_prices
            is_shorter = ~is_settled & (through < lengths)
            lengths[is_shorter], previous[is_shorter] = through[is_shorter], column
            column = int(np.argmin(np.where(is_settled, np.inf, lengths)))
            length = float(lengths[column])
            is_settled[column] = True
            row = int(row_of[column])
        gains = length - lengths[is_settled]
        column_prices[is_settled] -= gains
        row_prices[new_row] += length
        rows = row_of[is_settled]
        row_prices[rows[rows >= 0]] += gains[rows >= 0]
        while column >= 0:
            before = int(previous[column])
            row_of[column] = row_of[before] if before >= 0 else new_row
            column = before
    columns = np.empty(row_count, dtype=int)
    taken = np.flatnonzero(row_of >= 0)
    columns[row_of[taken]] = taken
    return [int(column) for column in columns]
