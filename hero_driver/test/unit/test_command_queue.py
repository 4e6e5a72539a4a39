"""Commands to one robot: what waits, what is dropped, what goes out when."""

import struct
import threading

import pytest

from hero_driver.command_queue import IN_FLIGHT_MAX, QUEUE_LENGTH, RETRY_S, CommandQueue
from hero_driver.command_shaping import ZERO_TWIST

VELOCITY = "/hero_0/velocity_controller/cmd_vel"
POSITION = "/hero_0/position_controller/cmd_vel"
LED = "/hero_0/led"


def make_motion(linear_m_s):
    return struct.pack("<6d", linear_m_s, 0.0, 0.0, 0.0, 0.0, 0.0)


FAST, SLOW = make_motion(0.2), make_motion(0.1)


def make_queue():
    return CommandQueue(max_age_s=2.0)


def take(queue, now_s, in_flight_length=0, velocity_acknowledged=True):
    return queue.take(in_flight_length, velocity_acknowledged, now_s)


def test_an_empty_queue_is_idle_and_has_nothing_to_send():
    queue = make_queue()
    assert queue.is_idle
    assert take(queue, 0.0) == []
    assert queue.due_in_s(True, 0.0) is None


def test_commands_that_are_no_velocities_go_out_in_order_and_all():
    queue = make_queue()
    for number in range(QUEUE_LENGTH):
        queue.offer(LED, bytes([number]))
    assert not queue.is_idle
    assert take(queue, 0.0) == [(LED, bytes([number])) for number in range(QUEUE_LENGTH)]
    assert queue.is_idle
    assert queue.dropped == 0


def test_a_full_queue_drops_the_oldest_and_counts_it():
    queue = make_queue()
    for number in range(QUEUE_LENGTH + 3):
        queue.offer(LED, bytes([number]))
    assert queue.dropped == 3
    assert take(queue, 0.0)[0] == (LED, bytes([3]))


def test_velocities_of_two_controllers_are_shaped_each_on_its_own():
    queue = make_queue()
    queue.offer_velocity(VELOCITY, FAST, 0.0)
    queue.offer_velocity(POSITION, SLOW, 0.0)
    assert take(queue, 0.0) == [(VELOCITY, FAST), (POSITION, SLOW)]
    queue.offer_velocity(VELOCITY, SLOW, 0.01)
    assert take(queue, 0.01) == []
    assert queue.due_in_s(True, 0.01) == pytest.approx(0.05)
    assert take(queue, 0.06) == [(VELOCITY, SLOW)]


def test_a_full_queue_of_other_commands_does_not_hold_up_a_stop():
    queue = make_queue()
    for _ in range(QUEUE_LENGTH):
        queue.offer(LED, bytes(16))
    queue.offer_velocity(VELOCITY, ZERO_TWIST, 0.0)
    assert take(queue, 0.0)[0] == (VELOCITY, ZERO_TWIST)


def test_other_commands_wait_while_the_robot_has_not_acknowledged_its_window_and_a_stop_does_not():
    queue = make_queue()
    queue.offer(LED, bytes(16))
    queue.offer_velocity(VELOCITY, ZERO_TWIST, 0.0)
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
    queue.offer_velocity(VELOCITY, FAST, 0.0)
    take(queue, 0.0)
    queue.offer_velocity(VELOCITY, ZERO_TWIST, 0.01)
    assert take(queue, 0.1, velocity_acknowledged=False) == []
    assert queue.due_in_s(False, 0.1) >= RETRY_S
    assert not queue.is_idle
    assert take(queue, 0.3) == [(VELOCITY, ZERO_TWIST)]


def test_a_motion_that_could_not_be_sent_in_time_is_dropped():
    queue = make_queue()
    queue.offer_velocity(VELOCITY, FAST, 0.0)
    assert take(queue, 2.1) == []
    assert queue.is_idle


def test_a_stop_that_could_not_be_sent_in_time_is_sent_nevertheless():
    queue = make_queue()
    queue.offer_velocity(VELOCITY, ZERO_TWIST, 0.0)
    assert take(queue, 100.0) == [(VELOCITY, ZERO_TWIST)]
    assert take(queue, 100.06) == [(VELOCITY, ZERO_TWIST)]


def test_halting_stops_the_topics_used_of_late_and_the_one_that_always_is_and_no_other():
    queue = make_queue()
    queue.offer_velocity(POSITION, FAST, 0.0)
    queue.offer_velocity("/hero_0/old/cmd_vel", FAST, -10.0)
    take(queue, 0.0)
    queue.halt(VELOCITY, 1.0)
    for now_s in (1.0, 1.06):
        assert sorted(take(queue, now_s)) == [(POSITION, ZERO_TWIST), (VELOCITY, ZERO_TWIST)]
    assert queue.is_idle


def test_halting_forgets_motion_that_waits_on_every_topic():
    queue = make_queue()
    queue.offer_velocity(VELOCITY, SLOW, 0.0)
    take(queue, 0.0)
    queue.offer_velocity(VELOCITY, FAST, 0.01)
    queue.halt(None, 0.02)
    sent = [take(queue, 0.06 * step) for step in range(1, 5)]
    assert sent == [[(VELOCITY, ZERO_TWIST)], [(VELOCITY, ZERO_TWIST)], [], []]


def test_halting_a_robot_that_nobody_drives_and_that_has_no_velocity_topic_sends_nothing():
    queue = make_queue()
    queue.halt(None, 0.0)
    assert queue.is_idle


def test_a_halt_is_not_dropped_as_too_old():
    queue = make_queue()
    queue.offer_velocity(VELOCITY, FAST, 0.0)
    queue.halt(VELOCITY, 4.0)
    assert take(queue, 10.0) == [(VELOCITY, ZERO_TWIST)]


def test_clearing_forgets_everything_and_counts_what_waited():
    queue = make_queue()
    queue.offer(LED, b"")
    queue.offer(LED, b"")
    queue.offer_velocity(VELOCITY, FAST, 0.0)
    queue.clear()
    assert queue.is_idle
    assert queue.dropped == 2
    assert take(queue, 0.0) == []


def test_many_threads_may_offer_at_once_and_nothing_is_lost_uncounted():
    queue = make_queue()
    barrier = threading.Barrier(5)
    taken = []

    def offer(number):
        barrier.wait()
        for step in range(500):
            queue.offer(LED, bytes([number]))
            queue.offer_velocity(VELOCITY, FAST, step * 0.001)

    threads = [threading.Thread(target=offer, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    barrier.wait()
    while any(thread.is_alive() for thread in threads):
        taken += [name for name, _ in take(queue, 0.0) if name == LED]
    for thread in threads:
        thread.join()
    taken += [name for name, _ in take(queue, 0.0) if name == LED]
    assert len(taken) + queue.dropped == 2000
