"""The robots' numbers are those of the page that users read, for each model."""

import math
import re
from pathlib import Path

import pytest

from hero_node import robot_constants
from hero_node.robot_constants import (
    BEAM_NAMES,
    BEAMS,
    BODY_RADIUS_M,
    HERO,
    MAX_RIM_RANGE_M,
    MIN_RANGE_M,
    MODELS,
    STOCK_BEAMS,
    TICK_M,
    TICKS_PER_TURN,
    RobotModel,
)

DOCS = Path(__file__).resolve().parents[3] / "docs"
PAGE = " ".join((DOCS / "robot_interface.md").read_text(encoding="utf-8").split())
NUMBERS = {"Half": 0.5}


def find_numbers(pattern):
    """Return the numbers of a sentence that the page holds once."""
    (found,) = re.finditer(pattern, PAGE)
    return [float(NUMBERS.get(text, text)) for text in found.groups()]


def test_models_have_the_dimensions_of_the_page():
    pairs_mm = r"([\d.]+), (\d+) mm \| ([\d.]+), (\d+) mm"
    *stock_mm, plus_diameter_mm, plus_separation_mm = find_numbers(r"\| wheel diameter, separation \| " + pairs_mm)
    stock_radius_mm, plus_radius_mm = find_numbers(r"\| body radius \| ([\d.]+) mm \| (\d+) mm")
    dimensions_mm = {
        "hero": (stock_radius_mm, stock_mm[1], stock_mm[0]),
        "hero_plus": (plus_radius_mm, plus_separation_mm, plus_diameter_mm),
    }
    assert set(MODELS) == set(dimensions_mm) and MODELS["hero"] is HERO and RobotModel() == HERO
    for name, expected_mm in dimensions_mm.items():
        assert [1e3 * part_m for part_m in MODELS[name]] == pytest.approx(expected_mm, abs=0.05)


def test_a_tick_is_its_share_of_a_turn_of_the_wheel():
    ticks, _ = find_numbers(r"\| encoder ticks per turn \| (\d+) \| (\d+)")
    assert ticks == TICKS_PER_TURN
    assert pytest.approx(TICK_M * ticks, rel=1e-12) == math.pi * HERO.wheel_diameter_m


def test_ranges_count_from_the_center_of_the_robot():
    farthest_m, nearest_m = find_numbers(r"\(([\d.]+) m\); `-Inf`: too close \(([\d.]+) m\)")
    assert pytest.approx(farthest_m, abs=1e-4) == BODY_RADIUS_M + MAX_RIM_RANGE_M
    assert pytest.approx(nearest_m, abs=1e-4) == MIN_RANGE_M
    share, beams = find_numbers(r"(Half) of the (\d+) ranges of `laser` are averages")
    assert (beams, share * beams) == (STOCK_BEAMS, BEAMS) and len(set(BEAM_NAMES)) == BEAMS


def test_limits_of_motion_are_those_of_the_page():
    (linear_m_s,) = find_numbers(r"linear\.x -0\.20\.\.([\d.]+) m/s")
    (angular_rad_s,) = find_numbers(r"angular\.z -8\.\.([\d.]+) rad/s")
    (watchdog_s,) = find_numbers(r"\| the same \| stops after (\d+) s")
    limits = robot_constants.MAX_LINEAR_M_S, robot_constants.MAX_ANGULAR_RAD_S, robot_constants.MAX_WATCHDOG_S
    assert limits == (linear_m_s, angular_rad_s, watchdog_s)
