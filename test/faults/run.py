"""Runs the families of the fault suite, each with its own ROS master, and prints one table.

Usage: run.py RESULTS_DIR [--minutes N] [FAMILY ...]
Without --minutes: the short form, two families at once. With it: the long form, one family after another, in
rounds until so many minutes are over, at least one; a round of `endurance` takes these minutes by itself. The
workspace must be sourced.
"""

import argparse
import concurrent.futures
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SHORT_TIMEOUT_S = 300.0
LONG_TIMEOUT_S = 4 * 3600.0
SHORT_AT_ONCE = 2  # most of a fault is waiting
NETWORK_FAMILY = "network"

sys.path.insert(0, str(HERE.parent))
from results import count_results, record  # noqa: E402


def find_families():
    """Return the names of all families, the longest first."""
    order = ("process", "network", "stop", "isolation", "ros_side")
    names = sorted(path.stem[len("test_") :] for path in HERE.glob("test_*.py"))
    return [name for name in order if name in names] + [name for name in names if name not in order]


def make_own_network():
    """Return a command that gives a program a network of its own, empty where this system does not permit that."""
    command = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    try:
        subprocess.run([*command, "true"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError):
        return []
    return command


def run_family(family, results_dir, table, arguments, timeout_s):
    """Run one family; return its exit code and the end of its output."""
    results_dir.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "pytest", "-q", "-x" if "--long" in arguments else "--color=no"]
    command += [str(HERE / ("test_%s.py" % family)), "-s", "--junitxml", str(results_dir / (family + ".xml"))]
    command += ["--table", str(table), "-p", "no:cacheprovider", *arguments]
    environment = dict(os.environ)
    if family == NETWORK_FAMILY:
        own_network = make_own_network()
        command = own_network + command
        environment["HERO_OWN_NETWORK"] = "yes" if own_network else "no"
    log_path = results_dir / (family + ".log")
    with open(log_path, "wb") as log:
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            code = process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            log.write(b"\nno end: killed\n")
            code = -1
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    if code != 0 and not count_results(results_dir).failures:
        record(results_dir, "%s ends without an error" % family, True)
    return code, log_path.read_text(errors="replace").splitlines()[-60:]


def read_rows(path):
    """Return the rows of the table, the tries of one fault added up, in the order of their first try."""
    rows = {}
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            known = rows.setdefault(row["fault"], dict(row, tried=0, survived=0))
            known["tried"] += row["tried"]
            known["survived"] += row["survived"]
            known["lost"] = row["lost"]
    return list(rows.values())


def print_table(rows):
    """Print the table: fault, times tried, times survived, what was lost."""
    print("\n| fault | tried | survived | lost |\n|---|---|---|---|")
    for row in rows:
        print("| %(fault)s | %(tried)d | %(survived)d | %(lost)s |" % row)
    sys.stdout.flush()


def main():
    """Run from the command line; return the exit code."""
    families = find_families()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--minutes", type=float, default=0.0)
    parser.add_argument("families", nargs="*", metavar="FAMILY", help=", ".join(families))
    # parse_args() takes no families after an option.
    options = parser.parse_intermixed_args()
    unknown = sorted(set(options.families) - set(families))
    if unknown:
        parser.error("no such family: %s; there are: %s" % (", ".join(unknown), ", ".join(families)))
    chosen = options.families or families
    is_long = options.minutes > 0.0
    arguments = ["--long", "--minutes", str(options.minutes)] if is_long else []
    failed = False
    end_s = time.monotonic() + 60.0 * options.minutes
    round_number = 0
    options.results.mkdir(parents=True, exist_ok=True)
    table = options.results / "table.jsonl"
    if table.exists():
        table.unlink()
    while True:
        round_number += 1
        results_dir = options.results / ("round_%d" % round_number) if is_long else options.results
        with concurrent.futures.ThreadPoolExecutor(1 if is_long else SHORT_AT_ONCE) as pool:
            timeout_s = LONG_TIMEOUT_S + 60.0 * options.minutes if is_long else SHORT_TIMEOUT_S
            runs = {
                pool.submit(run_family, name, results_dir, table, arguments, timeout_s): name
                for name in chosen
            }
            start_s = time.monotonic()
            for run in concurrent.futures.as_completed(runs):
                code, output = run.result()
                failed = failed or code != 0
                print(
                    "faults: %s ... %s after %.1f s"
                    % (runs[run], "FAILED" if code else "ok", time.monotonic() - start_s),
                    flush=True,
                )
                if code:
                    print("\n".join("    " + line for line in output), flush=True)
        print_table(read_rows(table))
        if failed or time.monotonic() >= end_s:
            return int(failed)


if __name__ == "__main__":
    sys.exit(main())
