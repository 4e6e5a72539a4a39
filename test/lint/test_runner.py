"""What runs the tests: it ends all that it started, refuses names without a match, and knows its own lists."""

import ast
import os
import signal
import subprocess
import sys
import time

import pytest

import run_stages
import sources
from mutation import equivalents, mutations

TEST = sources.ROOT / "test"
STARTS_SLEEPERS = (
    "import subprocess, time; subprocess.Popen(['sleep', '{0}']); subprocess.Popen(['setsid', 'sleep', '{0}'])"
)


def find_processes(text):
    """Return the ids of the processes whose command line contains a text, without zombies."""
    found = []
    for path in [path for path in os.listdir("/proc") if path.isdigit()]:
        try:
            with open(f"/proc/{path}/cmdline", "rb") as file:
                if text.encode() in file.read().replace(b"\0", b" "):
                    found.append(int(path))
        except OSError:
            continue
    return found


def wait_until(condition):
    end_s = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("network", "containers"),
    [(True, "permitted"), (False, "permitted"), (False, "refused")],  # as in Docker
)
def test_sigterm_ends_all_that_jobs_have_started(tmp_path, network, containers):
    duration = f"98765.{os.getpid()}{int(network)}{int(containers == 'refused')}"
    command = (sys.executable, "-c", STARTS_SLEEPERS.format(duration) + "; time.sleep(1000)")
    script = (
        "from pathlib import Path; import jobs; "
        + ("jobs.make_container = lambda has_own_network: (); " if containers == "refused" else "")
        + f"job = jobs.Job('one', {command!r}, Path({str(tmp_path / 'one')!r}), 900.0, has_own_network={network}); "
        "jobs.run_jobs([job], 1.0)"
    )
    with subprocess.Popen([sys.executable, "-c", script], cwd=str(TEST), stderr=subprocess.DEVNULL) as runner:
        wait_until(lambda: len(find_processes(f"sleep {duration}")) >= 2)
        runner.send_signal(signal.SIGTERM)
        assert runner.wait(60.0) != 0
    wait_until(lambda: not find_processes(f"sleep {duration}"))


@pytest.mark.parametrize("stage", ["faults", "workspaces"])
def test_a_pattern_without_a_match_is_an_error(tmp_path, stage):
    command = [sys.executable, str(TEST / "run_stages.py"), str(tmp_path / "results"), f"{stage}=no_such_name"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert "matches 'no_such_name'" in ended.stderr


def test_one_job_builds_the_core_where_two_stages_ask_for_it(tmp_path):
    jobs = run_stages.make_jobs({"workspaces": "", "core": ""}, tmp_path, ())
    (job,) = [job for job in jobs if "test_core.py" in " ".join(job.command)]
    assert "not unit_tests" not in job.command


def test_equivalent_changes_are_neither_stale_nor_greedy():
    assert not equivalents.find_wrong_lines(list(sources.list_source_modules().values()))


def list_changes(code):
    return [found.describe().partition(": ")[2] for found in mutations.list_mutations(ast.parse(code))]


@pytest.mark.parametrize(
    ("code", "change"),
    [
        ("try:\n    go()\nfinally:\n    x = 1", "x = 1 -> pass"),
        ("try:\n    go()\nexcept KeyError:\n    return", "return -> pass"),
        ("for one in all:\n    continue", "continue -> break"),
        ("for one in all:\n    break", "break -> continue"),
        ("go()\nstop()", "go(); stop() -> stop(); go()"),
        ("try:\n    go()\nexcept OSError:\n    0", "except OSError: 0 -> except Exception: 0"),
        ("try:\n    go()\nexcept BaseException:\n    0", "except BaseException: 0 -> except Exception: 0"),
        ("with suppress(OSError):\n    go()", "suppress(OSError) -> suppress(Exception)"),
        ("go(1, retries=3)", "go(1, retries=3) -> go(1)"),
        ("x = BODY_RADIUS_M", "BODY_RADIUS_M -> 0.06"),
        ("x = model.body_radius_m", "model.body_radius_m -> 0.036835"),
    ],
)
def test_script_mutants_makes_each_kind_of_change(code, change):
    assert change in list_changes(code)


def test_statements_of_which_one_needs_the_other_are_not_swapped():
    assert not [change for change in list_changes("x = read()\nshow(x)") if ";" in change]
