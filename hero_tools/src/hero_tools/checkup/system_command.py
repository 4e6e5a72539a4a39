"""A command of the system -> its exit code and output, or why there is none."""

import os
import subprocess
from typing import NamedTuple, Sequence

# Where administration tools lie, which the PATH of a user leaves out on Debian.
TOOL_PATH = "/usr/sbin:/sbin"
NOT_THERE = 127


class Answer(NamedTuple):
    """How a command ended; code NOT_THERE: there is no such command; -1: it did not end in time."""

    code: int
    output: str
    errors: str


def ask_system(command: Sequence[str], timeout_s: float = 0.9) -> Answer:
    """Run a command that only reads, without a terminal and in English."""
    environment = dict(os.environ, LC_ALL="C", PATH="%s:%s" % (os.environ.get("PATH", ""), TOOL_PATH))
    try:
        result = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=environment,
            timeout=timeout_s,
            check=False,
        )
    except OSError as error:
        return Answer(NOT_THERE, "", str(error))
    except subprocess.TimeoutExpired:
        return Answer(-1, "", "%s did not end within %g s" % (command[0], timeout_s))
    return Answer(
        result.returncode, result.stdout.decode(errors="replace"), result.stderr.decode(errors="replace")
    )
