"""What people see of a stop: at once, when all wheels rest, and by name who does not stop."""

import pytest

from hero_client.ros.drivers import merge
from hero_client.ros.stop_status import CROSSING_S, NAMES_SHOWN, TIME_LIMIT_S, StopRequest
from hero_msgs.msg import Robot, RobotArray

SOON_S, LATE_S = CROSSING_S, TIME_LIMIT_S
A, B = "/hero_driver", "/hero_driver_b"


def make_reply(name, robots=(), stopped=True):
    """Return a driver's name and report; robots: (number, state, stop_state)."""
    report = RobotArray(stopped=stopped)
    for number, state, stop_state in robots:
        report.robots.append(Robot(namespace="/hero_%d" % number, state=state, stop_state=stop_state))
    return name, report


def rest(*numbers):
    return [(number, Robot.READY, Robot.AT_REST) for number in numbers]


def silent(name):
    return name, None


def update(request, replies, all_found, now_s):
    request.update(dict(replies), all_found, now_s)


def show(request, replies, now_s):
    robots = merge([report for _, report in replies if report]).robots
    return request.describe(dict(replies), robots, now_s)


def describe(replies, now_s=LATE_S, stopped=True):
    request = StopRequest(stopped, 0.0)
    update(request, replies, True, now_s)
    return show(request, replies, now_s)


@pytest.mark.parametrize("now_s", [0.0, SOON_S, TIME_LIMIT_S - 0.01])
def test_a_stop_is_shown_as_stopping_until_the_time_limit(now_s):
    assert describe([silent(A)], now_s) == ("warn", "stopping", False)


def test_a_stop_is_final_as_soon_as_all_wheels_are_at_rest():
    assert describe([make_reply(A, rest(0, 1)), make_reply(B, rest(100))], SOON_S) == (
        "info",
        "stopped, all wheels at rest",
        True,
    )


def test_a_report_that_crosses_the_request_is_not_believed():
    assert describe([make_reply(A, rest(0))], SOON_S - 0.01).text == "stopping"


def test_a_stop_is_told_within_one_and_a_half_seconds_of_its_request():
    assert CROSSING_S == 0.15 and TIME_LIMIT_S == 1.4
    request = StopRequest(True, 100.0)
    update(request, [make_reply(A, rest(0))], True, 100.1)
    assert not request.is_over and show(request, [make_reply(A, rest(0))], 100.1).text == "stopping"
    update(request, [make_reply(A, rest(0))], True, 100.2)
    assert request.is_over and show(request, [make_reply(A, rest(0))], 100.2).is_final
    assert show(request, [silent(A)], 101.3).text == "stopping" and show(request, [silent(A)], 101.4).level == "error"


def test_without_robots_nothing_is_said_about_wheels():
    assert describe([make_reply(A)]).text == "stopped, no robot is connected"


def test_moving_robots_and_silent_drivers_are_named():
    robots = [(3, Robot.READY, Robot.MOVING), *rest(4)]
    assert describe([make_reply(A, robots), silent(B)]) == (
        "error",
        "NOT STOPPED: hero_3 moves; driver hero_driver_b does not answer",
        False,
    )


def test_a_driver_that_did_not_take_the_stop_is_named():
    status = describe([make_reply(A, rest(0)), make_reply(B, rest(100), stopped=False)])
    assert status.text == "NOT STOPPED: driver hero_driver_b is not stopped"


@pytest.mark.parametrize("state", [Robot.JOINING, Robot.READY])
@pytest.mark.parametrize("stop_state", [Robot.STOPPING, Robot.NOT_STOPPED])
def test_a_connected_robot_that_is_not_at_rest_yet_is_named(state, stop_state):
    status = describe([make_reply(A, [(7, state, stop_state)])])
    assert (status.level, status.text) == ("error", "NOT STOPPED: hero_7 is not at rest yet")


def test_robots_that_cannot_be_confirmed_are_no_failure_but_named():
    robots = [*rest(0), (4, Robot.AWAY, Robot.STOPPING), (5, Robot.READY, Robot.UNCONFIRMED)]
    assert describe([make_reply(A, robots)]) == (
        "warn",
        "stopped, but hero_5 sends no wheel readings; hero_4 is away",
        True,
    )


def test_a_robot_that_was_refused_does_not_count():
    assert describe([make_reply(A, [*rest(0), (0, Robot.REFUSED, Robot.MOVING)])]).level == "info"


def test_a_robot_that_went_to_another_driver_counts_where_it_is():
    status = describe([make_reply(A, [(3, Robot.AWAY, Robot.STOPPING)]), make_reply(B, rest(3))])
    assert status.text == "stopped, all wheels at rest"


def test_of_many_robots_some_are_named_and_the_others_counted():
    count = NAMES_SHOWN + 5
    status = describe([make_reply(A, [(number, Robot.READY, Robot.MOVING) for number in range(count)])])
    assert "hero_1, " in status.text
    assert status.text.endswith(" and 5 more move")


def test_a_driver_is_asked_until_it_has_taken_the_stop():
    request = StopRequest(True, 0.0)
    for now_s, reply in ((SOON_S, silent(B)), (600.0, make_reply(B, stopped=False))):
        update(request, [make_reply(A), reply], True, now_s)
        assert (request.is_open_to(A), request.is_open_to(B), request.is_over) == (False, True, False)
    update(request, [make_reply(A), make_reply(B)], True, 601.0)
    assert not request.is_open_to(B)


def test_a_driver_that_starts_after_the_stop_is_not_asked():
    request = StopRequest(True, 0.0)
    update(request, [make_reply(A)], True, SOON_S)
    assert request.is_over
    assert not request.is_open_to(B)


def test_drivers_that_are_yet_to_be_found_are_waited_for():
    request = StopRequest(True, 0.0)
    update(request, [make_reply(A)], False, SOON_S)
    assert request.is_open_to(B)


def test_a_release_is_final_when_no_driver_is_stopped():
    assert describe([make_reply(A, stopped=False)], SOON_S, stopped=False) == (
        "info",
        "released: robots may move again",
        True,
    )


def test_a_release_that_is_not_taken_in_time_is_given_up_by_name():
    request = StopRequest(False, 0.0)
    replies = [silent(A), make_reply(B)]
    update(request, replies, True, LATE_S - 0.01)
    assert show(request, replies, LATE_S - 0.01) == ("warn", "releasing", False)
    assert request.is_open_to(A)
    update(request, replies, True, LATE_S)
    assert not request.is_open_to(A)
    assert show(request, replies, LATE_S) == (
        "error",
        "NOT RELEASED: driver hero_driver does not answer; driver hero_driver_b is still stopped",
        True,
    )


@pytest.mark.parametrize(("stopped", "how"), [(True, "released"), (False, "stopped")])
def test_what_another_program_changed_later_is_told(stopped, how):
    request = StopRequest(stopped, 0.0)
    update(request, [make_reply(A, stopped=stopped)], True, SOON_S)
    status = show(request, [make_reply(A, stopped=not stopped)], LATE_S)
    assert status == ("warn", "another program has %s the robots of hero_driver" % how, True)


def test_a_driver_that_falls_silent_after_the_stop_is_named():
    request = StopRequest(True, 0.0)
    update(request, [make_reply(A, rest(0))], True, SOON_S)
    assert show(request, [silent(A)], LATE_S).text == "NOT STOPPED: driver hero_driver does not answer"


def test_a_driver_that_falls_silent_after_the_release_has_released():
    request = StopRequest(False, 0.0)
    update(request, [make_reply(A, stopped=False)], True, SOON_S)
    assert show(request, [silent(A)], LATE_S) == ("info", "released: robots may move again", True)


@pytest.mark.parametrize(("stopped", "is_asked_again"), [(True, True), (False, False)])
def test_a_stop_is_asked_for_again_and_a_release_is_not(stopped, is_asked_again):
    request = StopRequest(stopped, 0.0)
    assert request.is_open_to(A)
    request.note_asked(A)
    update(request, [make_reply(A, stopped=not stopped)], True, SOON_S)
    assert request.is_open_to(A) == is_asked_again
    assert request.is_open_to(B)
