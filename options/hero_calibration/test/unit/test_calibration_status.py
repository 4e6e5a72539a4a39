"""The status of calibrations: when, how good, what is missing, which robots are worse than the rest."""

import math

from hero_calibration.store import describe_status, find_missing, rate
from hero_node.files import Calibrations, KeptCalibration


def make(number, velocity=0.02, ranges=(), **values):
    errors = {"velocity_errors": [0.3, velocity], "range_errors_after_m": list(ranges)}
    return KeptCalibration(number, "2026-11-2%d" % (number % 10), {**errors, **values})


def test_errors_that_are_left_rate_a_calibration():
    assert rate(make(0, 0.02, [0.001, -0.004, math.nan])) == (0.02, 0.004)
    assert rate(make(0, math.nan)) == rate(KeptCalibration(0, "", {})) == (None, None)


def test_robots_that_lack_a_part_are_missing():
    found = {"hero_3": make(3, motor_centers_us=[1500.0, 1500.0]), "hero_4": make(4)}
    assert find_missing(found, [3, 4, 9], ["motors"]) == [4, 9]
    assert find_missing(found, [3, 4, 9], []) == [9]
    assert find_missing(found, [3], ["motors", "wheels"]) == [3]


def test_a_robot_that_is_worse_than_the_rest_is_named():
    found = {"hero_%d" % number: make(number, 0.02 if number < 3 else 0.05) for number in (10, 0, 1, 2, 3)}
    lines = describe_status(Calibrations(found, {"hero_7": "hero_7.yaml: broken"}))
    assert [line.split()[0] for line in lines] == [
        "ROBOT",
        "hero_0",
        "hero_1",
        "hero_2",
        "hero_3",
        "hero_10",
        "hero_7:",
    ]
    assert [line.endswith("worse than the rest") for line in lines] == [False, False, False, False, True, True, False]
    assert "5.0 %" in lines[4] and "none" in lines[1]


def test_two_robots_are_too_few_to_be_compared():
    found = {"hero_0": make(0, 0.02), "hero_1": make(1, 0.5)}
    assert not any("worse" in line for line in describe_status(Calibrations(found, {})))
    assert len(describe_status(Calibrations({}, {}))) == 1
