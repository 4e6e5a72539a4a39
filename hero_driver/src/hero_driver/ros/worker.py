"""Threads for what can block (the ROS master, files, terminals): the thread of the sockets never waits for them."""

import threading
from typing import Callable

from ..transport.call_queue import CallQueue

SHUTDOWN_WAIT_S = 0.5


class Worker(CallQueue):
    """A thread that makes the calls of its queue, one after another."""

    def __init__(self, name: str, queue_length: int, on_error: Callable[[BaseException], None]) -> None:
        """on_error gets what a call raises, on the worker's thread; the next call is made all the same."""
        self._ready = threading.Event()
        super().__init__(queue_length, self._ready.set, on_error)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def close(self, drain: bool = False) -> None:
        """Refuse new calls, and wait a little for the end of the thread; one that hangs is left behind. Safe twice."""
        super().close(drain)
        if self._thread is not threading.current_thread():
            self._thread.join(SHUTDOWN_WAIT_S)

    def _run(self) -> None:
        while not self._closed or self.waiting:
            self._ready.wait()
            self._ready.clear()
            self.make_calls()
