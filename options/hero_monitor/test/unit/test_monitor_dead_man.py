"""The robot drives while a button is held on a page, and stops however that ends."""

import pytest

from hero_monitor.control.dead_man import DeadMan


@pytest.fixture()
def held():
    dead_man = DeadMan()
    assert dead_man.hold(1, "hero_0", now_s=10.0)
    return dead_man


def test_nothing_is_stopped_while_a_button_is_held(held):
    for step in range(20):
        now_s = 10.0 + 0.1 * step
        assert held.hold(1, "hero_0", now_s)
        assert held.take_stops(now_s) == []


def test_a_report_counts_until_its_time_is_over():
    dead_man = DeadMan()
    assert dead_man.hold(1, "hero_0", now_s=0.0)
    assert dead_man.take_stops(0.4) == [] and dead_man.take_stops(0.4001) == ["hero_0"]


def test_a_released_button_stops_the_robot_and_then_leaves_it_alone(held):
    held.release(1, "hero_0")
    assert held.take_stops(10.05) == ["hero_0"]
    assert held.take_stops(99.0) == []


def test_a_page_that_is_gone_stops_its_robots_and_no_others(held):
    held.hold(1, "hero_1", 10.0)
    held.hold(2, "hero_2", 10.0)
    held.drop_page(1)
    assert held.take_stops(10.1) == ["hero_0", "hero_1"]


def test_the_end_of_the_program_stops_all(held):
    held.hold(2, "hero_2", 10.0)
    held.drop_all()
    assert held.take_stops(10.1) == ["hero_0", "hero_2"]


def test_a_stop_ends_the_hold_of_whoever_drives_until_a_new_press(held):
    assert not held.is_over("hero_0", pressed_ms=0)
    assert held.end_hold("hero_0", now_ms=5000) == 1 and held.end_hold("hero_1", now_ms=5000) is None
    assert held.take_stops(10.1) == ["hero_0", "hero_1"]
    assert held.is_over("hero_0", 5000) and not held.is_over("hero_0", 5001) and not held.is_over("hero_2", 4000)
    held.hold(1, "hero_0", 10.2)
    held.end_all_holds(6000)
    assert held.take_stops(10.3) == ["hero_0"]
    assert held.is_over("hero_0", 6000) and held.is_over("hero_2", 6000) and not held.is_over("hero_2", 6001)


def test_a_robot_is_driven_from_one_page_at_a_time(held):
    assert not held.hold(2, "hero_0", 10.1)
    held.release(2, "hero_0")
    assert held.take_stops(10.2) == []
    held.release(1, "hero_0")
    assert held.hold(2, "hero_0", 10.3)
    assert held.take_stops(10.3) == []
