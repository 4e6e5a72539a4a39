"""Runs a program that a page has started; ends it when the monitor asks for that, hangs or dies.

    python3 -m hero_monitor.control.guard PATIENCE_S PROGRAM [ARGUMENT ...]

The monitor writes to the guard's stdin several times a second. The end of that pipe, or silence, ends the program:
with SIGINT, on which it stops its robots, and by force after PATIENCE_S.
"""

import os
import select
import signal
import subprocess
import sys
from typing import Sequence

from hero_node import end_process

POLL_S = 0.1
SILENT_POLLS = 50
"""Polls without a sign of the monitor, not seconds: a guard that was kept from running has not heard it either."""


def guard(command: Sequence[str], patience_s: float) -> int:
    """Run a command until it ends or stdin does; return its exit status."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    # What ends all programs ends this one, too: the program, and with it the guard.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    silent = 0
    while process.poll() is None and silent < SILENT_POLLS:
        readable, _, _ = select.select([0], [], [], POLL_S)
        silent = 0 if readable else silent + 1
        if readable and not os.read(0, 4096):
            break
    code = process.poll()
    if code is None:
        code = end_process(process, patience_s)
    return code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(guard(sys.argv[2:], float(sys.argv[1])))
