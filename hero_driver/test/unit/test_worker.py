"""Jobs on a thread of their own: in order, bounded, one bad job costs no other."""

import sys
import threading

from hero_driver.ros.worker import Worker

DEADLINE_S = 20.0


class Bench:
    """A worker whose first job can be held until it is let go."""

    def __init__(self, queue_length=10):
        self.errors = []
        self.done = []
        self.gate = threading.Event()
        self.worker = Worker("bench", queue_length, self.errors.append)

    def hold(self):
        """Keep the worker busy; return when it is."""
        busy = threading.Event()

        def job():
            busy.set()
            self.gate.wait(DEADLINE_S)

        assert self.worker.submit(job)
        assert busy.wait(DEADLINE_S)

    def submit(self, number):
        return self.worker.submit(lambda: self.done.append(number))

    def wait(self):
        """Return when all jobs submitted so far are done."""
        reached = threading.Event()
        assert self.worker.submit(reached.set)
        assert reached.wait(DEADLINE_S)


def test_jobs_are_done_in_the_order_in_which_they_came_on_another_thread():
    bench = Bench(200)
    threads = []
    for number in range(100):
        assert bench.submit(number)
    bench.worker.submit(lambda: threads.append(threading.current_thread()))
    bench.wait()
    assert bench.done == list(range(100))
    assert threads[0] is not threading.current_thread()
    assert threads[0].daemon
    assert threads[0].name == "bench"


def test_jobs_beyond_the_length_of_the_queue_are_refused_and_counted():
    bench = Bench(queue_length=3)
    bench.hold()
    assert [bench.submit(number) for number in range(5)] == [True, True, True, False, False]
    assert bench.worker.refused_jobs == 2
    bench.gate.set()
    bench.worker.close(drain=True)
    assert bench.done == [0, 1, 2]


def test_a_job_that_raises_is_reported_and_the_next_one_is_done():
    bench = Bench()
    error = ValueError("bad job")

    def fail():
        raise error

    bench.worker.submit(fail)
    bench.submit(1)
    bench.wait()
    assert bench.errors == [error]
    assert bench.done == [1]


def test_a_job_that_wants_to_end_the_thread_ends_nothing():
    bench = Bench()
    bench.worker.submit(sys.exit)
    bench.submit(1)
    bench.wait()
    assert [type(error) for error in bench.errors] == [SystemExit]
    assert bench.done == [1]


def test_an_error_that_cannot_be_reported_is_counted_and_the_next_job_is_done():
    def fail(_):
        raise OSError("no space left on device")

    bench = Bench()
    bench.worker = Worker("bench", 10, fail)
    bench.worker.submit(lambda: 1 / 0)
    bench.submit(1)
    bench.wait()
    assert bench.worker.lost_errors == 1
    assert bench.done == [1]


def test_a_job_that_must_be_done_is_taken_although_too_many_wait():
    bench = Bench(queue_length=1)
    bench.hold()
    assert [bench.submit(1), bench.submit(2)] == [True, False]
    assert bench.worker.submit(lambda: bench.done.append(3), always=True)
    bench.gate.set()
    bench.worker.close(drain=True)
    assert bench.done == [1, 3]


def test_submitting_does_not_wait_for_a_job_that_hangs():
    bench = Bench()
    bench.hold()
    assert bench.submit(1)
    assert bench.done == []
    bench.gate.set()
    bench.wait()
    assert bench.done == [1]


def test_closing_with_drain_does_what_waits():
    bench = Bench()
    bench.hold()
    for number in range(3):
        bench.submit(number)
    bench.gate.set()
    bench.worker.close(drain=True)
    assert bench.done == [0, 1, 2]


def test_closing_without_drain_forgets_what_waits():
    bench = Bench()
    bench.hold()
    ended = bench.worker._thread
    bench.submit(1)
    bench.worker.close()
    bench.gate.set()
    ended.join(DEADLINE_S)
    assert not ended.is_alive()
    assert bench.done == []


def test_a_closed_worker_takes_no_job():
    bench = Bench()
    bench.worker.close()
    assert not bench.submit(1)
    assert bench.worker.refused_jobs == 1


def test_closing_twice_and_without_any_job_is_safe():
    bench = Bench()
    bench.worker.close()
    bench.worker.close(drain=True)
    bench = Bench()
    bench.wait()
    bench.worker.close(drain=True)
    bench.worker.close()
    assert not bench.worker._thread.is_alive()


def test_closing_leaves_a_job_that_hangs_behind():
    bench = Bench()
    bench.hold()
    bench.worker.close(drain=True)
    assert bench.worker._thread.is_alive()
    bench.gate.set()
    bench.worker._thread.join(DEADLINE_S)
    assert not bench.worker._thread.is_alive()


def test_a_job_may_close_its_worker():
    bench = Bench()
    closed = threading.Event()

    def close():
        bench.worker.close()
        closed.set()

    bench.worker.submit(close)
    assert closed.wait(DEADLINE_S)


def test_a_job_may_submit_another_one():
    bench = Bench()
    bench.worker.submit(lambda: bench.submit(1))
    bench.wait()
    bench.wait()
    assert bench.done == [1]


def test_no_job_of_many_threads_is_lost_uncounted():
    bench = Bench(queue_length=50)
    threads = [
        threading.Thread(target=lambda: [bench.submit(number) for number in range(300)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(DEADLINE_S)
    bench.worker.close(drain=True)
    bench.worker._thread.join(DEADLINE_S)
    assert len(bench.done) + bench.worker.refused_jobs == 1200
