"""Commands to one robot: what waits, what is dropped, what goes out when."""

import struct

import pytest

from hero_driver.commands.command_queue import IN_FLIGHT_MAX, QUEUE_LENGTH, RETRY_S, CommandQueue
from hero_driver.commands.velocity_shaper import STOPPED_MOTORS, ZERO_TWIST

VELOCITY = "/hero_0/velocity_controller/cmd_vel"
POSITION = "/hero_0/position_controller/cmd_vel"
MOTORS = "/hero_0/cmd_motor"
LED = "/hero_0/led"
PULSES = struct.pack("<hh", 1400, 1600)


def make_motion(linear_m_s):
    return struct.pack("<6d", linear_m_s, 0.0, 0.0, 0.0, 0.0, 0.0)


FAST, SLOW = make_motion(0.2), make_motion(0.1)


def make_queue():
    return CommandQueue(max_age_s=2.0)


def offer(queue, name, twist, now_s):
    queue.offer_motion(name, twist, ZERO_TWIST, now_s)


def take(queue, now_s, in_flight_length=0, motion_acknowledged=True, stops_only=False):
    return queue.take(in_flight_length, motion_acknowledged, stops_only, now_s)


def is_idle(queue):
    return queue.due_in_s(True, 0.0) is None


def test_commands_that_are_no_velocities_go_out_in_order_and_all():
    queue = make_queue()
    for number in range(QUEUE_LENGTH):
        queue.offer(LED, bytes([number]))
    assert not is_idle(queue)
    assert take(queue, 0.0) == [(LED, bytes([number])) for number in range(QUEUE_LENGTH)]
    assert is_idle(queue)
    assert queue.dropped == 0


def test_a_full_queue_drops_the_oldest_and_counts_it():
    queue = make_queue()
    for number in range(QUEUE_LENGTH + 3):
        queue.offer(LED, bytes([number]))
    assert queue.dropped == 3
    assert take(queue, 0.0)[0] == (LED, bytes([3]))


def test_velocities_of_two_controllers_are_shaped_each_on_its_own():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    offer(queue, POSITION, SLOW, 0.0)
    assert take(queue, 0.0) == [(VELOCITY, FAST), (POSITION, SLOW)]
    offer(queue, VELOCITY, SLOW, 0.01)
    assert take(queue, 0.01) == []
    assert queue.due_in_s(True, 0.01) == pytest.approx(0.05)
    assert take(queue, 0.06) == [(VELOCITY, SLOW)]


def test_unacknowledged_bytes_delay_other_commands_but_not_a_stop():
    queue = make_queue()
    queue.offer(LED, bytes(16))
    offer(queue, VELOCITY, ZERO_TWIST, 0.0)
    assert take(queue, 0.0, in_flight_length=IN_FLIGHT_MAX) == [(VELOCITY, ZERO_TWIST)]
    assert queue.due_in_s(True, 0.0) == RETRY_S
    assert take(queue, 0.01, in_flight_length=IN_FLIGHT_MAX - 1) == [(LED, bytes(16))]


def test_other_commands_fill_the_window_and_not_much_more():
    queue = make_queue()
    for _ in range(10):
        queue.offer(LED, bytes(500))
    assert len(take(queue, 0.0)) == 5
    assert len(take(queue, 0.0, in_flight_length=1600)) == 1
    assert len(take(queue, 0.0)) == 4


def test_a_velocity_waits_until_the_one_before_it_is_acknowledged():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    take(queue, 0.0)
    offer(queue, VELOCITY, ZERO_TWIST, 0.01)
    assert take(queue, 0.1, motion_acknowledged=False) == []
    assert queue.due_in_s(False, 0.1) >= RETRY_S
    assert not is_idle(queue)
    assert take(queue, 0.3) == [(VELOCITY, ZERO_TWIST)]


def test_a_motion_that_could_not_be_sent_in_time_is_dropped():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    assert take(queue, 2.1) == []
    assert is_idle(queue)


def test_a_stop_that_could_not_be_sent_in_time_is_sent_nevertheless():
    queue = make_queue()
    offer(queue, VELOCITY, ZERO_TWIST, 0.0)
    assert take(queue, 100.0) == [(VELOCITY, ZERO_TWIST)]
    assert take(queue, 100.06) == [(VELOCITY, ZERO_TWIST)]


def test_discarding_motion_drops_what_waits_on_every_topic_and_keeps_stops():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    offer(queue, POSITION, ZERO_TWIST, 0.0)
    queue.offer_motion(MOTORS, PULSES, STOPPED_MOTORS, 0.0)
    queue.discard_motion(0.0)
    assert take(queue, 0.0) == [(POSITION, ZERO_TWIST)]


def test_after_motion_was_discarded_the_next_one_waits_until_it_may_go():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    queue.discard_motion(0.1)
    offer(queue, VELOCITY, SLOW, 0.01)
    assert take(queue, 0.09) == []
    assert queue.due_in_s(True, 0.09) == pytest.approx(0.01)
    assert take(queue, 0.1) == [(VELOCITY, SLOW)]


def test_topics_not_used_before_wait_too_after_motion_was_discarded():
    queue = make_queue()
    queue.discard_motion(0.1)
    queue.offer_motion(MOTORS, PULSES, STOPPED_MOTORS, 0.01)
    assert take(queue, 0.09) == []
    assert take(queue, 0.1) == [(MOTORS, PULSES)]


@pytest.mark.parametrize("used_before", [False, True])
def test_motion_goes_out_after_older_stops_of_other_topics(used_before):
    queue = make_queue()
    if used_before:  # the order of the topics does not matter
        queue.offer_motion(MOTORS, PULSES, STOPPED_MOTORS, -1.0)
        assert take(queue, -1.0) == [(MOTORS, PULSES)]
    offer(queue, POSITION, ZERO_TWIST, 0.0)
    queue.offer_motion(MOTORS, PULSES, STOPPED_MOTORS, 0.01)
    assert take(queue, 0.01) == [(POSITION, ZERO_TWIST)]
    assert queue.due_in_s(True, 0.01) == pytest.approx(0.06)
    assert take(queue, 0.05) == []
    assert take(queue, 0.07) + take(queue, 0.07) == [(POSITION, ZERO_TWIST), (MOTORS, PULSES)]
    assert is_idle(queue)


def test_zeros_that_keep_coming_on_another_topic_do_not_hold_up_motion():
    queue = make_queue()
    sent = []
    for step in range(100):
        offer(queue, VELOCITY if step % 2 else POSITION, FAST if step % 2 else ZERO_TWIST, 0.02 * step)
        sent += take(queue, 0.02 * step)
    assert sent.count((VELOCITY, FAST)) > 20


def test_motion_is_held_for_a_robot_that_is_not_heard_and_stops_are_not():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    offer(queue, POSITION, ZERO_TWIST, 0.0)
    assert take(queue, 0.0, stops_only=True) == [(POSITION, ZERO_TWIST)]
    assert queue.due_in_s(False, 0.0) >= RETRY_S
    assert take(queue, 1.0)[0] == (VELOCITY, FAST)


def test_clearing_forgets_everything_and_counts_what_waited():
    queue = make_queue()
    queue.offer(LED, b"")
    queue.offer(LED, b"")
    offer(queue, VELOCITY, FAST, 0.0)
    queue.clear()
    assert is_idle(queue)
    assert queue.dropped == 2
    assert take(queue, 0.0) == []


def test_a_motion_may_be_as_old_as_the_limit_and_a_cleared_queue_is_new():
    queue = make_queue()
    offer(queue, VELOCITY, FAST, 0.0)
    assert take(queue, 2.0) == [(VELOCITY, FAST)]
    queue.discard_motion(10.0)
    queue.clear()
    offer(queue, VELOCITY, SLOW, 2.0)
    assert take(queue, 2.0) == [(VELOCITY, SLOW)]
    assert queue.due_in_s(True, 2.0) is None


def test_the_time_to_come_back_is_that_of_the_topic_which_is_due_first():
    queue = make_queue()
    for name, now_s in ((VELOCITY, 0.0), (POSITION, 0.03)):
        offer(queue, name, FAST, now_s)
        take(queue, now_s)
    for name in (VELOCITY, POSITION):
        offer(queue, name, SLOW, 0.03)
    assert queue.due_in_s(True, 0.03) == pytest.approx(0.03)
    assert queue.due_in_s(False, 0.03) == pytest.approx(0.03)
    assert queue.due_in_s(False, 0.055) == RETRY_S == 0.01
    assert queue.due_in_s(True, 0.055) == pytest.approx(0.005)
    queue.offer(LED, bytes(16))
    assert queue.due_in_s(True, 0.03) == RETRY_S


def test_motion_and_a_stop_of_one_time_do_not_wait_for_each_other():
    for offset_s, taken in ((0.0, [(POSITION, ZERO_TWIST), (VELOCITY, FAST)]), (0.001, [(POSITION, ZERO_TWIST)])):
        queue = make_queue()
        offer(queue, POSITION, ZERO_TWIST, 0.0)
        offer(queue, VELOCITY, FAST, offset_s)
        assert take(queue, 0.01) == taken


def test_one_robots_window_and_the_commands_that_wait_for_it_are_bounded():
    assert (QUEUE_LENGTH, IN_FLIGHT_MAX) == (50, 2048), "docs/robot_interface.md"
