"""Constants of every HeRo robot, and those of its models; source: the firmware's config.h and RangeSensor.ino."""

from typing import NamedTuple

BODY_RADIUS_M = 0.036835
"""The firmware adds it to what its infrared sensors measure, so ranges count from the robot's center."""

MIN_RANGE_M = BODY_RADIUS_M + 0.01
"""Nearer than this to the robot's center, the sensors cannot measure (too close)."""

MAX_LINEAR_M_S = 0.20
"""The firmware clamps linear.x to this."""

MAX_ANGULAR_RAD_S = 8.0
"""The firmware clamps angular.z to this."""

MAX_WHEEL_M_S = 0.25
"""At the 250 us to which the firmware limits a servo: the robot's published top speed."""

WHEEL_SEPARATION_M = 0.063


class RobotModel(NamedTuple):
    """Dimensions of a model of robots."""

    body_radius_m: float
    wheel_separation_m: float


HERO = RobotModel(BODY_RADIUS_M, WHEEL_SEPARATION_M)
MODELS = {"hero": HERO, "hero_plus": RobotModel(body_radius_m=0.060, wheel_separation_m=0.065)}
"""By the names that drivers report. HeRo+ (github.com/varunraveendra/hero_plus) has a bump shield around its body."""
