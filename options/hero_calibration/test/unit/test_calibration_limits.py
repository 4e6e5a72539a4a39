"""The numbers on the page about calibration are those of the procedures."""

import math
from pathlib import Path

import pytest

from hero_calibration.models import dead_zone, infrared_model, step_response
from hero_calibration.procedures import motors, wheels

PAGE = (Path(__file__).resolve().parents[4] / "docs" / "calibration.md").read_text(encoding="utf-8")
SIDE_M = wheels.SPEED_M_S * wheels.SIDE_S
COUNT = {6: "six"}


@pytest.mark.parametrize(
    "limit",
    [
        "and one that moves %g cm, by odometry, is stopped" % (100.0 * motors.MAX_MOVE_M),
        "Two pulses, %d and %d us, give an estimate" % dead_zone.AIM_PULSES_US,
        "is swept from -%d to +%d us and back" % (dead_zone.REACH_US, dead_zone.REACH_US),
        "Sweeps that do not agree to %g us are repeated" % dead_zone.AGREE_US,
        "accelerates from rest to %g m/s" % step_response.STEP_M_S,
        "with its current gains, those of an erased flash, and %s sets" % COUNT[step_response.ROUNDS - 1],
        "the lowest mean deviation plus %g of the overshoot" % step_response.OVERSHOOT_WEIGHT,
        "their fronts %g cm from a flat white wall" % (100.0 * infrared_model.WALL_M),
        "misalignment above %g degrees is rejected" % round(math.degrees(infrared_model.MAX_MISALIGNMENT_RAD), 6),
        "a square of %g cm to the left" % round(100.0 * SIDE_M, 6),
        "it drives %g cm straight ahead" % round(100.0 * wheels.SPEED_M_S * wheels.STRAIGHT_S, 6),
    ],
)
def test_limits_are_those_of_the_page(limit):
    assert limit in " ".join(PAGE.split())
