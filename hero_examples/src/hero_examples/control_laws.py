"""What a robot sees and wants -> how fast it drives and turns: pure functions, no clock, no ROS, no memory of their own.

Units: metres, radians, seconds. Angles are counter-clockwise, 0 is straight ahead. Ranges are measured from the
robot's centre, start straight ahead and go round counter-clockwise; inf is nothing in range, 0 too close to
measure, nan not known. What is not known counts as an obstacle.
"""

import math
from typing import NamedTuple, Sequence, Tuple


class Pose(NamedTuple):
    """A place and a heading in the plane."""

    x_m: float
    y_m: float
    yaw_rad: float


class Command(NamedTuple):
    """What a robot is told: speed ahead and turn to the left."""

    linear_m_s: float
    turn_rad_s: float


STANDSTILL = Command(0.0, 0.0)


def wrap_angle(angle_rad: float) -> float:
    """Return the same direction within -pi..pi."""
    return math.remainder(angle_rad, 2.0 * math.pi)


def clamp(value: float, limit: float) -> float:
    """Return value cut to -limit..limit."""
    return max(-limit, min(limit, value))


# ---------------------------------------------------------------------------------------------- wandering


class WanderLaw(NamedTuple):
    """How a robot wanders. The distances suit beams that see about 0.24 m and come 5 times a second."""

    cruise_m_s: float = 0.10
    turn_rad_s: float = 1.5
    """Turn on the spot, away from an obstacle."""
    drift_rad_s: float = 0.6
    """Largest turn while the way is free: makes the walk random."""
    stop_m: float = 0.10
    """Nearer than this in a front sector: no way ahead (the body ends at 0.037 m)."""
    free_m: float = 0.14
    """A turn on the spot goes on until all front sectors see further than this."""
    slow_m: float = 0.20
    """From here on the robot slows down and bends away."""


class WanderMemory(NamedTuple):
    """What a wandering robot keeps from one step to the next."""

    escape_sign: int = 0
    """+1 or -1 while it turns on the spot, to the left or right; 0 while it walks."""
    drift_rad_s: float = 0.0


def split_sectors(ranges: Sequence[float]) -> Tuple[float, float, float]:
    """Return the nearest range in the left, front and right sector, nan counted as 0.

    With eight beams each sector is one beam: 45 degrees to the left, straight ahead, 45 degrees to the right.
    """
    count = len(ranges)
    sectors = [math.inf, math.inf, math.inf]
    for index, range_m in enumerate(ranges):
        bearing_rad = wrap_angle(index * 2.0 * math.pi / count)
        if abs(bearing_rad) > 1.2:  # 67.5 degrees with a margin for rounding: beams to the side are not in the way
            continue
        sector = 1 if abs(bearing_rad) < 0.39 else (0 if bearing_rad > 0.0 else 2)
        sectors[sector] = min(sectors[sector], 0.0 if math.isnan(range_m) else range_m)
    return sectors[0], sectors[1], sectors[2]


def wander(
    ranges: Sequence[float], memory: WanderMemory, chance: float, law: WanderLaw = WanderLaw()
) -> Tuple[Command, WanderMemory]:
    """Return the next command of a random walk with obstacle avoidance, and what to remember for the next call.

    Three-sector rule: free sectors, walk on with a random drift; something near, slow down and bend away from the
    nearer side; something too near, turn on the spot until all three sectors are free, and never change the side
    meanwhile (else a corner holds the robot for ever). No ranges at all: stand still.

    ranges: see the module. chance: a random number 0..1 that the caller draws for this step.
    """
    if not ranges:
        return STANDSTILL, WanderMemory()
    left_m, front_m, right_m = split_sectors(ranges)
    nearest_m = min(left_m, front_m, right_m)
    escape_sign = memory.escape_sign
    if nearest_m < (law.free_m if escape_sign else law.stop_m):
        if not escape_sign:
            if left_m == right_m:
                escape_sign = 1 if chance < 0.5 else -1
            else:
                escape_sign = 1 if left_m > right_m else -1
        return Command(0.0, escape_sign * law.turn_rad_s), WanderMemory(escape_sign, 0.0)
    # The drift is a random walk itself that is pulled back to zero, so that arcs last some seconds.
    drift_rad_s = clamp(0.95 * memory.drift_rad_s + (chance - 0.5) * law.drift_rad_s, law.drift_rad_s)
    if nearest_m >= law.slow_m:
        return Command(law.cruise_m_s, drift_rad_s), WanderMemory(0, drift_rad_s)
    nearness = (law.slow_m - nearest_m) / (law.slow_m - law.stop_m)
    if left_m == right_m:
        away_sign = 1 if drift_rad_s >= 0.0 else -1
    else:
        away_sign = 1 if left_m > right_m else -1
    speed_m_s = law.cruise_m_s * max(0.2, 1.0 - nearness)
    turn_rad_s = away_sign * nearness * law.turn_rad_s
    return Command(speed_m_s, turn_rad_s), WanderMemory(0, away_sign * abs(drift_rad_s))
