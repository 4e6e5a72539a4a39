"""Limits are those of the documents: a number that changes in one of them only fails here."""

import re
from pathlib import Path

from hero_driver.commands import command_sources, stop_progress
from hero_driver.commands.stop_progress import READING_S
from hero_driver.commands.velocity_shaper import COMMAND_INTERVAL_S
from hero_driver.corrections import wheel_motion
from hero_driver.corrections.tick_odometry import TWIST_WINDOW
from hero_driver.gateway import STOP_LIMIT_S
from hero_driver.ros import robot_commands, services
from hero_driver.transport import event_loop
from hero_node.robot_constants import BODY_RADIUS_M, MAX_RIM_RANGE_M, MAX_WATCHDOG_S, MIN_RIM_RANGE_M

PACKAGE = Path(__file__).resolve().parents[2]
README, INTERFACE = PACKAGE / "README.md", PACKAGE.parent / "docs" / "robot_interface.md"
NUMBERS = {"a": 1, "four": 4, "five": 5, "six": 6}


def find_limits(page, pattern):
    """Return the numbers of a sentence that a page holds once."""
    (found,) = re.finditer(pattern, " ".join(page.read_text(encoding="utf-8").split()))
    return [float(NUMBERS.get(text, text)) for text in found.groups()]


def test_limits_of_commands_are_those_of_the_documents():
    for page, pattern, limits in (
        (README, r"at least (\d+) ms apart", [1000 * COMMAND_INTERVAL_S]),
        (README, r"if two command a robot within (\w+) second", [robot_commands.SUPERSEDED_S]),
        (README, r"after (\w+) commands, silence", [command_sources.REGULAR_INTERVALS + 1]),
        (README, r"and (\w+) of its periods", [command_sources.SILENT_PERIODS]),
        (README, r"wheels still turn ([\d.]+) s after a zero", [command_sources.ZERO_SHOWS_S]),
        (README, r"was suspended for more than (\d+) s", [event_loop.PAUSE_S]),
        (README, r"or (\d+) s have passed, so that no call", [services.LATE_ANSWER_S]),
        (INTERFACE, r"the same \| stops after (\d+) s", [MAX_WATCHDOG_S]),
    ):
        assert find_limits(page, pattern) == limits, pattern


def test_limits_of_stops_and_sensors_are_those_of_the_documents():
    rest_s, ranges_m = wheel_motion.REST_READINGS * READING_S, (MAX_RIM_RANGE_M, MIN_RIM_RANGE_M)
    for page, pattern, limits in (
        (README, r"gets zeros every (\d+) ms", [1000 * stop_progress.INTERVAL_S]),
        (README, r"in (\w+) readings \(([\d.]+) s\)", [wheel_motion.REST_READINGS, round(rest_s, 2)]),
        (README, r"the wheels turn (\d+) s after the robot", [round(stop_progress.MOVING_READINGS * READING_S)]),
        (README, r"stops all robots for up to (\d+) s", [STOP_LIMIT_S]),
        (README, r"velocity is the mean over (\w+) readings", [TWIST_WINDOW]),
        (
            INTERFACE,
            r"\(([\d.]+) m\); `-Inf`: too close \(([\d.]+) m\)",
            [round(BODY_RADIUS_M + m, 4) for m in ranges_m],
        ),
    ):
        assert find_limits(page, pattern) == limits, pattern
