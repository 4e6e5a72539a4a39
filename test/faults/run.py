"""Runs the families of the fault suite, each with its own ROS master, and prints one table.

Usage: run.py RESULTS_DIR [--minutes N] [FAMILY ...]
Without --minutes: the short form, families side by side. With it: the long form, one family after another, in
rounds until so many minutes are over, at least one; a round of `endurance` takes these minutes by itself. The
workspace must be sourced.
"""

import argparse
import json
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SHORT_TIMEOUT_S = 3600.0
LONG_TIMEOUT_S = 4 * 3600.0

sys.path.insert(0, str(HERE.parent))
from jobs import Job, count_cores, run_jobs  # noqa: E402


def find_families():
    """Return the names of all families."""
    return sorted(path.stem[len("test_") :] for path in HERE.glob("test_*.py"))


def make_jobs(results_dir, families, table, long_minutes=0.0):
    """Return one job for each family, in its short form or, with minutes, in its long one."""
    jobs = []
    for family in families:
        own_results = results_dir / family
        command = [sys.executable, "-m", "pytest", "-q", str(HERE / (f"test_{family}.py")), "-s"]
        command += ["--junitxml", str(own_results / (family + ".xml"))]
        command += ["--table", str(table), "-p", "no:cacheprovider"]
        timeout_s = SHORT_TIMEOUT_S
        if long_minutes:
            command += ["-x", "--long", "--minutes", str(long_minutes), "-o", "timeout=0"]
            timeout_s = LONG_TIMEOUT_S + 60.0 * long_minutes
        # Drivers of two families may have the same name: a stop that one keeps is not for the other.
        environment = {"ROS_HOME": str(own_results / "ros_home")}
        jobs.append(Job("faults: " + family, tuple(command), own_results, timeout_s, environment=environment))
    return jobs


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
        parser.error(f"no such family: {', '.join(unknown)}; there are: {', '.join(families)}")
    chosen = options.families or families
    end_s = time.monotonic() + 60.0 * options.minutes
    round_number = 0
    options.results.mkdir(parents=True, exist_ok=True)
    table = options.results / "table.jsonl"
    if table.exists():
        table.unlink()
    while True:
        round_number += 1
        results_dir = options.results / ("round_%d" % round_number) if options.minutes else options.results
        # One after another in the long form, whose figures are those of a machine that does nothing else.
        jobs = make_jobs(results_dir, chosen, table, options.minutes)
        passed = run_jobs(jobs, jobs[0].load if options.minutes else count_cores())
        print_table(read_rows(table))
        if not passed or time.monotonic() >= end_s:
            return int(not passed)


if __name__ == "__main__":
    sys.exit(main())
