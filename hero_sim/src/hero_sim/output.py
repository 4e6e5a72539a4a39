"""The exit status of the simulator, and its output, which may be a closed pipe or a full disk."""

import errno
import os
import signal
import sys
from typing import Callable

from .errors import SimulatorError

__all__ = ["FAILED", "WRONG_ARGUMENTS", "call", "fail"]

FAILED = 1
WRONG_ARGUMENTS = 2
"""As argparse ends."""

PIPE_CLOSED = 128 + signal.SIGPIPE
"""What a shell reports of any program that a closed pipe ends."""

_OUTPUT_ERRORS = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def fail(text: str) -> int:
    """Print a line with the program's name to stderr; return the exit status."""
    print("hero_sim: " + text, file=sys.stderr)
    return FAILED


def call(run: Callable[[], None]) -> int:
    """Return the exit status of run(), which may raise SimulatorError or exit as argparse does."""
    status = 0
    try:
        try:
            run()
        except SimulatorError as error:
            return fail(str(error))
        except SystemExit as end:
            if not isinstance(end.code, int):
                raise
            status = end.code
        sys.stdout.flush()
    except OSError as error:
        if error.filename is not None or error.errno not in _OUTPUT_ERRORS:
            raise
        # What is still in the buffer would fail again as the interpreter ends, with a traceback.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:
            return PIPE_CLOSED
        return fail("the output cannot be written: %s" % error.strerror)
    return status
