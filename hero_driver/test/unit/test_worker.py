"""Calls on another thread: in order, bounded, one bad call costs no other."""

import sys
import threading

import pytest

from hero_driver.transport import call_queue
from hero_driver.transport.call_queue import CallQueue, Worker

DEADLINE_S = 60.0


class Calls:
    """A worker whose calls can be held until they are let go."""

    def __init__(self, queue_length=10, tell=None):
        self.errors = []
        self.done = []
        self.gate = threading.Event()
        self.worker = Worker("calls", queue_length, "a call failed", tell or self.errors.append)

    def hold(self):
        """Keep the worker busy; return when it is."""
        busy = threading.Event()

        def wait():
            busy.set()
            self.gate.wait(DEADLINE_S)

        assert self.worker.submit(wait)
        assert busy.wait(DEADLINE_S)

    def submit(self, number, **options):
        return self.worker.submit(lambda: self.done.append(number), **options)

    def wait(self):
        """Return when all calls submitted so far are made."""
        reached = threading.Event()
        assert self.worker.submit(reached.set, always=True)
        assert reached.wait(DEADLINE_S)

    def is_ended(self):
        self.worker._thread.join(DEADLINE_S)
        return not self.worker._thread.is_alive()


def test_calls_are_made_in_order_on_one_thread_with_the_workers_name():
    calls = Calls(200)
    threads = []
    for number in range(100):
        assert calls.submit(number)
        calls.worker.submit(lambda: threads.append(threading.current_thread()))
    calls.wait()
    assert calls.done == list(range(100))
    assert {thread.name for thread in threads} == {"calls"}


def test_a_full_queue_refuses_the_newest_calls_and_counts_them():
    calls = Calls(queue_length=3)
    calls.hold()
    assert [calls.submit(number) for number in range(5)] == [True, True, True, False, False]
    assert calls.worker.refused == 2
    calls.gate.set()
    calls.wait()
    assert calls.done == [0, 1, 2]


def test_a_full_queue_takes_what_has_to_be_done_always():
    calls = Calls(queue_length=1)
    calls.hold()
    assert [calls.submit(1), calls.submit(2), calls.submit(3, always=True)] == [True, False, True]
    calls.gate.set()
    calls.wait()
    assert calls.done == [1, 3]


@pytest.mark.parametrize("error", [ValueError, SystemExit])
def test_a_call_that_fails_is_reported_and_the_next_one_is_made(error):
    calls = Calls()

    def fail():
        raise error("bad call")

    calls.worker.submit(fail)
    calls.submit(1)
    calls.wait()
    assert calls.errors == [f"a call failed: {error.__name__}: bad call"]
    assert calls.done == [1]


def test_an_error_that_cannot_be_reported_does_not_end_the_thread():
    def fail(text):
        raise OSError("the terminal is gone")

    calls = Calls(tell=fail)
    calls.worker.submit(sys.exit)
    calls.submit(1)
    calls.wait()
    assert calls.done == [1]


def test_a_closed_worker_forgets_what_waits_and_takes_nothing(monkeypatch):
    calls = Calls()
    calls.hold()
    calls.submit(1)
    monkeypatch.setattr(call_queue, "SHUTDOWN_WAIT_S", 0.0)
    calls.worker.close()
    assert not calls.submit(2, always=True)
    calls.gate.set()
    assert calls.is_ended()
    assert calls.done == []


def test_a_drained_worker_makes_the_calls_that_wait_before_it_ends():
    calls = Calls()
    calls.hold()
    for number in range(5):
        calls.submit(number)
    CallQueue.close(calls.worker, drain=True)
    calls.gate.set()
    assert calls.is_ended()
    assert calls.done == list(range(5))


def test_a_worker_may_be_closed_twice_and_by_its_own_thread():
    calls = Calls()
    calls.worker.submit(calls.worker.close)
    assert calls.is_ended()
    calls.worker.close()


def test_closing_leaves_a_worker_that_hangs_behind():
    calls = Calls()
    calls.hold()
    calls.worker.close(drain=True)
    assert calls.worker._thread.is_alive()
    calls.gate.set()
    assert calls.is_ended()


def test_every_call_of_many_threads_is_made_or_refused():
    calls = Calls(queue_length=50)
    threads = [threading.Thread(target=lambda: [calls.submit(number) for number in range(300)]) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    CallQueue.close(calls.worker, drain=True)
    assert calls.is_ended()
    assert len(calls.done) + calls.worker.refused == 1200


def test_a_call_made_by_a_call_waits_for_the_next_time():
    made = []
    queue = CallQueue(10, lambda: None, made.append)
    queue.submit(lambda: queue.submit(lambda: made.append("second")))
    queue.make_calls()
    assert made == []
    queue.make_calls()
    assert made == ["second"]


@pytest.mark.parametrize("drain", [False, True])
def test_a_closed_queue_takes_no_call_and_keeps_what_waits_only_to_drain(drain):
    made, wakes = [], []
    queue = CallQueue(2, lambda: wakes.append(1), made.append)
    assert [queue.submit(lambda: made.append("call")) for _ in range(3)] == [True, True, False]
    assert queue.submit(lambda: made.append("call"), always=True)
    queue.close(**({"drain": True} if drain else {}))
    assert not queue.submit(lambda: made.append("late"), always=True)
    assert (queue.refused, len(wakes)) == (2, 4)
    queue.make_calls()
    assert made == ["call"] * (3 if drain else 0)
