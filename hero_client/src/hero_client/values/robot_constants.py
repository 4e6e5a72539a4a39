"""Constants of every HeRo robot; source: the firmware's config.h and RangeSensor.ino."""

__all__ = ["BODY_RADIUS_M", "MAX_ANGULAR_RAD_S", "MAX_LINEAR_M_S", "MIN_RANGE_M", "WHEEL_SEPARATION_M"]

BODY_RADIUS_M = 0.036835
"""The firmware adds it to what its infrared sensors measure, so ranges count from the robot's center."""

MIN_RANGE_M = BODY_RADIUS_M + 0.01
"""Nearer than this to the robot's center, the sensors cannot measure (too close)."""

MAX_LINEAR_M_S = 0.20
"""The firmware clamps linear.x to this."""

MAX_ANGULAR_RAD_S = 8.0
"""The firmware clamps angular.z to this."""

WHEEL_SEPARATION_M = 0.063
