"""Status of calibrations from their files: when, how good, which parts are missing, which robots are worse. Pure."""

import math
from statistics import median
from typing import Dict, List, NamedTuple, Optional, Sequence

from hero_node.files import Calibrations, KeptCalibration

KEYS = {
    "motors": "motor_centers_us",
    "velocity": "velocity_gains",
    "infrared": "infrared_counts_m2",
    "wheels": "wheels_m",
}
"""Parts of a calibration, each with the key that a file holds after it."""

WORSE = 2.0
"""A result that exceeds the median of all robots by this factor is worse than the rest."""


class Quality(NamedTuple):
    """Errors that are left: of velocity, as a share; of ranges, m. None where they are not known."""

    velocity: Optional[float]
    range_m: Optional[float]


def rate(kept: KeptCalibration) -> Quality:
    """Return how good a calibration is."""
    velocity = kept.values.get("velocity_errors", [math.nan, math.nan])[1]
    ranges = [abs(error_m) for error_m in kept.values.get("range_errors_after_m", []) if not math.isnan(error_m)]
    return Quality(None if math.isnan(velocity) else velocity, max(ranges, default=None))


def find_missing(found: Dict[str, KeptCalibration], robot_ids: Sequence[int], parts: Sequence[str]) -> List[int]:
    """Return the robots that lack a part."""
    kept = {number: found.get("hero_%d" % number) for number in robot_ids}
    return [
        number for number, one in kept.items() if one is None or any(KEYS[part] not in one.values for part in parts)
    ]


def describe_status(calibrations: Calibrations) -> List[str]:
    """Return a table of all robots with a file, and a line for each file that cannot be used."""
    found = sorted(calibrations.found.values(), key=lambda kept: kept.robot_id)
    qualities = [rate(kept) for kept in found]
    limits = [_find_limit([quality[index] for quality in qualities]) for index in range(len(Quality._fields))]
    lines = ["%-10s %-20s %-34s %-9s %s" % ("ROBOT", "DATE", "PARTS", "VELOCITY", "RANGE")]
    for kept, quality in zip(found, qualities):
        parts = ", ".join(part for part, key in KEYS.items() if key in kept.values) or "none"
        velocity = "-" if quality.velocity is None else f"{100 * quality.velocity:.1f} %"
        range_text = "-" if quality.range_m is None else f"{1000 * quality.range_m:.0f} mm"
        is_worse = any(value is not None and value > limit for value, limit in zip(quality, limits))
        line = "%-10s %-20s %-34s %-9s %-6s" % ("hero_%d" % kept.robot_id, kept.date, parts, velocity, range_text)
        lines.append((line + (" worse than the rest" if is_worse else "")).rstrip())
    return lines + [f"{name}: {problem}" for name, problem in sorted(calibrations.problems.items())]


def _find_limit(values: Sequence[Optional[float]]) -> float:
    known = [value for value in values if value is not None]
    return WORSE * median(known) if len(known) > 2 else math.inf
