"""Notices that a thread could not start, or ran out of memory: on rospy's threads that would only be a traceback.

Without a thread for each connection and call, robots would join while some program's stops go unheard.
"""

import threading
from typing import Any

from hero_node.ros import HANDSHAKE

REMEDY = "free memory, or raise the limits of threads and memory (ulimit -u and -v, TasksMax), and start again"

NO_THREAD = "can't start new thread"
"""Python's RuntimeError where the system has no thread left."""


class ThreadWatch:
    """All threads of this process, from now on; failure: what went wrong first, with a remedy, for users."""

    def __init__(self) -> None:
        self.failure = ""
        start, report = threading.Thread.start, threading.excepthook

        def start_or_tell(thread: threading.Thread) -> None:
            try:
                start(thread)
            except RuntimeError as error:
                if thread.name != HANDSHAKE:
                    self.note(error)
                raise

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
