"""What is not known is named with cause and remedy within 2 s; old requests move no robot."""

import pytest

from hero_monitor.control.requests import AGE_MAX_S, is_fresh
from hero_monitor.fleet_feed.losses import NO_DRIVER, LocalizationWatch, list_losses

FORGOTTEN_S, SILENT_S = 10.0, 1.8


def list_sources(drivers, localization=None, now_s=0.0):
    return [loss.source for loss in list_losses(drivers, False, localization or LocalizationWatch(), now_s)]


def test_nothing_is_lost_while_all_that_was_ever_heard_answers():
    assert list_sources({"/hero_driver": True}) == []


def test_a_driver_that_does_not_answer_is_named_and_a_missing_one_too():
    losses = list_losses({"/hero_driver": True, "/hero_driver_b": False}, False, LocalizationWatch(), 0.0)
    assert [loss.cause for loss in losses] == ["No answer from hero_driver_b: its robots are unknown"]
    assert "roslaunch" in losses[0].remedy
    assert list_sources({}) == ["driver"]


def test_what_is_worst_comes_first():
    losses = list_losses({"/hero_driver": False}, True, LocalizationWatch(), 0.0)
    assert [loss.source for loss in losses] == ["driver", "master"]
    assert all(loss.remedy.endswith("again: " + NO_DRIVER) for loss in losses)


def test_localization_is_lost_within_two_seconds_and_later_not_missed():
    localization = LocalizationWatch()
    assert list_sources({"/d": True}, localization, 100.0) == []
    localization.receive(tracked=3, now_s=100.0)
    assert list_sources({"/d": True}, localization, 101.0) == []
    assert list_sources({"/d": True}, localization, 102.0) == ["localization"]
    assert list_sources({"/d": True}, localization, 100.1 + FORGOTTEN_S) == []
    localization.receive(tracked=3, now_s=200.0)
    assert list_sources({"/d": True}, localization, 200.1) == []


def test_localization_that_was_not_listened_to_was_not_silent():
    localization = LocalizationWatch()
    localization.receive(tracked=1, now_s=100.0)
    localization.pause(150.0)
    assert list_sources({"/d": True}, localization, 151.0) == []


def test_a_camera_that_measures_none_of_the_robots_it_measured_is_lost():
    localization = LocalizationWatch()
    localization.receive(tracked=0, now_s=100.0)
    assert list_sources({"/d": True}, localization, 100.1) == []
    localization.receive(tracked=2, now_s=101.0)
    localization.receive(tracked=0, now_s=102.0)
    assert list_sources({"/d": True}, localization, 102.1) == ["camera"]


@pytest.mark.parametrize("kind", sorted(AGE_MAX_S))
def test_a_request_that_a_socket_held_moves_no_robot(kind):
    limit_ms = round(1000 * AGE_MAX_S[kind])
    for age_ms, expected in ((0, True), (limit_ms, True), (limit_ms + 1, False), (60000, False), (-1, False)):
        assert is_fresh({"do": kind, "heard_ms": 1000000 - age_ms}, 1000000) is expected


def test_a_stop_counts_at_any_age():
    assert is_fresh({"do": "stop", "heard_ms": 0}, 1000000)
    assert is_fresh({"do": "end_drive", "robots": ["hero_0"]}, 1000000)


def test_losses_begin_and_end_at_their_times():
    watch, drivers = LocalizationWatch(), {"/a": True}

    def list_sources(now_s):
        return [loss.source for loss in list_losses(drivers, False, watch, now_s)]

    watch.receive(1, 100.0)
    watch.receive(0, 100.0)
    for silent_s, lost in (
        (SILENT_S - 0.01, ["camera"]),
        (SILENT_S + 0.01, ["localization"]),
        (FORGOTTEN_S - 0.01, ["localization"]),
        (FORGOTTEN_S + 0.01, []),
    ):
        assert list_sources(100.0 + silent_s) == lost
    watch.receive(1, 0.0)
    assert not watch.is_lost(SILENT_S) and watch.is_expected(FORGOTTEN_S) and not watch.has_lost_camera(SILENT_S)
    watch.receive(0, 0.0)
    assert watch.has_lost_camera(SILENT_S)
    several = list_losses({"/a": False, "/lab/b": False}, True, LocalizationWatch(), 0.0)
    assert several[0].cause == "No answer from a, lab/b: their robots are unknown"
    assert "No ROS master" in several[1].cause and len(several) == 2
