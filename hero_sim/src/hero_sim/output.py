"""The output of the simulator, which may be a closed pipe or a full disk, and its exit status."""

import errno
import os
import signal
import sys
from typing import Callable

__all__ = ["WRONG_ARGUMENTS", "call", "fail"]

FAILED = 1
WRONG_ARGUMENTS = 2
"""As argparse ends."""

PIPE_CLOSED = 128 + signal.SIGPIPE
"""What a shell reports of any program that a closed pipe ends."""

_OUTPUT_ERRORS = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def fail(text: str, status: int = FAILED) -> int:
    """Print a line with the program's name to stderr; return the exit status."""
    print("hero_sim: " + text, file=sys.stderr)
    return status


def call(run: Callable[[], int]) -> int:
    """Return the exit status of run(), which includes that of its output; exits by argparse count, too."""
    try:
        try:
            status = run()
        except SystemExit as end:
            if not isinstance(end.code, int):
                raise
            status = end.code
        if sys.stdout is not None:
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
