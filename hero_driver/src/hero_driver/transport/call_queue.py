"""Work handed between threads: a bounded queue of calls, made in order; when it is full, new ones are refused."""

import collections
import contextlib
import threading
from typing import Callable, Deque

Call = Callable[[], object]

SHUTDOWN_WAIT_S = 0.5


class CallQueue:
    """Calls for one thread, from any other: `waiting`, to be looked at only, and the number of `refused` ones."""

    def __init__(self, length_max: int, wake: Call, on_error: Callable[[BaseException], None]) -> None:
        """wake() is called after each new call, on its sender's thread; on_error gets what a call raises."""
        self.waiting: Deque[Call] = collections.deque()
        self._length_max = length_max
        self._wake = wake
        self._on_error = on_error
        self._lock = threading.Lock()
        self._closed = False
        self.refused = 0

    def submit(self, call: Call, always: bool = False) -> bool:
        """Queue call; return False, and count it, if too many wait (unless always) or the queue is closed."""
        with self._lock:
            if self._closed or (len(self.waiting) >= self._length_max and not always):
                self.refused += 1
                return False
            self.waiting.append(call)
        self._wake()
        return True

    def make_calls(self) -> None:
        """Make the calls that wait now; what they submit in turn waits for the next time."""
        for _ in range(len(self.waiting)):
            with self._lock:
                if not self.waiting:
                    return
                call = self.waiting.popleft()
            try:
                call()
            except BaseException as error:  # noqa: BLE001 - not even SystemExit may end the thread that serves all
                # Where it would be told (a terminal, a disk) may be what is broken.
                with contextlib.suppress(Exception):
                    self._on_error(error)

    def close(self, drain: bool = False) -> None:
        """Refuse new calls, and forget those that wait unless they are to be drained; may be called twice."""
        with self._lock:
            self._closed = True
            if not drain:
                self.waiting.clear()
        self._wake()


class Worker(CallQueue):
    """A thread for what can block (the ROS master, files, terminals): it makes the calls of its queue."""

    def __init__(self, name: str, queue_length: int, failure: str, tell: Callable[[str], None]) -> None:
        """Start it; tell() is told of a call's failure and what it raised, and the next call is made all the same."""
        self._ready = threading.Event()
        super().__init__(
            queue_length, self._ready.set, lambda error: tell(f"{failure}: {type(error).__name__}: {error}")
        )
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
