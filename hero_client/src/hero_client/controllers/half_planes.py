"""The velocity nearest to a wanted one within half planes and a largest speed, for many robots at once.

Pure: numpy only. Arrays: robots R, half planes K each; a half plane allows v with normal . v >= bound. Method:
Hildreth's procedure, dual coordinate ascent on the quadratic program (C. Hildreth, A quadratic programming procedure,
1957).
"""

import numpy as np

_SWEEPS = 16


def nearest_allowed_all(
    wanted: np.ndarray, normals: np.ndarray, bounds: np.ndarray, max_speed_m_s: float, sweeps: int = _SWEEPS
) -> np.ndarray:
    """Return the allowed velocities (R, 2) nearest to wanted (R, 2).

    normals (R, K, 2) of length 1, bounds (R, K); -inf for a half plane that is not there. Where none is allowed, the
    velocity is a compromise, which may be faster than wanted but not than max_speed_m_s.
    """
    velocities = wanted.T.copy()
    present = np.isfinite(bounds)
    limits = np.where(present, bounds, -1e9).T.copy()
    across = np.where(present[..., None], normals, 0.0).transpose(1, 2, 0).copy()
    pushes = np.zeros_like(limits)
    for _ in range(sweeps):
        for normal, limit, push in zip(across, limits, pushes):
            lacking = limit - (normal[0] * velocities[0] + normal[1] * velocities[1])
            change = np.maximum(lacking, -push)
            push += change
            velocities += normal * change
    speeds = np.hypot(*velocities)
    velocities *= np.minimum(1.0, max_speed_m_s / np.maximum(speeds, 1e-9))
    return velocities.T
