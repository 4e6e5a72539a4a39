"""The simulator's exit status, whatever becomes of its output; wrong numbers on its command line."""

import os
import subprocess
import sys

import pytest

from hero_sim import main

LIMIT_S = 60.0


def run_simulator(*arguments, stdout):
    """Return exit status and what came on stderr."""
    # PYTHONUNBUFFERED: empty is off, so that a text stays in the buffer until the end.
    environment = dict(os.environ, PYTHONUNBUFFERED="", PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    command = [sys.executable, "-m", "hero_sim", *arguments]
    process = subprocess.Popen(command, stdout=stdout, stderr=subprocess.PIPE, text=True, env=environment)
    errors = process.communicate(timeout=LIMIT_S)[1]
    return process.returncode, errors


PRINTING = (["--help"], ["--print-errors"], ["--port", "9"])


@pytest.mark.slow
@pytest.mark.parametrize("arguments", PRINTING)
def test_a_closed_pipe_ends_it_silently(arguments):
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "wb") as pipe:
        assert run_simulator(*arguments, stdout=pipe) == (141, "")


@pytest.mark.slow
@pytest.mark.parametrize("arguments", PRINTING)
def test_a_full_disk_is_reported_in_one_line(arguments):
    with open("/dev/full", "wb") as full:
        status, errors = run_simulator(*arguments, stdout=full)
    assert (status, errors) == (1, "hero_sim: the output cannot be written: No space left on device\n")


@pytest.mark.parametrize(
    "option, value",
    [
        *(("--seconds", value) for value in ("inf", "nan", "-1", "0", "1e999", "1e300")),
        *(("--speed", value) for value in ("inf", "nan", "-1")),
        *(("--count", value) for value in ("-1", "0", "9" * 30)),
        *(("--port", value) for value in ("-1", "0", "99999", "9" * 30)),
        *(("--seed", value) for value in ("-1", "9" * 30)),
        *(("--first-id", value) for value in ("-1", "2147483648", "9" * 30)),
        *(("--fault", value) for value in ("vanish@inf", "vanish@nan", "vanish:for=inf", "vanish:robot=1e400")),
    ],
)
def test_a_number_out_of_range_is_named_with_status_2(option, value, capsys):
    assert main.main(["%s=%s" % (option, value)]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("hero_sim: ")
    assert option.strip("-") in line
