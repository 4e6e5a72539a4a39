"""Batches on worker processes: all are computed once, whatever workers do."""

import functools
import os
import signal
import sys
import types
from concurrent.futures import BrokenExecutor, Executor, Future

import pytest

from hero_node import ProgramError
from hero_swarm.experiments.computing import engines
from hero_swarm.experiments.errors import ExperimentError

open_one = functools.partial(engines.open_pool, 1)


def square(number):
    return number * number


def square_but_die_once(number, folder):
    """Kill the worker the first time that number 3 is computed."""
    marker = os.path.join(folder, "died")
    if number == 3 and not os.path.exists(marker):
        with open(marker, "w"):
            os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def fail(number):
    raise ValueError("of number %d" % number)


def compute(open_executor, workers, function, tasks):
    with engines.Engine(open_executor, workers) as engine:
        return list(engine.compute(function, tasks))


@pytest.mark.slow
def test_tasks_of_a_killed_worker_run_again_and_all_run_once(tmp_path):
    tasks = [(number, str(tmp_path)) for number in range(8)]
    done = compute(open_one, 1, square_but_die_once, tasks)
    assert sorted(done) == [(task, task[0] * task[0]) for task in tasks]
    assert os.path.exists(str(tmp_path / "died"))


class PoolThatBreaks(Executor):
    """Computes so many tasks at once, and breaks while the next one is handed in."""

    def __init__(self, tasks):
        self.left = tasks

    def submit(self, function, *arguments):
        if not self.left:
            raise BrokenExecutor("a worker died")
        self.left -= 1
        future = Future()
        future.set_result(function(*arguments))
        return future


@pytest.mark.slow
@pytest.mark.parametrize("tasks", range(4))
def test_a_pool_that_breaks_while_it_takes_a_task_loses_none(tasks):
    pools = iter((PoolThatBreaks(tasks), PoolThatBreaks(99)))
    done = compute(lambda: next(pools), 2, square, [(number,) for number in range(6)])
    assert sorted(done) == [((number,), number * number) for number in range(6)]


@pytest.mark.slow
def test_a_task_that_always_kills_its_worker_ends_with_an_error(monkeypatch):
    monkeypatch.setattr(engines, "MAX_NEW_POOLS", 1)
    with pytest.raises(ExperimentError, match="worker processes died 2 times"):
        compute(open_one, 1, die, [(1,)])


@pytest.mark.slow
def test_an_error_of_the_users_code_reaches_the_program():
    with pytest.raises(ValueError, match="of number 4"):
        compute(open_one, 1, fail, [(4,)])


class DoneAtOnce(Executor):
    """Has all results when it is asked; number 0 fails."""

    def submit(self, function, *arguments):
        future = Future()
        if arguments == (0,):
            future.set_exception(ValueError("of number 0"))
        else:
            future.set_result(function(*arguments))
        return future


def test_what_is_done_beside_an_error_is_kept():
    kept = []
    with engines.Engine(DoneAtOnce, 4) as engine, pytest.raises(ValueError, match="of number 0"):
        for _, result in engine.compute(square, [(number,) for number in range(8)]):
            kept.append(result)
    assert sorted(kept) == [1, 4, 9, 16, 25, 36, 49]


def test_a_worker_leaves_ctrl_c_to_the_program_and_ends_with_it(monkeypatch):
    began = []

    class Thread:
        def __init__(self, target, name, daemon):
            self.start = lambda: began.append((target, name, daemon, signal.getsignal(signal.SIGINT)))

    parent = types.SimpleNamespace(join=lambda: began.append("joined"))
    monkeypatch.setattr(engines.threading, "Thread", Thread)
    monkeypatch.setattr(engines.multiprocessing, "parent_process", lambda: parent)
    monkeypatch.setattr(engines.os, "_exit", began.append)
    before = signal.getsignal(signal.SIGINT)
    try:
        engines._prepare_worker()
    finally:
        signal.signal(signal.SIGINT, before)
    ((follow, name, daemon, ctrl_c),) = began
    assert (name, daemon, ctrl_c) == ("end with the program", True, signal.SIG_IGN)
    follow()
    assert began[1:] == ["joined", 1]


class Slow(Executor):
    """Is done with number 0 alone, by an error or not; holds what waits."""

    def __init__(self, error):
        self.error, self.waiting = error, []

    def submit(self, function, *arguments):
        future = Future()
        self.waiting.append(future)
        if arguments == (0,) and self.error:
            future.set_exception(self.error)
        elif arguments == (0,):
            future.set_result(0)
        return future


@pytest.mark.parametrize("error", [ValueError("of number 0"), None])
def test_batches_that_wait_are_cancelled_by_an_error_and_by_ctrl_c(error):
    slow = Slow(error)
    with engines.Engine(lambda: slow, 2) as engine:
        computed = engine.compute(square, [(number,) for number in range(9)])
        if error:
            with pytest.raises(ValueError, match="of number 0"):
                next(computed)
        else:
            assert next(computed) == ((0,), 0) and len(slow.waiting) == 4, "two for each worker"
            computed.close()
    assert [future.cancelled() for future in slow.waiting] == [False, True, True, True]


def test_without_dask_the_error_names_its_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ProgramError, match="python3-distributed"):
        engines.open_dask("tcp://127.0.0.1:1", lambda: "")


class EndedCluster(Executor):
    def submit(self, function, *arguments):
        future = Future()
        future.cancel()
        future.set_running_or_notify_cancel()
        return future


def test_a_cluster_that_ends_meanwhile_is_one_line():
    with pytest.raises(ExperimentError, match="the Dask cluster ended: .* what is done is kept"):
        compute(EndedCluster, 1, square, [(1,)])


class KilledWorker(Exception):  # noqa: N818 - as Dask names it
    __module__ = "distributed.scheduler"


class KillingCluster(Executor):
    def submit(self, function, *arguments):
        future = Future()
        future.set_exception(KilledWorker("all those workers died\nwhile running it"))
        return future


def test_a_batch_that_dask_gives_up_is_one_line():
    with pytest.raises(ExperimentError, match="Dask gave up a batch .*: all those workers died while running it$"):
        compute(KillingCluster, 1, square, [(1,)])


class ArrivalError(Exception):
    pass


class Cluster:
    """Stands for a cluster that arrives too late, or for one with a worker of some threads."""

    threads = 0
    code = "abc"
    scheduler, worker = "tcp://127.0.0.1:1", "tcp://127.0.0.1:2"

    def __init__(self, address, scheduler_file, timeout):
        assert (address is None) != (scheduler_file is None) and timeout == 20.0

    def wait_for_workers(self, count, timeout):
        assert (count, timeout) == (1, 20.0)
        if not self.threads:
            raise ArrivalError("Only 0/1 workers arrived after 20s")

    def run(self, check):
        if not self.code:
            raise Exception("ModuleNotFoundError(hero_swarm)")  # as Dask raises it
        return {self.worker: self.code}

    def nthreads(self):
        return {self.worker: self.threads}

    def scheduler_info(self):
        return {"address": self.scheduler}

    def get_executor(self, pure, retries):
        assert not pure, "equal tasks may give other results"
        assert retries == 3, "a batch outlives the loss of a worker"
        return "executor"


def test_dask_clusters_that_cannot_be_used_are_refused_with_the_remedy(monkeypatch):
    stub = types.SimpleNamespace(Client=Cluster, TimeoutError=ArrivalError)
    monkeypatch.setitem(sys.modules, "distributed", stub)
    text = "no Dask scheduler file no.json .an address is tls:.*: start .* --scheduler-file no.json$"
    with pytest.raises(ExperimentError, match=text):
        engines.open_dask("no.json", lambda: "abc")
    with pytest.raises(ExperimentError, match="at tcp://127.0.0.1:1 .Only 0/1 .*: start dask-scheduler and .*worker$"):
        engines.open_dask("tcp://127.0.0.1:1", lambda: "abc")
    monkeypatch.setattr(Cluster, "threads", 2)
    with pytest.raises(ExperimentError, match="worker tcp://127.0.0.1:2 has 2 threads: start it with --nthreads 1$"):
        engines.open_dask("tcp://127.0.0.1:1", lambda: "abc")
    monkeypatch.setattr(Cluster, "threads", 1)
    with pytest.raises(ExperimentError, match=r"worker tcp://127.0.0.1:2 runs other code \(abc, here abd\)"):
        engines.open_dask("tcp://127.0.0.1:1", lambda: "abd")
    assert engines.open_dask("tcp://127.0.0.1:1", lambda: "abc") == ("executor", 1)
    monkeypatch.setattr(Cluster, "code", "")
    with pytest.raises(ExperimentError, match=r"at tcp://127.0.0.1:1 cannot run this \(ModuleNotFound.*: start them"):
        engines.open_dask("tcp://127.0.0.1:1", lambda: "abc")


@pytest.mark.parametrize(
    "wide", ["tcp://10.0.0.5:8786", "tcp://[2001:db8::5]:8786", "tcp://pc:8786", "ucx://10.0.0.5:1"]
)
def test_a_cluster_that_other_pcs_reach_needs_tls(wide, monkeypatch):
    stub = types.SimpleNamespace(Client=Cluster, TimeoutError=ArrivalError)
    monkeypatch.setitem(sys.modules, "distributed", stub)
    monkeypatch.setattr(Cluster, "threads", 1)
    for own in ("tcp://127.0.0.1:1", "tcp://localhost:1", "tcp://[::1]:1", wide.replace(wide[:3], "tls")):
        assert engines.open_dask(own, lambda: "abc")[1] == 1
    with pytest.raises(ExperimentError, match="Dask at .* lets all who reach it run code there: use TLS"):
        engines.open_dask(wide, lambda: "abc")
    for name in ("scheduler", "worker"):
        with monkeypatch.context() as patch, pytest.raises(ExperimentError, match="lets all who reach it run code"):
            patch.setattr(Cluster, name, wide)
            engines.open_dask("tcp://127.0.0.1:1", lambda: "abc")
