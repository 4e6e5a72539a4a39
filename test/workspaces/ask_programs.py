"""Runs programs with --help and with an unknown argument; prints the exit status, output and errors of each, in JSON.

Usage: ask_programs.py PROGRAM ...
Each runs in children of this process, which has imported what takes long.
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


def ask_once_loaded(program):
    """Return what ask() does for each argument; what the program imports is imported once."""
    with tempfile.TemporaryFile("w+") as answers:
        child = os.fork()
        if not child:
            try:
                runpy.run_path(program, run_name="loaded")
                json.dump([ask(program, "--help"), ask(program, "--unknown")], answers)
                answers.flush()
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        answers.seek(0)
        return json.load(answers)


if __name__ == "__main__":
    print(json.dumps({name: ask_once_loaded(name) for name in sys.argv[1:]}))
