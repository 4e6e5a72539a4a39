"""Notices that a thread could not start, or ran out of memory: on rospy's threads that would only be a traceback.

rospy starts a thread for each connection to a program and each call from one, and one that registers the node. Without
any of them robots would join while some program's commands and stops go unheard.
"""

import math
import threading
import time
from typing import Any

HANDSHAKE = "handshake"
"""Name of threads that handle their failure themselves: the program is refused, and connects again."""

HANDSHAKE_PATIENCE_S = 2.0
"""Time without any such thread after which no program can connect any more: programs try again after 0.5, 1, 2 s."""

REMEDY = "free memory, or raise the limits of threads and memory (ulimit -u and -v, TasksMax), and start again"

NO_THREAD = "can't start new thread"
"""Python's RuntimeError where the system has no thread left."""


class ThreadWatch:
    """All threads of this process, from now on.

    Attributes:
        failure: what went wrong first, with a remedy, for users; empty: nothing.
    """

    def __init__(self) -> None:
        self.failure = ""
        self._refusing_since_s = math.inf
        start, report = threading.Thread.start, threading.excepthook

        def start_or_tell(thread: threading.Thread) -> None:
            is_handshake = thread.name == HANDSHAKE
            try:
                start(thread)
            except RuntimeError as error:
                now_s = time.monotonic()
                self._refusing_since_s = min(self._refusing_since_s, now_s if is_handshake else math.inf)
                if not is_handshake or now_s - self._refusing_since_s >= HANDSHAKE_PATIENCE_S:
                    self.note(error)
                raise
            if is_handshake:
                self._refusing_since_s = math.inf

        def report_thread(arguments: Any) -> None:
            if not self.note(arguments.exc_value):
                report(arguments)

        threading.Thread.start = start_or_tell  # type: ignore[method-assign, assignment]
        threading.excepthook = report_thread

    def note(self, error: BaseException) -> bool:
        """Return whether error is a lack of threads or memory; the first one is kept."""
        if isinstance(error, RuntimeError) and NO_THREAD in str(error):
            lack = "no thread can be started"
        elif isinstance(error, MemoryError):
            lack = "there is no memory"
        else:
            return False
        self.failure = self.failure or f"{lack}: {REMEDY}"
        return True
