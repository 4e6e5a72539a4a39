"""Models of the robot: what their wheels measure, and by what the driver tells them apart. Pure.

HeRo+ (github.com/varunraveendra/hero_plus) has encoders on the wheels instead of the gears, an Encoder message with
one field more, a distance sensor on the hat, and a bump shield. Its firmware logs the version of the stock one.
"""

from ..robot_constants import TICKS_PER_TURN
from .tick_odometry import WheelGeometry

STOCK = "hero"
HERO_PLUS = "hero_plus"

PLUS_WHEELS = WheelGeometry(wheel_diameter_m=0.050, wheel_separation_m=0.065, ticks_per_turn=TICKS_PER_TURN / 3.0)
"""The firmware's config.h divides the circumference by 96."""

PLUS_ENCODER_MD5 = "ec5c02e99365233af779a0f9f54cb0df"
"""Of HeRo+'s Encoder message."""
