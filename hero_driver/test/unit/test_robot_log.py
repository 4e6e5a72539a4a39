"""What the driver makes of robots' log lines, whatever they say."""

from types import SimpleNamespace

import pytest

from hero_driver.peer import LOG_LINES_PER_S
from hero_driver.reports.robot_log import receive_line
from hero_driver.ros.log_relay import LogRelay
from hero_driver.rosserial.payloads import LOG_INFO, Log
from hero_node import TokenBucket

NOW_S = 1000.0


@pytest.fixture(name="lines")
def make_lines(monkeypatch):
    """Give what a relay logs, as (level, text)."""
    lines = []
    monkeypatch.setattr(LogRelay, "log", lambda self, level, text: lines.append((level, text)))
    return lines


def make_peer():
    odometry = SimpleNamespace(note_reboot=lambda: None)
    return SimpleNamespace(
        label="hero_1",
        link=SimpleNamespace(address=SimpleNamespace(host="10.0.0.1")),
        bridge=SimpleNamespace(corrections=SimpleNamespace(odometry=odometry), commands=SimpleNamespace()),
        record=SimpleNamespace(booted_s=None, heard_uptime_s=0.0, dropped_messages=0, world=""),
        wheels=SimpleNamespace(is_late=False),
        refused=False,
        boot=None,
        log_lines=TokenBucket(LOG_LINES_PER_S, LOG_LINES_PER_S, 0.0),
    )


def say_uptime(relay, peer, uptime_ms, now_s=NOW_S):
    receive_line(relay, peer, Log(LOG_INFO, "[/hero_1] Conected at time %d" % uptime_ms), now_s)


def test_a_robot_whose_uptime_falls_has_rebooted(lines):
    relay, peer = LogRelay(), make_peer()
    say_uptime(relay, peer, 60000)
    say_uptime(relay, peer, 2500)
    assert ("warn", "hero_1 rebooted 2.5 s ago") in lines


def test_a_robot_that_says_again_and_again_that_it_rebooted_gives_one_line(lines):
    relay, peer = LogRelay(), make_peer()
    for _ in range(500):
        say_uptime(relay, peer, 9999999999)
        say_uptime(relay, peer, 1)
    assert len([text for level, text in lines if level == "warn"]) == 1


@pytest.mark.parametrize(("was_told", "stops"), [(False, 1), (True, 0)])
def test_a_robot_that_tunes_itself_without_being_told_to_is_stopped(lines, was_told, stops):
    peer, stopped = make_peer(), []
    peer.bridge.commands.was_told_to_tune, peer.stop = was_told, None
    peer.bridge.commands.note_tuning = lambda tunes: None

    def stop(robot):
        stopped.append(robot)
        robot.stop = "in progress"

    relay, peer.owner = LogRelay(), SimpleNamespace(stop_robot=stop)
    for _ in range(5):
        receive_line(relay, peer, Log(LOG_INFO, "[/hero_1] Tunning Motor Set: [0,0]"), NOW_S)
    assert stopped == [peer] * stops


def test_a_line_about_a_tuning_that_is_read_late_accuses_no_robot(lines):
    peer, stopped, late = make_peer(), [], []
    peer.bridge.commands.was_told_to_tune, peer.stop = False, None
    peer.bridge.commands.note_tuning = lambda tunes: None
    relay = LogRelay()
    peer.owner = SimpleNamespace(stop_robot=stopped.append, warn_late=lambda: late.append(peer.wheels.is_late))
    for peer.wheels.is_late in (True, True, False):
        receive_line(relay, peer, Log(LOG_INFO, "[/hero_1] Tunning Motor Set: [0,0]"), NOW_S)
        assert len(stopped) == (not peer.wheels.is_late)
    assert late == [True, True]
    assert [text for level, text in lines if level == "warn"] == [
        "hero_1 tunes itself, without a request from this driver: stopped"
    ]


@pytest.mark.parametrize("late_s", [1.5, 3.0, 60.0])
def test_a_line_that_is_late_is_no_reboot_and_changes_no_boot_time(lines, late_s):
    relay, peer = LogRelay(), make_peer()
    reboots = []
    peer.bridge.corrections.odometry.note_reboot = lambda: reboots.append(peer.record.booted_s)
    for second in range(0, 200, 2):
        uptime_ms, now_s = 60000 + 1000 * second, NOW_S + second
        say_uptime(relay, peer, uptime_ms, now_s)
        say_uptime(relay, peer, uptime_ms + 1000, now_s + 1.0 + late_s * (second % 10 == 0))
    assert peer.record.booted_s == NOW_S - 60.0
    assert not reboots and not [text for level, text in lines if level == "warn"]


def test_a_reboot_counts_once_however_late_the_lines_after_it_are(lines):
    relay, peer = LogRelay(), make_peer()
    reboots = []
    peer.bridge.corrections.odometry.note_reboot = lambda: reboots.append(peer.record.booted_s)
    say_uptime(relay, peer, 60000)
    for uptime_ms, late_s in ((2000, 0.5), (3000, 4.0), (4000, 3.0), (5000, 0.0)):
        say_uptime(relay, peer, uptime_ms, NOW_S + 10.0 + uptime_ms / 1000.0 + late_s)
    assert len(reboots) == 1
    assert [text for level, text in lines if level == "warn"] == ["hero_1 rebooted 2.0 s ago"]
    assert peer.record.booted_s == NOW_S + 10.0


@pytest.mark.parametrize("boots", [1, 3])
def test_a_boot_line_tells_of_a_reboot_after_which_the_uptime_is_longer(lines, boots):
    relay, peer = LogRelay(), make_peer()
    peer.bridge.corrections.odometry.note_reboot = lambda: pytest.fail("a new connection has told the corrections")
    for first_s in range(0, 100 * boots, 100):
        receive_line(relay, peer, Log(LOG_INFO, "Firmware: v3.8 | Hardware: v2.5 | Config: v2.3 | IP: 1"), NOW_S)
        for uptime_s in (2 + first_s // 100, 3 + first_s // 100):
            say_uptime(relay, peer, 1000 * uptime_s, NOW_S + first_s + uptime_s)
    assert len([text for _, text in lines if "rebooted" in text]) == min(boots - 1, 1), "the same line is throttled"
    assert peer.record.booted_s == NOW_S + 100 * (boots - 1)


def test_odometry_begins_anew_only_where_a_robot_boots_in_another_world(lines):
    relay, peer = LogRelay(), make_peer()
    restarts = []
    peer.bridge.corrections.odometry.start_at_zero = lambda: restarts.append(peer.record.world)
    for world in ("", " | World: a1", " | World: a1", "", " | World: b2"):
        text = "Firmware: v3.8 | Hardware: v2.5 | Config: v2.3 | IP: 1%s " % world
        receive_line(relay, peer, Log(LOG_INFO, text), NOW_S)
    assert restarts == ["a1", "b2"]


def test_more_lines_than_fit_a_second_are_counted_and_not_passed_on(lines):
    relay, peer = LogRelay(), make_peer()
    for second in range(3):
        for number in range(LOG_LINES_PER_S + 7):
            receive_line(relay, peer, Log(LOG_INFO, "line %d" % number), NOW_S + second)
        assert len(lines) == LOG_LINES_PER_S * (second + 1)
        assert peer.record.dropped_messages == 7 * (second + 1)


def test_ten_lines_of_a_robot_without_a_name_are_kept(lines):
    relay, peer = LogRelay(), make_peer()
    peer.bridge, kept = None, []
    peer.keep = kept.append
    logs = [Log(LOG_INFO, "line %d" % number) for number in range(12)]
    for log in logs:
        receive_line(relay, peer, log, NOW_S)
    assert kept == logs and lines == []
