"""Runs the rostests of the suite side by side, each under a ROS master of its own; shows the log of one that fails.

Usage: run_rostests.py RESULTS_DIR [PATTERN]
The workspace must be sourced.
"""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import sources
from jobs import Job, count_cores, run_jobs

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 3600.0  # of one .test file; each <test> in it has its own, shorter time-limit
# roslaunch imports distutils, which setuptools replaces by its own and itself: half of roslaunch's start.
DISTUTILS = {"SETUPTOOLS_USE_DISTUTILS": "stdlib"} if sys.version_info < (3, 12) else {}
KEEP_FOUND = """\
kept={programs}/found_$(echo "$CMAKE_PREFIX_PATH $*" | cksum | cut -d " " -f 1)
if [ ! -s "$kept" ]; then {catkin_find} "$@" >"$kept.$$" || exit; mv "$kept.$$" "$kept"; fi
cat "$kept"
"""


def find_rostests(pattern):
    """All .test files of the suite whose path contains the pattern."""
    found = [path for path in sources.find("test/rostest/*.test") if pattern in str(path.relative_to(ROOT))]
    if not found:
        sys.exit(f"test: no rostest matches {pattern!r}")
    return found


def write_program(path, script):
    """Write a program for the shell."""
    path.write_text("#!/bin/sh\n" + script)
    path.chmod(0o755)


def make_program_path(results_dir):
    """Return a PATH on which python is this interpreter: test scripts start with "env python".

    Every roslaunch asks rosversion twice, and rosrun catkin_find up to four times, each a Python: answers are kept.
    """
    programs = Path(results_dir).resolve() / "bin"
    programs.mkdir(parents=True)
    for name in ("python", "python3"):
        # Not a link: from a link, Python does not find the libraries of a virtual environment.
        write_program(programs / name, f'exec {sys.executable} "$@"\n')
    cases = ""
    for what in ("-d", "roslaunch"):
        answer = subprocess.check_output(["rosversion", what], text=True).strip()
        cases += f"{what}) echo {shlex.quote(answer)} ;;\n"
    write_program(programs / "rosversion", f"case $1 in\n{cases}*) exit 1 ;;\nesac\n")
    keep = KEEP_FOUND.format(programs=programs, catkin_find=shutil.which("catkin_find"))
    write_program(programs / "catkin_find", keep)
    return f"{programs}:{os.environ['PATH']}"


def make_jobs(results_dir, pattern="", paths=()):
    """Return one job for each rostest, or for these."""
    program_path = make_program_path(results_dir)
    jobs = []
    for path in paths or find_rostests(pattern):
        package_dir = path.parents[2]
        own_results = Path(results_dir) / package_dir.name / path.stem
        command = (
            sys.executable,
            shutil.which("rostest"),
            f"--package={package_dir.name}",
            f"--pkgdir={package_dir}",
            f"--results-base-dir={own_results}",
            f"--results-filename={path.stem}.xml",
            str(path),
        )
        # A driver keeps its stop there by its name, which drivers of several tests have.
        ros_home = Path(os.environ["ROS_HOME"]) / package_dir.name / path.stem
        environment = {"PATH": program_path, "ROS_TEST_RESULTS_DIR": str(own_results), "ROS_HOME": str(ros_home)}
        environment.update(DISTUTILS)
        jobs.append(Job(str(path.relative_to(ROOT)), command, own_results, TIMEOUT_S, environment=environment))
    return jobs


if __name__ == "__main__":
    sys.exit(not run_jobs(make_jobs(*sys.argv[1:]), count_cores()))
