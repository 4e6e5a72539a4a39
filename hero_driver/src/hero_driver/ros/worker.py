"""Threads for what can block (the ROS master, files, terminals), so that the sockets' thread never does.

A Worker does jobs one after another, in the order in which they came, from a bounded queue.
"""

import collections
import threading
from typing import Callable, Deque, Optional

SHUTDOWN_WAIT_S = 0.5

Job = Callable[[], None]


class Worker:
    """A queue of jobs and the one thread that does them."""

    def __init__(self, name: str, queue_length: int, on_error: Callable[[BaseException], None]) -> None:
        """Hold at most queue_length jobs; on_error gets what a job raises, and the next job is done.

        What on_error raises is counted in lost_errors: there is nobody left to tell.
        """
        self._jobs: Deque[Job] = collections.deque()
        self._queue_length = queue_length
        self._on_error = on_error
        self._ready = threading.Condition()
        self._running = True
        self._thread: Optional[threading.Thread] = None
        self._name = name
        self.refused_jobs = 0
        self.lost_errors = 0

    def submit(self, job: Job, always: bool = False) -> bool:
        """Queue job; return False, and count it, if too many wait (unless always) or the worker is closed."""
        with self._ready:
            if not self._running or (len(self._jobs) >= self._queue_length and not always):
                self.refused_jobs += 1
                return False
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name=self._name, daemon=True)
                self._thread.start()
            self._jobs.append(job)
            self._ready.notify()
            return True

    def close(self, drain: bool = False) -> None:
        """End the thread, with drain after the jobs that wait; one that hangs is left behind. Safe twice."""
        self.end(drain)
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(SHUTDOWN_WAIT_S)

    def end(self, drain: bool = False) -> None:
        """As close(), but without waiting for it."""
        with self._ready:
            self._running = False
            if not drain:
                self._jobs.clear()
            self._ready.notify()

    def _run(self) -> None:
        while True:
            with self._ready:
                while self._running and not self._jobs:
                    self._ready.wait()
                if not self._jobs:
                    return
                job = self._jobs.popleft()
            try:
                job()
            except BaseException as error:  # noqa: BLE001 - not even SystemExit may end the thread of all
                self._report(error)

    def _report(self, error: BaseException) -> None:
        try:
            self._on_error(error)
        except Exception:  # noqa: BLE001 - where it would be told (a terminal, a disk) cannot be written to
            self.lost_errors += 1
