"""What a robot sees and wants -> how fast it drives and turns: pure functions, no clock, no ROS, no memory.

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


WANDER = WanderLaw()


HALT_STEPS = 2
"""At 10 Hz: the robot takes about 0.5 s to come down to a lower speed, but 0.15 s to stop when told to stand."""


class WanderMemory(NamedTuple):
    """What a wandering robot keeps from one step to the next."""

    escape_sign: int = 0
    """+1 or -1 while it turns on the spot, to the left or right; 0 while it walks."""
    halt_steps: int = 0
    """Steps for which it still stands before it turns on the spot."""
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
    ranges: Sequence[float], memory: WanderMemory, chance: float, law: WanderLaw = WANDER
) -> Tuple[Command, WanderMemory]:
    """Return the next command of a random walk with obstacle avoidance, and what to remember for the next call.

    Three-sector rule: free sectors, walk on with a random drift; something near, slow down and bend away from the
    nearer side; something too near, halt, then turn on the spot until all three sectors are free, and never change
    the side meanwhile (else a corner holds the robot for ever). No ranges at all: stand still.

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
            return STANDSTILL, WanderMemory(escape_sign, HALT_STEPS - 1)
        if memory.halt_steps:
            return STANDSTILL, WanderMemory(escape_sign, memory.halt_steps - 1)
        return Command(0.0, escape_sign * law.turn_rad_s), WanderMemory(escape_sign)
    # The drift is a random walk itself that is pulled back to zero, so that arcs last some seconds.
    drift_rad_s = clamp(0.95 * memory.drift_rad_s + (chance - 0.5) * law.drift_rad_s, law.drift_rad_s)
    if nearest_m >= law.slow_m:
        return Command(law.cruise_m_s, drift_rad_s), WanderMemory(drift_rad_s=drift_rad_s)
    nearness = (law.slow_m - nearest_m) / (law.slow_m - law.stop_m)
    if left_m == right_m:
        away_sign = 1 if drift_rad_s >= 0.0 else -1
    else:
        away_sign = 1 if left_m > right_m else -1
    speed_m_s = law.cruise_m_s * max(0.2, 1.0 - nearness)
    turn_rad_s = away_sign * nearness * law.turn_rad_s
    return Command(speed_m_s, turn_rad_s), WanderMemory(drift_rad_s=away_sign * abs(drift_rad_s))


class PotentialLaw(NamedTuple):
    """How a robot wanders in a potential field."""

    cruise_m_s: float = 0.10
    turn_rad_s: float = 2.0
    """Largest turn."""
    turn_gain: float = 2.5
    """Turn in rad/s per rad between the heading and the way the field points."""
    influence_m: float = 0.22
    """Obstacles nearer than this push."""
    body_m: float = 0.05
    """At this range the push of one beam is `push` times the pull ahead."""
    push: float = 3.0
    drift_rad: float = 0.5
    """Largest angle between the pull and straight ahead: makes the walk random."""


POTENTIAL = PotentialLaw()


def wander_in_potential(
    ranges: Sequence[float], memory: WanderMemory, chance: float, law: PotentialLaw = POTENTIAL
) -> Tuple[Command, WanderMemory]:
    """Return the next command of a random walk down a potential field, and what to remember: see wander().

    A constant force pulls ahead, a little to one side, and every beam that sees something pushes away from it, the
    harder the nearer. The robot turns towards the sum, and drives the faster the better it points that way.
    Source: O. Khatib, Real-time obstacle avoidance for manipulators and mobile robots, 1986.
    """
    if not ranges:
        return STANDSTILL, WanderMemory()
    drift_rad = clamp(0.95 * memory.drift_rad_s + (chance - 0.5) * law.drift_rad, law.drift_rad)
    force_x, force_y = math.cos(drift_rad), math.sin(drift_rad)
    for index, range_m in enumerate(ranges):
        known_m = 0.0 if math.isnan(range_m) else range_m
        if known_m < law.influence_m:
            nearness = min(1.0, (law.influence_m - known_m) / (law.influence_m - law.body_m))
            bearing_rad = index * 2.0 * math.pi / len(ranges)
            force_x -= law.push * nearness**2 * math.cos(bearing_rad)
            force_y -= law.push * nearness**2 * math.sin(bearing_rad)
    towards_rad = math.atan2(force_y, force_x)
    escape_sign = 0
    if abs(towards_rad) > math.pi / 2.0:
        # The way is behind. Straight behind, left and right are equal: keep the side that was begun.
        escape_sign = memory.escape_sign or (1 if towards_rad > 0.0 else -1)
        if not memory.escape_sign:
            return STANDSTILL, WanderMemory(escape_sign, drift_rad_s=drift_rad)
        return Command(0.0, escape_sign * law.turn_rad_s), WanderMemory(escape_sign, drift_rad_s=drift_rad)
    speed_m_s = law.cruise_m_s * max(0.0, math.cos(towards_rad)) * min(1.0, math.hypot(force_x, force_y))
    command = Command(speed_m_s, clamp(law.turn_gain * towards_rad, law.turn_rad_s))
    return command, WanderMemory(escape_sign, drift_rad_s=drift_rad)


# ---------------------------------------------------------------------------------------------- going somewhere


class GoToLaw(NamedTuple):
    """How a robot goes to a point. The values are those of the tutorial: slow and sure."""

    linear_gain: float = 4.0 / 20.0
    """kr: speed in m/s per metre of distance, 1/s."""
    turn_gain: float = 8.0 / 20.0
    """ka: turn in rad/s per radian off the way, 1/s."""
    max_linear_m_s: float = 0.07
    max_turn_rad_s: float = 0.1
    tolerance_m: float = 0.01
    """Nearer than this the robot has arrived."""


TUTORIAL = GoToLaw()


BRISK = GoToLaw(linear_gain=0.8, turn_gain=1.5, max_linear_m_s=0.12, max_turn_rad_s=1.5)
"""As quick as the robot's speed controller (0.5 s to a new speed) follows without swinging."""


def go_to_point(pose: Pose, x_m: float, y_m: float, law: GoToLaw = TUTORIAL) -> Command:
    """Return the command that brings a robot at pose nearer to the point; a standstill where it has arrived.

    Unicycle law: v = kr * distance * cos(a), w = ka * a with a the angle from the heading to the goal. A goal behind
    is approached backwards (a is then measured from the back). pose and point are in the same frame.
    """
    distance_m = math.hypot(x_m - pose.x_m, y_m - pose.y_m)
    if distance_m < law.tolerance_m:
        return STANDSTILL
    off_rad = wrap_angle(math.atan2(y_m - pose.y_m, x_m - pose.x_m) - pose.yaw_rad)
    linear_m_s = clamp(law.linear_gain * distance_m * math.cos(off_rad), law.max_linear_m_s)
    if abs(off_rad) > math.pi / 2.0:
        off_rad = wrap_angle(off_rad + math.pi)
    return Command(linear_m_s, clamp(law.turn_gain * off_rad, law.max_turn_rad_s))


class GoToPoseLaw(NamedTuple):
    """How a robot goes to a point and ends with a heading."""

    k1: float = 1.0
    """How early the robot bends towards the final heading."""
    k2: float = 2.0
    """How fast it comes onto that curve, against how fast it drives."""
    slowing_m2: float = 0.003
    """beta: how much it slows down in curves: to half where the curve has a radius of sqrt(beta)."""
    linear_gain: float = 0.8
    """Speed in m/s per metre of distance near the goal, 1/s."""
    max_linear_m_s: float = 0.12
    max_turn_rad_s: float = 1.5
    heading_gain: float = 1.5
    """Turn at the goal in rad/s per radian, 1/s."""
    docking_m: float = 0.03
    """Nearer than this straight to the place: the curve would be too tight for motors that lag 0.5 s."""
    tolerance_m: float = 0.01
    tolerance_rad: float = 0.05


SMOOTH = GoToPoseLaw()


def go_to_pose(pose: Pose, goal: Pose, law: GoToPoseLaw = SMOOTH, at_goal: bool = False) -> Command:
    """Return the command of a smooth curve to goal that ends in its heading; a standstill where it is reached.

    at_goal: the place was reached already; only the heading counts, so that a millimetre of drift during the last
    turn does not start a new approach. pose and goal are in the same frame.
    Source: J. J. Park, B. Kuipers, A smooth control law for graceful motion of differential wheeled mobile robots
    in 2D environment, ICRA 2011, equations 13 to 15.
    """
    distance_m = math.hypot(goal.x_m - pose.x_m, goal.y_m - pose.y_m)
    if at_goal or distance_m < law.tolerance_m:
        off_rad = wrap_angle(goal.yaw_rad - pose.yaw_rad)
        if abs(off_rad) < law.tolerance_rad:
            return STANDSTILL
        return Command(0.0, clamp(law.heading_gain * off_rad, law.max_turn_rad_s))
    if distance_m < law.docking_m:
        docking = GoToLaw(
            law.linear_gain, law.heading_gain, law.max_linear_m_s, law.max_turn_rad_s, law.tolerance_m
        )
        return go_to_point(pose, goal.x_m, goal.y_m, docking)
    sight_rad = math.atan2(goal.y_m - pose.y_m, goal.x_m - pose.x_m)
    goal_off_rad = wrap_angle(goal.yaw_rad - sight_rad)  # theta of the paper
    own_off_rad = wrap_angle(pose.yaw_rad - sight_rad)  # delta of the paper
    curvature_1_m = -(
        law.k2 * (own_off_rad - math.atan(-law.k1 * goal_off_rad))
        + (1.0 + law.k1 / (1.0 + (law.k1 * goal_off_rad) ** 2)) * math.sin(own_off_rad)
    ) / distance_m
    linear_m_s = law.max_linear_m_s / (1.0 + law.slowing_m2 * curvature_1_m**2)
    linear_m_s = min(linear_m_s, law.linear_gain * distance_m)
    turn_rad_s = curvature_1_m * linear_m_s
    if abs(turn_rad_s) > law.max_turn_rad_s:  # the curve stays the same, only slower
        linear_m_s *= law.max_turn_rad_s / abs(turn_rad_s)
        turn_rad_s = math.copysign(law.max_turn_rad_s, turn_rad_s)
    return Command(linear_m_s, turn_rad_s)


class DetourLaw(NamedTuple):
    """How a robot goes around what its sensors see on the way."""

    influence_m: float = 0.18
    """Obstacles nearer than this push."""
    body_m: float = 0.05
    """At this range one beam pushes `push` times as hard as the goal pulls."""
    push: float = 1.5
    swirl: float = 1.2
    """Share of the push that acts sideways, so that the robot slides along a wall and does not stop before it."""
    turn_gain: float = 2.0
    max_linear_m_s: float = 0.08
    max_turn_rad_s: float = 2.0


DETOUR = DetourLaw()


def bend_around(
    command: Command,
    bearing_rad: float,
    distance_m: float,
    ranges: Sequence[float],
    side: int = 0,
    law: DetourLaw = DETOUR,
) -> Tuple[Command, int]:
    """Return (command, 0), or what goes around an obstacle nearer than both the goal and law.influence_m, and a side.

    bearing_rad, distance_m: of the goal, from the robot. Obstacles push away, and along themselves to one side: +1
    passes them on their left, -1 on their right, 0 chooses the side on which the goal is. The caller gives the side
    back until the way is free, or the robot would change its mind in front of the middle of a thing.
    """
    seen = [
        (index * 2.0 * math.pi / len(ranges), 0.0 if math.isnan(range_m) else range_m)
        for index, range_m in enumerate(ranges)
    ]
    near = [(angle_rad, range_m) for angle_rad, range_m in seen if range_m < min(law.influence_m, distance_m)]
    near = [item for item in near if abs(wrap_angle(item[0] - bearing_rad)) < math.radians(100.0)]
    if not near:
        return command, 0
    if not side:
        side = 1 if wrap_angle(bearing_rad - min(near, key=lambda item: item[1])[0]) >= 0.0 else -1
    force_x, force_y = math.cos(bearing_rad), math.sin(bearing_rad)
    for angle_rad, range_m in near:
        strength = law.push * min(1.0, (law.influence_m - range_m) / (law.influence_m - law.body_m)) ** 2
        force_x -= strength * (math.cos(angle_rad) + side * law.swirl * math.sin(angle_rad))
        force_y -= strength * (math.sin(angle_rad) - side * law.swirl * math.cos(angle_rad))
    towards_rad = math.atan2(force_y, force_x)
    turn_rad_s = clamp(law.turn_gain * towards_rad, law.max_turn_rad_s)
    # Sensors and eyes are ahead: a detour is never driven backwards.
    speed_m_s = law.max_linear_m_s * max(0.0, math.cos(towards_rad)) * min(1.0, math.hypot(force_x, force_y))
    if split_sectors(ranges)[1] < law.body_m + 0.02:
        speed_m_s = 0.0
    return Command(speed_m_s, turn_rad_s), side


class FollowLaw(NamedTuple):
    """How a robot keeps behind another one."""

    gap_m: float = 0.15
    """Between the centres; two bodies touch at 0.074 m."""
    linear_gain: float = 1.0
    turn_gain: float = 2.0
    max_linear_m_s: float = 0.15
    max_turn_rad_s: float = 2.0


FOLLOW = FollowLaw()


def follow(pose: Pose, leader: Pose, law: FollowLaw = FOLLOW) -> Command:
    """Return the command that keeps a robot at pose one gap away from leader and turned towards it.

    It never drives backwards: a leader that comes nearer is waited for. pose and leader are in the same frame.
    """
    distance_m = math.hypot(leader.x_m - pose.x_m, leader.y_m - pose.y_m)
    off_rad = wrap_angle(math.atan2(leader.y_m - pose.y_m, leader.x_m - pose.x_m) - pose.yaw_rad)
    linear_m_s = max(0.0, law.linear_gain * (distance_m - law.gap_m)) * max(0.0, math.cos(off_rad))
    return Command(
        min(law.max_linear_m_s, linear_m_s), clamp(law.turn_gain * off_rad, law.max_turn_rad_s)
    )
