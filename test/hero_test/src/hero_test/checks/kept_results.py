"""Results that tests keep in numbers: those of experiments must not change without a word in the CHANGELOG.

After a change that is meant, take the numbers that the failed test shows; if others than expected changed, look for the
reason first. All are the same on every machine and with all versions of numpy.
"""

import hashlib

import numpy as np

TOLERANCE = 1.5
"""In units of a figure's last digit: versions of numpy round otherwise."""


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


def check_sums(kept, *arrays):
    """Compare arrays too large for figures: two weighted sums of all numbers, and how many there are."""
    values = np.concatenate([np.ravel(np.asarray(array, dtype=float)) for array in arrays])
    values = np.nan_to_num(values, nan=-7.0, posinf=11.0, neginf=-11.0)
    places = np.arange(len(values))
    sums = np.cos(places) @ values, np.sin(0.7 * places + 0.3) @ values
    found = [*(round(float(one), 7) for one in sums), len(values)]
    is_kept = len(kept) == 3 and np.allclose(found, kept, rtol=1e-6, atol=2e-6)
    assert is_kept, f"the sums are now {found}"


class Digest:
    """Sums up arrays and texts to the last bit; what comes from sines or logarithms is rounded before."""

    def __init__(self):
        self._sum = hashlib.sha256()

    def add(self, *values):
        for value in values:
            if isinstance(value, np.ndarray):
                # Adding zero takes the sign from zeros.
                value = np.nan_to_num(np.asarray(value, dtype=float) + 0.0).tobytes()
            self._sum.update(value if isinstance(value, bytes) else repr(value).encode())

    def __str__(self):
        return self._sum.hexdigest()[:16]
