"""Obstacle avoidance by the proximity sensors: pure functions from ranges to a command.

Ranges of eight beams in m from the robot's center, the front first, counter-clockwise, or none; inf: nothing in range,
0: too close to measure, nan: not known, which counts as an obstacle.
"""

import math
from typing import List, NamedTuple, Optional, Sequence, Tuple

from hero_node import STOP, Velocity, clamp, wrap_angle
from hero_node.robot_constants import BODY_RADIUS_M, MIN_RANGE_M

from ..values.readings import Obstacle


def shorten_for_body(ranges: Sequence[float], body_radius_m: float) -> List[float]:
    """Return ranges at which the laws, made for the stock body, keep a robot with another body as far away."""
    return [range_m - (body_radius_m - BODY_RADIUS_M) for range_m in ranges]


def split_sectors(ranges: Sequence[float]) -> Tuple[float, float, float]:
    """Return the ranges of the left, front and right sector, nan counted as 0: beams at 45, 0 and -45 degrees."""
    left_m, front_m, right_m = (0.0 if math.isnan(ranges[index]) else ranges[index] for index in (1, 0, -1))
    return left_m, front_m, right_m


def find_in_path(ranges: Sequence[float], backward: bool = False) -> Tuple[float, Optional[Obstacle]]:
    """Return how far, m, the body can drive straight on, or backward, and the obstacle that it would touch there.

    (inf, None) if there is none; (nan, None) if none is seen, but not every sensor on that side tells.
    """
    free_m, nearest, is_known = math.inf, None, len(ranges) > 0
    for index, range_m in enumerate(ranges):
        bearing_rad = wrap_angle(index * math.tau / len(ranges))
        off_rad = wrap_angle(bearing_rad - math.pi) if backward else bearing_rad
        if abs(off_rad) >= math.pi / 2.0:
            continue
        if not math.isfinite(range_m):
            is_known = is_known and not math.isnan(range_m)
            continue
        known_m = max(range_m, MIN_RANGE_M)
        aside_m = known_m * abs(math.sin(off_rad))
        if aside_m >= BODY_RADIUS_M:
            continue
        touch_m = known_m * math.cos(off_rad) - math.sqrt(BODY_RADIUS_M**2 - aside_m**2)
        if touch_m < free_m:
            free_m, nearest = touch_m, Obstacle(range_m, bearing_rad)
    return (free_m, nearest) if nearest or is_known else (math.nan, None)


class WanderLaw(NamedTuple):
    """Settings of wandering. The distances suit beams that see about 0.24 m and come 5 times a second."""

    cruise_m_s: float = 0.10
    angular_rad_s: float = 1.5
    """Turn on the spot, away from an obstacle."""
    drift_rad_s: float = 0.6
    """Largest turn on a free path: makes the walk random."""
    stop_m: float = 0.10
    """Nearer than this in a front sector: blocked (the body ends at 0.037 m)."""
    free_m: float = 0.14
    """A turn on the spot continues until all front sectors see further than this."""
    slow_m: float = 0.20
    """Distance to an obstacle from which on the robot slows down and bends away."""


WANDER = WanderLaw()

STOP_STEPS = 2
"""At 10 Hz: the robot takes about 0.5 s to slow down to a lower speed, but 0.15 s to stop."""


class WanderMemory(NamedTuple):
    """State of a wandering robot between steps."""

    escape_sign: int = 0
    """+1 or -1 while it turns on the spot, to the left or right; 0 while it walks."""
    stop_steps: int = 0
    """Steps for which it is still stopped before it turns on the spot."""
    drift_rad_s: float = 0.0


def wander(
    ranges: Sequence[float], memory: WanderMemory, chance: float, law: WanderLaw = WANDER
) -> Tuple[Velocity, WanderMemory]:
    """Return the next command of a random walk with obstacle avoidance, and what to remember for the next call.

    Three-sector rule: free sectors, walk on with a random drift; something near, slow down and bend away from the
    nearer side; something too near, stop, then turn on the spot until all three sectors are free, and never change
    the side meanwhile (else a corner would trap the robot). No ranges at all: stop.
    ranges: see the module. chance: a random number 0..1 that the caller draws for this step.
    """
    if not ranges:
        return STOP, WanderMemory()
    left_m, front_m, right_m = split_sectors(ranges)
    nearest_m = min(left_m, front_m, right_m)
    escape_sign = memory.escape_sign
    if nearest_m < (law.free_m if escape_sign else law.stop_m):
        if not escape_sign:
            escape_sign = _choose_side(left_m, right_m, 1 if chance < 0.5 else -1)
            return STOP, WanderMemory(escape_sign, STOP_STEPS - 1)
        if memory.stop_steps:
            return STOP, WanderMemory(escape_sign, memory.stop_steps - 1)
        return Velocity(0.0, escape_sign * law.angular_rad_s), WanderMemory(escape_sign)
    # The drift is a random walk itself that is pulled back to zero, so that arcs last some seconds.
    drift_rad_s = clamp(0.95 * memory.drift_rad_s + (chance - 0.5) * law.drift_rad_s, law.drift_rad_s)
    if nearest_m >= law.slow_m:
        return Velocity(law.cruise_m_s, drift_rad_s), WanderMemory(drift_rad_s=drift_rad_s)
    nearness = (law.slow_m - nearest_m) / (law.slow_m - law.stop_m)
    away_sign = _choose_side(left_m, right_m, 1 if drift_rad_s >= 0.0 else -1)
    speed_m_s = law.cruise_m_s * max(0.2, 1.0 - nearness)
    angular_rad_s = away_sign * nearness * law.angular_rad_s
    return Velocity(speed_m_s, angular_rad_s), WanderMemory(drift_rad_s=away_sign * abs(drift_rad_s))


def _choose_side(left_m: float, right_m: float, otherwise: int) -> int:
    return otherwise if left_m == right_m else 1 if left_m > right_m else -1


INFLUENCE_M = 0.18
"""Obstacles nearer than this push."""

BODY_M, PUSH = 0.05, 1.5
"""At this range one beam pushes this many times as hard as the goal pulls."""

SWIRL = 1.2
"""Share of the push that acts sideways, so that the robot slides along a wall and does not stop before it."""

DETOUR_GAIN = 2.0
MAX_DETOUR_M_S, MAX_DETOUR_RAD_S = 0.08, 2.0


def bend_around(
    command: Velocity, bearing_rad: float, distance_m: float, ranges: Sequence[float], side: int = 0
) -> Tuple[Velocity, int]:
    """Return (command, 0), or what goes around an obstacle nearer than both the goal and INFLUENCE_M, and a side.

    bearing_rad, distance_m: of the goal, from the robot. Obstacles push away, and along themselves to one side: +1
    passes them on their left, -1 on their right, 0 chooses the side on which the goal is. The caller gives the side
    back until the path is free; else the robot would alternate in front of an obstacle.
    """
    seen = [
        (index * 2.0 * math.pi / len(ranges), 0.0 if math.isnan(range_m) else range_m)
        for index, range_m in enumerate(ranges)
    ]
    near = [(angle_rad, range_m) for angle_rad, range_m in seen if range_m < min(INFLUENCE_M, distance_m)]
    near = [item for item in near if abs(wrap_angle(item[0] - bearing_rad)) < math.radians(100.0)]
    if not near:
        return command, 0
    if not side:
        side = 1 if wrap_angle(bearing_rad - min(near, key=lambda item: item[1])[0]) >= 0.0 else -1
    force_x, force_y = math.cos(bearing_rad), math.sin(bearing_rad)
    for angle_rad, range_m in near:
        strength = PUSH * min(1.0, (INFLUENCE_M - range_m) / (INFLUENCE_M - BODY_M)) ** 2
        force_x -= strength * (math.cos(angle_rad) + side * SWIRL * math.sin(angle_rad))
        force_y -= strength * (math.sin(angle_rad) - side * SWIRL * math.cos(angle_rad))
    towards_rad = math.atan2(force_y, force_x)
    angular_rad_s = clamp(DETOUR_GAIN * towards_rad, MAX_DETOUR_RAD_S)
    # A detour is never driven backwards.
    speed_m_s = MAX_DETOUR_M_S * max(0.0, math.cos(towards_rad)) * min(1.0, math.hypot(force_x, force_y))
    if split_sectors(ranges)[1] < BODY_M + 0.02:
        speed_m_s = 0.0
    return Velocity(speed_m_s, angular_rad_s), side
