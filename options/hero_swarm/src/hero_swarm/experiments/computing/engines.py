"""Workers that compute batches: processes of this machine, or a Dask cluster. Both are an Executor.

Knows nothing of experiments: it calls a function with arguments, and survives workers that die.
"""

import collections
import multiprocessing
import os
import signal
import threading
from concurrent import futures
from typing import Any, Callable, Deque, Dict, Iterable, Iterator, Tuple

from hero_node import import_optional, is_loopback, one_line

from ..errors import ExperimentError

MAX_NEW_POOLS = 3
"""Worker pools that are started in place of broken ones; a batch that kills its worker would do so for ever."""

DASK_RETRIES = 3

DASK_TIMEOUT_S = 20.0
"""A cluster that is started at the same time has workers by then."""

_WAITING = 2
"""Batches that wait for each worker: none idles while results are written, and few are lost by a kill."""

Task = Tuple[Any, ...]


def open_pool(jobs: int) -> futures.ProcessPoolExecutor:
    """Return a pool of jobs workers that start from nothing: threads of this process are no danger to them."""
    return futures.ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), _prepare_worker)


def _prepare_worker() -> None:
    """Leave Ctrl-C to the program, which ends its workers, and end when the program is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, name="end with the program", daemon=True).start()


def open_dask(address: str, check: Callable[[], str]) -> Tuple[futures.Executor, int]:
    """Return an executor on the cluster at address (tls://HOST:PORT, or the path of a scheduler file), and its workers.

    check() returns which code a process runs; a worker on which it differs is refused.
    Raises: ProgramError without dask. ExperimentError without a cluster, for a worker with other code, and for a
    scheduler or worker that other PCs reach without TLS.
    """
    distributed = import_optional("distributed", "python3-distributed")
    is_address = "://" in address
    if is_address:
        _check_reach([address])
    if not is_address and not os.path.isfile(address):  # Dask would wait for it without end
        text = "no Dask scheduler file %s (an address is tls://HOST:PORT): start dask-scheduler --scheduler-file %s"
        raise ExperimentError(text % (address, address))
    try:
        client = distributed.Client(
            address if is_address else None, scheduler_file=None if is_address else address, timeout=DASK_TIMEOUT_S
        )
        client.wait_for_workers(1, timeout=DASK_TIMEOUT_S)
        threads = client.nthreads()
        scheduler = client.scheduler_info()["address"]
    except (OSError, TypeError, ValueError, distributed.TimeoutError) as error:  # TypeError: TLS without certificates
        text = "no Dask cluster with workers at %s (%s): start dask-scheduler and dask-worker"
        raise ExperimentError(text % (address, one_line(error))) from error
    _check_reach([scheduler, *threads])
    own = check()
    try:
        codes = client.run(check)
    except Exception as error:  # Dask passes on what a worker raises, and for a missing module a plain Exception
        text = "workers at %s cannot run this (%s): start them in the same folder, in a terminal where `run` works"
        raise ExperimentError(text % (address, one_line(error))) from error
    for worker, code in sorted(codes.items()):
        if threads[worker] > 1:  # they wait for each other, and would share streams of random numbers
            raise ExperimentError("worker %s has %d threads: start it with --nthreads 1" % (worker, threads[worker]))
        if code != own:
            raise ExperimentError(f"worker {worker} runs other code ({code}, here {own}): update it and start it again")
    return client.get_executor(pure=False, retries=DASK_RETRIES), len(codes)


def _check_reach(addresses: Iterable[str]) -> None:
    """Check that what other PCs can reach has TLS. Raises: ExperimentError."""
    for address in addresses:
        protocol, _, place = address.partition("://")
        if protocol != "tls" and not is_loopback(place.rpartition(":")[0]):
            text = "Dask at %s lets all who reach it run code there: use TLS, or --host 127.0.0.1 (docs/experiments.md)"
            raise ExperimentError(text % address)


class Engine:
    """Workers that compute tasks; the executor that open_executor gives is replaced when it breaks."""

    def __init__(self, open_executor: Callable[[], futures.Executor], workers: int) -> None:
        """Start nothing yet; workers: how many an executor has."""
        self.workers, self._open = workers, open_executor

    def __enter__(self) -> "Engine":
        self._executor = self._open()
        return self

    def __exit__(self, *_: Any) -> None:
        self._executor.shutdown(wait=True)

    def compute(self, function: Callable[..., Any], tasks: Iterable[Task]) -> Iterator[Tuple[Task, Any]]:
        """Yield each task with function(*task), as they are done; those of a broken executor run again.

        Raises: ExperimentError if executors keep breaking, or the cluster ends; whatever function raises.
        """
        left: Deque[Task] = collections.deque(tasks)
        replaced = 0
        while left:
            running: Dict[futures.Future[Any], Task] = {}
            try:
                while left or running:
                    while left and len(running) < self.workers * _WAITING:
                        running[self._executor.submit(function, *left[0])] = left[0]
                        left.popleft()
                    done = futures.wait(running, return_when=futures.FIRST_COMPLETED).done
                    # Errors last: what is done beside them is kept.
                    for future in sorted(done, key=lambda one: one.cancelled() or one.exception() is not None):
                        result = future.result()
                        yield running.pop(future), result
            except futures.BrokenExecutor as error:
                replaced += 1
                if replaced > MAX_NEW_POOLS:
                    text = "worker processes died %d times (out of memory?): use fewer --jobs; what is done is kept"
                    raise ExperimentError(text % replaced) from error
                left.extendleft(running.values())
                self.__exit__()
                self.__enter__()
            except futures.CancelledError as error:
                text = "the Dask cluster ended: start it again, and then this; what is done is kept"
                raise ExperimentError(text) from error
            except Exception as error:
                # Dask's own errors, without importing it for a pool: above all KilledWorker.
                if not type(error).__module__.startswith("distributed."):
                    raise
                text = "Dask gave up a batch (out of memory? use a smaller --batch; what is done is kept): %s"
                raise ExperimentError(text % one_line(error)) from error
            finally:
                for future in running:
                    future.cancel()
