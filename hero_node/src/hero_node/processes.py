"""Ends programs that this one has started."""

import signal
import subprocess
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
