"""Tables of figures that a test keeps: results of experiments must not change without a word in the CHANGELOG.

To renew the figures of a test after a change that is meant, take those that the failing test prints.
"""

import numpy as np

TOLERANCE = 1.5
"""In units of the last digit: versions of numpy round otherwise."""


def check_figures(found, kept, decimals):
    """Compare an array (N, M) with a text of N lines of M figures; decimals: of all columns, or of each (M,)."""
    found, digits = np.atleast_2d(np.asarray(found, dtype=float)), np.broadcast_to(decimals, np.shape(found)[-1:])
    lines = [" ".join(f"{value:.{count}f}" for value, count in zip(row, digits)) for row in found.tolist()]
    told = "the figures are now:\n" + "\n".join(lines)
    table = [list(map(float, line.split())) for line in kept.strip().splitlines()]
    assert np.shape(table) == found.shape, told
    # Where both are nan, they are equal.
    off = np.where(np.isnan(table) & np.isnan(found), 0.0, np.abs(np.array(table) - found))
    assert (off <= TOLERANCE * 10.0 ** -digits.astype(float)).all(), told
