"""Threads for what can block (the ROS master, files, terminals): the thread of the sockets never waits for them."""

import threading
from typing import Callable

from ..transport import CallQueue

SHUTDOWN_WAIT_S = 0.5


class Worker:
    """A thread that makes the calls of its queue, one after another."""

    def __init__(self, name: str, queue_length: int, on_error: Callable[[BaseException], None]) -> None:
        """on_error gets what a call raises, on the worker's thread; the next call is made all the same."""
        self._ready = threading.Event()
        self._ended = False
        self._calls = CallQueue(queue_length, self._ready.set, on_error)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def refused(self) -> int:
        """Number of calls refused because too many waited or the worker was closed."""
        return self._calls.refused

    def submit(self, call: Callable[[], None], always: bool = False) -> bool:
        """Queue call; return False if too many wait (unless always) or the worker is closed."""
        return self._calls.submit(call, always)

    def end(self, drain: bool = False) -> None:
        """End the thread, with drain after the calls that wait, without waiting for it."""
        self._ended = True
        self._calls.close(drain)

    def close(self, drain: bool = False) -> None:
        """End the thread and wait for it a little; one that hangs is left behind. Safe twice."""
        self.end(drain)
        if self._thread is not threading.current_thread():
            self._thread.join(SHUTDOWN_WAIT_S)

    def _run(self) -> None:
        while not self._ended or self._calls.waiting:
            self._ready.wait()
            self._ready.clear()
            self._calls.make_calls()
