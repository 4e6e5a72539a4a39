"""The light of a robot: kept lit, not sent for nothing, and dark at the end where it blinked."""

import math

import pytest
from linkless_robot import make_robot

from hero_client.robots.light import MIN_BLINK_PERIOD_S, REPEAT_PERIOD_S
from hero_client.values.colors import COLORS, parse_color

RED, GREEN, OFF = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 0.0)


def test_a_color_is_repeated_and_the_same_one_is_not_sent_again():
    robot, link = make_robot()
    robot.led("red")
    robot.led("red")
    assert link.colors == [(0.0, RED)]
    robot.sleep(2.0 * REPEAT_PERIOD_S + 0.1)
    assert link.colors == [(0.0, RED), (REPEAT_PERIOD_S, RED), (2.0 * REPEAT_PERIOD_S, RED)]
    robot.led("green")
    robot.sleep(REPEAT_PERIOD_S)
    assert link.colors[3:] == [(10.1, GREEN), (15.0, GREEN)]
    link.connected = False
    robot.led("green")
    assert link.colors[5:] == [(15.1, GREEN)], "the robot may have been switched on again"
    robot.close()
    robot.close()
    robot.sleep(20.0)
    assert len(link.colors) == 6 and link.sent == []


def test_a_light_blinks_until_the_next_color_or_the_end():
    robot, link = make_robot()
    robot.led("green")
    robot.blink("red", 1.0)
    robot.sleep(1.6)
    assert link.colors == [(0.0, GREEN), (0.0, RED), (0.5, OFF), (1.0, RED), (1.5, OFF)]
    robot.led("off")
    robot.sleep(4.9)
    assert link.colors[5:] == [(1.6, OFF)], "one that blinked last is sent even if it is the same"
    robot.blink("green", MIN_BLINK_PERIOD_S)
    robot.blink("red", MIN_BLINK_PERIOD_S)
    link.colors.clear()
    robot.close()
    robot.sleep(20.0)
    assert [rgb for _, rgb in link.colors] == [OFF]
    for wrong in (MIN_BLINK_PERIOD_S - 0.01, math.nan):
        with pytest.raises(ValueError, match="a period must be at least 0.2 s"):
            robot.blink("red", wrong)
    for ask in (robot.blink, robot.led):
        with pytest.raises(ValueError, match="no color 'rad'"):
            ask("rad")


def test_colors_are_the_mixtures_that_their_names_say():
    mixed = {}
    for name, parts in zip(COLORS, ("", "r", "g", "b", "rg", "rb", "gb", "rgb")):
        mixed[name] = tuple(float(part in parts) for part in "rgb")
    assert {**mixed, "orange": (1.0, 0.4, 0.0)} == COLORS
    assert list(mixed) == ["off", "red", "green", "blue", "yellow", "magenta", "cyan", "white"]
    assert parse_color([0, 1, 0.5]) == (0.0, 1.0, 0.5)
    for wrong in ((0.0, -0.01, 0.0), (0.0, 0.0, 1.01), (math.nan, 0.0, 0.0), (1.0, 1.0), (1.0,) * 4, "rgb", 3, None):
        with pytest.raises(ValueError, match="color"):
            parse_color(wrong)
