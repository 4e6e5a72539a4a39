"""Ends programs that this one has started, and raises the limit of its open files."""

import resource
import signal
import subprocess
import sys
from contextlib import suppress

TERM_TIMEOUT_S = 2.0


def end_process(process: "subprocess.Popen[bytes]", patience_s: float) -> int:
    """End a process with SIGINT; by force if it takes longer than patience_s; return its exit code."""
    for number, timeout_s in ((signal.SIGINT, patience_s), (signal.SIGTERM, TERM_TIMEOUT_S)):
        process.send_signal(number)
        with suppress(subprocess.TimeoutExpired):
            return process.wait(timeout_s)
    process.kill()
    return process.wait()


def raise_file_limit() -> int:
    """Raise the limit of open files, of which every connection takes one, to what needs no privileges; return it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return sys.maxsize if hard == resource.RLIM_INFINITY else hard
