"""One robot's jobs for the registrar: held back while asked, gone with the connection."""

import threading

from hero_driver.ros.registrar import HELD_MAX, RobotRegistrar
from hero_driver.ros.worker import Worker

DEADLINE_S = 20.0


class Bench:
    """A robot's registrar with timers that a test lets run out."""

    def __init__(self):
        self.errors = []
        self.done = []
        self.timers = []
        self.worker = Worker("bench", 10000, self.errors.append)
        self.registrar = RobotRegistrar(
            self.worker, lambda delay_s, call: self.timers.append((delay_s, call))
        )

    def submit(self, number, always=False):
        return self.registrar.submit(lambda: self.done.append(number), always)

    def wait(self):
        """Return what was done once the worker has nothing left to do."""
        reached = threading.Event()
        assert self.worker.submit(reached.set)
        assert reached.wait(DEADLINE_S)
        assert not self.errors
        return self.done

    def hold_worker(self):
        """Keep the worker busy; return what lets it go on."""
        gate = threading.Event()
        self.worker.submit(lambda: gate.wait(DEADLINE_S))
        return gate.set


def test_jobs_are_done_at_once_where_nothing_is_held_back():
    bench = Bench()
    bench.registrar.begin(0.0)
    assert bench.submit(1)
    assert bench.submit(2)
    assert bench.wait() == [1, 2]
    assert not bench.timers


def test_jobs_that_are_held_back_are_done_in_order_when_the_robot_has_stayed():
    bench = Bench()
    bench.registrar.begin(1.5)
    assert bench.submit(1)
    assert bench.submit(2)
    assert bench.wait() == []
    ((delay_s, let_go),) = bench.timers
    assert delay_s == 1.5
    let_go()
    assert bench.submit(3)
    assert bench.wait() == [1, 2, 3]


def test_a_robot_that_leaves_before_costs_nothing():
    bench = Bench()
    bench.registrar.begin(1.0)
    bench.submit(1)
    bench.registrar.end()
    bench.timers[0][1]()
    assert bench.wait() == []


def test_a_robot_that_returned_meanwhile_is_held_back_anew():
    bench = Bench()
    bench.registrar.begin(1.0)
    bench.submit(1)
    bench.registrar.end()
    bench.registrar.begin(1.0)
    bench.submit(2)
    bench.timers[0][1]()
    assert bench.wait() == []
    bench.timers[1][1]()
    assert bench.wait() == [2]


def test_jobs_that_wait_for_others_go_with_the_connection():
    bench = Bench()
    let_go = bench.hold_worker()
    bench.registrar.begin(0.0)
    bench.submit(1)
    bench.registrar.end()
    bench.registrar.begin(0.0)
    bench.submit(2)
    let_go()
    assert bench.wait() == [2]


def test_what_has_to_be_done_is_done_without_a_connection_and_while_others_are_held_back():
    bench = Bench()
    bench.registrar.begin(1.0)
    bench.submit(1)
    assert bench.submit(2, always=True)
    bench.registrar.end()
    assert bench.submit(3, always=True)
    assert bench.wait() == [2, 3]


def test_no_more_than_so_many_jobs_are_held_back():
    bench = Bench()
    bench.registrar.begin(1.0)
    assert all(bench.submit(number) for number in range(HELD_MAX))
    assert not bench.submit(HELD_MAX)
    bench.timers[0][1]()
    assert bench.wait() == list(range(HELD_MAX))
