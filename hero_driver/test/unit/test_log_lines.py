"""Log lines of robots: read by the firmware's own texts, and harmless whatever they hold."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.fleet.log_lines import MAX_TEXT_LENGTH, BootLine, clean_text, read_log_line

BOOT = "\x1b[94m[/hero_0] Firmware: v3.8 | Hardware: v2.5 | Config: v2.3 | IP: 127.0.0.1 \x1b[0m"


def test_the_boot_line_tells_the_versions():
    line = read_log_line(BOOT)
    assert line.boot == BootLine("v3.8", "v2.5", "v2.3")
    assert line.uptime_s is None
    assert line.text == "Firmware: v3.8 | Hardware: v2.5 | Config: v2.3 | IP: 127.0.0.1"


def test_the_boot_line_of_a_simulated_robot_names_its_world():
    line = read_log_line(BOOT.replace(" \x1b[0m", " | World: 1a2b \x1b[0m"))
    assert (line.boot, line.world) == (BootLine("v3.8", "v2.5", "v2.3"), "1a2b")
    assert read_log_line(BOOT).world == read_log_line("no boot | World: 1a2b").world == ""


def test_the_boot_line_of_an_older_firmware_has_no_config():
    line = read_log_line("\x1b[94m[/hero_0] Firmware: v3.0 | Hardware: v2.5 | IP: 10.42.0.17 \x1b[0m")
    assert line.boot == BootLine("v3.0", "v2.5", "")


@pytest.mark.parametrize("name", ["[/hero_0] ", "[hero_12] ", ""])
def test_the_heartbeat_tells_the_uptime(name):
    line = read_log_line("\x1b[96m%sConected at time 1638\x1b[0m" % name)
    assert line.uptime_s == 1.638
    assert line.boot is None


def test_the_word_spelled_right_is_a_heartbeat_too():
    assert read_log_line("[/hero_0] Connected at time 4294967295").uptime_s == 4294967.295


@pytest.mark.parametrize(
    "text",
    [
        "[/hero_0] Conected at time",
        "[/hero_0] Conected at time -5",
        "[/hero_0] Conected at time 12 s",
        "[/hero_0] Conected at time 99999999999",
        "[/hero_0] Not Conected at time 12",
        "",
    ],
)
def test_what_only_resembles_a_heartbeat_is_none(text):
    assert read_log_line(text).uptime_s is None


@pytest.mark.parametrize(
    "text, clean",
    [
        ("\x1b[92m[hero_0] IMU hat detected!\x1b[0m", "IMU hat detected!"),
        ("\x1b[91m[hero_0] IMU is not working or not connected! Error: 1\x1b[0m", "no IMU hat, so nothing on imu"),
        ("[HERO] Odometry was changed!", "Odometry was changed!"),
        ("[/hero_0] Reseting PID... now", "Reseting PID... now"),
        ("Left  Motor PID = [1.00, 2.00, 3.00]", "Left  Motor PID = [1.00, 2.00, 3.00]"),
    ],
)
def test_the_firmwares_texts_lose_colors_and_the_name_and_nothing_else(text, clean):
    assert read_log_line(text) == (clean, None, "", None, None, False)


@pytest.mark.parametrize(
    ("text", "is_routine"),
    [
        ("\x1b[93m[/hero_0] Reseting PID...\x1b[0m", True),
        ("\x1b[96m[/hero_0] Conected at time 1638\x1b[0m", True),
        ("[/hero_0] Reseting PID... failed", False),
        ("[/hero_0] IMU is not working", False),
    ],
)
def test_lines_that_come_all_the_time_are_told_from_news(text, is_routine):
    assert read_log_line(text).is_routine is is_routine


def test_a_robot_cannot_forge_a_line_or_move_the_cursor():
    assert clean_text("a\nb\r\nc\td\x00e") == "a b c d e"
    assert clean_text("\x1b[2J\x1b[1;1Hgone\x1b]0;title\x07") == "gone0;title"
    assert clean_text("\x9b31mred\x85line\u2028more") == "31mred line more"
    assert clean_text("\x1b") == ""


def test_a_long_text_is_cut_and_says_so():
    assert clean_text("x" * 400) == "x" * 400
    assert clean_text("x" * 401) == "x" * 397 + "..."


@given(text=st.text(st.characters(blacklist_categories=("Cs",)), max_size=600))
def test_any_text_becomes_one_short_line_without_control_characters(text):
    clean = read_log_line(text).text
    assert len(clean) <= MAX_TEXT_LENGTH
    assert not any(ord(letter) < 32 or 127 <= ord(letter) < 160 for letter in clean)
    assert len(clean.splitlines()) <= 1


@given(versions=st.lists(st.text("v0123456789.", min_size=1, max_size=80), min_size=3, max_size=3))
def test_versions_of_any_length_are_kept_short(versions):
    boot = read_log_line("[/hero_3] Firmware: %s | Hardware: %s | Config: %s | IP: 1.2.3.4" % tuple(versions)).boot
    assert boot == tuple(version[:32] for version in versions)


def test_a_text_full_of_bars_is_read_quickly_enough_to_finish():
    assert read_log_line("Firmware:" * 5000 + "|" * 5000).boot is None
