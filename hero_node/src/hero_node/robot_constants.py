"""Dimensions, limits and times of the HeRo, its firmware and its models, each once, with its source. Pure."""

import math
from typing import NamedTuple

BODY_RADIUS_M = 0.036835
"""The firmware adds it to what its infrared sensors measure (RangeSensor.ino:66): ranges count from the center."""

WHEEL_DIAMETER_M = 0.0492
WHEEL_SEPARATION_M = 0.063
TICKS_PER_TURN = 288.0
"""Encoder ticks per turn of a wheel."""

TICK_M = math.pi * WHEEL_DIAMETER_M / TICKS_PER_TURN
"""Travel of a wheel's rim per encoder tick, about 0.537 mm."""

MAX_LINEAR_M_S = 0.20
MAX_ANGULAR_RAD_S = 8.0
"""The firmware clamps linear.x and angular.z of a Twist to these (config.h)."""

MAX_WHEEL_M_S = 0.25
"""At the 250 us to which the firmware limits a servo: the robot's published top speed."""

SERVO_CENTER_US = 1500
"""Servo pulse at which a wheel stops, up to the servo's own center."""

PULSE_RANGE_US = (1000, 2000)
"""Shortest and longest servo pulse."""

MAX_WATCHDOG_S = 4.0
"""After this time without a command the robot stops by itself (PositionControl.ino:105, MotorDriver.ino:111)."""

MIN_RIM_RANGE_M = 0.01
"""The firmware's clamp, from the body's rim (RangeSensor.ino:123)."""

MIN_RANGE_M = BODY_RADIUS_M + MIN_RIM_RANGE_M
"""Nearer than this to the robot's center, the sensors cannot measure (too close)."""

MAX_RIM_RANGE_M = 0.20
"""The firmware's range_max, from the body's rim; ranges beyond it stand for nothing in range."""

BEAM_NAMES = ("rear", "rear right", "right", "front right", "front", "front left", "left", "rear left")
"""The infrared sensors, counter-clockwise from the rear."""

BEAMS = len(BEAM_NAMES)
STOCK_BEAMS = 16
"""Ranges of a stock laser message; the odd ones are averages."""

SCAN_TIME_S = 0.2
"""RangeSensor's rate is 5 Hz; it leaves scan_time zero."""

MIN_DISTANCE_M = 0.04
MAX_DISTANCE_M = 2.9
"""Range of HeRo+'s VL53L1X in its medium mode, in the dark (data sheet)."""

DISTANCE_CONE_RAD = 0.26
"""Its field of view with the 4 x 4 detectors that the firmware uses (15 degrees, ST UM2555)."""


class RobotModel(NamedTuple):
    """Dimensions of a model of robots."""

    body_radius_m: float = BODY_RADIUS_M
    wheel_separation_m: float = WHEEL_SEPARATION_M
    wheel_diameter_m: float = WHEEL_DIAMETER_M


HERO = RobotModel()
MODELS = {"hero": HERO, "hero_plus": RobotModel(body_radius_m=0.060, wheel_separation_m=0.065, wheel_diameter_m=0.050)}
"""By the names that drivers report. HeRo+ (github.com/varunraveendra/hero_plus) has a bump shield around its body."""
