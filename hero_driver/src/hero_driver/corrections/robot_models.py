"""Models of the robot: what their wheels measure, and by what the driver tells them apart. Pure.

HeRo+ (github.com/varunraveendra/hero_plus) has encoders on the wheels instead of the gears, an Encoder message with
one field more, a distance sensor on the hat, and a bump shield. Its firmware logs the version of the stock one.
"""

from typing import AbstractSet

from hero_node.files import STOCK

from ..robot_constants import TICKS_PER_TURN
from .tick_odometry import WheelGeometry

PLUS_WHEELS = WheelGeometry(wheel_diameter_m=0.050, wheel_separation_m=0.065, ticks_per_turn=TICKS_PER_TURN / 3.0)
"""The firmware's config.h divides the circumference by 96."""

PLUS_ENCODER_MD5 = "ec5c02e99365233af779a0f9f54cb0df"
"""Checksum of HeRo+'s Encoder message."""

IMU, DISTANCE = "/imu", "/distance"
"""Topics below a robot's namespace that only one of the models declares."""


def describe_conflict(
    model: str, former_model: str, calibrated_model: str, is_listed: bool, topics: AbstractSet[str]
) -> str:
    """Return what contradicts that a robot is of this model, with a remedy, for users; empty if nothing does.

    former_model: before it declared its Encoder message anew. calibrated_model: in its calibration file; empty if
    there is none. is_listed: HeRo+ by ~hero_plus, not by its Encoder message. topics: IMU, DISTANCE, as declared.
    """
    if former_model != model:
        text = "it was a %s and is a %s now, by whose wheels its odometry goes on: two robots need two ids"
        return text % (former_model, model)
    if calibrated_model not in ("", model):
        text = "it is a %s, but its calibration file says %s, whose wheels are not used: calibrate it again"
        return text % (model, calibrated_model)
    if is_listed and IMU in topics:
        return (
            "~hero_plus lists it, but it declares an IMU, as stock robots do, whose odometry would be three times too"
            " long: take it off the list unless its encoders are those of HeRo+"
        )
    if model == STOCK and DISTANCE in topics:
        return (
            "it declares the distance sensor of HeRo+ but the Encoder message of stock robots: if its encoders are"
            " those of HeRo+, its odometry is too short by two thirds; list it in ~hero_plus"
        )
    return ""
