"""The exit status of the simulator, and its output, which may be a closed pipe or a full disk."""

import errno
import os
import signal
import sys
from typing import Callable

from .errors import SimulatorError

__all__ = ["FAILED", "WRONG_ARGUMENTS", "call"]

FAILED = 1
WRONG_ARGUMENTS = 2
"""As argparse ends."""

PIPE_CLOSED = 128 + signal.SIGPIPE
"""What a shell reports of any program that a closed pipe ends."""

_OUTPUT_ERRORS = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def call(run: Callable[[], None], program: str = "hero_sim") -> int:
    """Return the exit status of run(), which may raise SimulatorError or exit as argparse does.

    program: the name before what is printed to stderr.
    """
    status = 0
    try:
        try:
            run()
        except SimulatorError as error:
            return _fail(program, str(error))
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
        return _fail(program, "the output cannot be written: %s" % error.strerror)
    return status


def _fail(program: str, text: str) -> int:
    print("%s: %s" % (program, text), file=sys.stderr)
    return FAILED
