"""Fingerprints of arrays: a few numbers that differ if any number of the arrays does, for tests to keep."""

import numpy as np


def assert_kept(kept, *arrays):
    """Check that the fingerprint of all numbers of arrays is the one that a test keeps; its failure tells the new one.

    That is two weighted sums, which versions of numpy round differently, and how many numbers there are.
    """
    values = np.concatenate([np.ravel(np.asarray(array, dtype=float)) for array in arrays])
    values = np.nan_to_num(values, nan=-7.0, posinf=11.0, neginf=-11.0)
    places = np.arange(len(values))
    sums = np.cos(places) @ values, np.sin(0.7 * places + 0.3) @ values
    found = [*(round(float(one), 7) for one in sums), len(values)]
    is_kept = len(kept) == 3 and np.allclose(found, kept, rtol=1e-6, atol=2e-6)
    assert is_kept, f"the fingerprint is now {found}"
