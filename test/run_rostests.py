"""Runs the rostests of the suite side by side, each under a ROS master of its own; shows the log of one that fails.

Usage: run_rostests.py RESULTS_DIR [PATTERN]
The workspace must be sourced.
"""

import os
import re
import sys
from pathlib import Path

from jobs import Job, count_cores, run_jobs

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 1200.0  # of one .test file; each <test> in it has its own, shorter time-limit
LOAD = 0.35  # most of a rostest is waiting
TIME_LIMIT = re.compile(r'time-limit="([0-9.]+)"')


def read_time_limit_s(path):
    """Return how long a .test file may take at most, by its own word."""
    return max(map(float, TIME_LIMIT.findall(path.read_text())))


def find_rostests(pattern):
    """All .test files of the suite whose path contains the pattern, those first that may take longest."""
    paths = sorted(ROOT.glob("*/test/rostest/*.test"))
    chosen = [path for path in paths if pattern in str(path.relative_to(ROOT))]
    return sorted(chosen, key=read_time_limit_s, reverse=True)


def make_python_path(results_dir):
    """Return a PATH on which python is this interpreter: test scripts start with "env python"."""
    programs = Path(results_dir) / "bin"
    programs.mkdir(parents=True)
    for name in ("python", "python3"):
        (programs / name).symlink_to(sys.executable)
    return f"{programs.resolve()}:{os.environ['PATH']}"


def make_jobs(results_dir, pattern=""):
    """Return one job for each rostest."""
    path_of_python = make_python_path(results_dir)
    jobs = []
    for path in find_rostests(pattern):
        package_dir = path.parents[2]
        own_results = Path(results_dir) / package_dir.name / path.stem
        command = (
            "rostest",
            f"--package={package_dir.name}",
            f"--pkgdir={package_dir}",
            f"--results-base-dir={own_results}",
            f"--results-filename={path.stem}.xml",
            str(path),
        )
        environment = {"PATH": path_of_python, "ROS_TEST_RESULTS_DIR": str(own_results)}
        jobs.append(Job(str(path.relative_to(ROOT)), command, own_results, LOAD, TIMEOUT_S, environment))
    return jobs


if __name__ == "__main__":
    sys.exit(not run_jobs(make_jobs(*sys.argv[1:]), count_cores()))
