"""Runs programs with --help and with an unknown argument; prints the exit status, output and errors of each, in JSON.

Usage: ask_programs.py PROGRAM ...
Each runs in a child of this process, which has imported what takes long.
"""

import json
import os
import runpy
import sys
import tempfile

import numpy  # noqa: F401
import rospy  # noqa: F401


def ask(program, argument):
    """Return the exit status, output and errors of a program with one argument."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        child = os.fork()
        if not child:
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            os.dup2(output.fileno(), 1)
            os.dup2(errors.fileno(), 2)
            sys.argv = [program, argument]
            status = 1
            try:
                runpy.run_path(program, run_name="__main__")
                status = 0
            except SystemExit as ended:
                status = ended.code or 0
                if isinstance(status, str):
                    print(status, file=sys.stderr)
                    status = 1
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(status)
        _, status = os.waitpid(child, 0)
        output.seek(0)
        errors.seek(0)
        return os.WEXITSTATUS(status), output.read(), errors.read()


if __name__ == "__main__":
    print(json.dumps({name: [ask(name, "--help"), ask(name, "--unknown")] for name in sys.argv[1:]}))
