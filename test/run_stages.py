"""Runs the stages of script/test side by side, which starts it: tests that wait beside builds and checks that compute.

Usage: run_stages.py RESULTS_DIR STAGE [STAGE ...] [--pattern PATTERN]
The workspace must be sourced. For the stage noetic, HERO_NOETIC_PYTHON and HERO_NOETIC_PATH hold its interpreter and
module path.
"""

import argparse
import os
import sys
from pathlib import Path

import run_rostests
from jobs import Job, count_cores, run_jobs

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 1800.0
LINT_LOAD = UNIT_LOAD = 1.0
BUILD_LOAD = 1.0
DEMO_LOAD = 0.5

sys.path.insert(0, str(ROOT / "test" / "faults"))
import run as faults  # noqa: E402


def make_pytest_job(name, python, arguments, results_dir, load, **environment):
    command = (python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments)
    junit = ("--junitxml", str(results_dir / "results.xml"))
    return Job(name, (*command, *junit), results_dir, load, TIMEOUT_S, environment)


def make_unit_jobs(stage, results_dir, python, **environment):
    """One job for each package; with the seed, failures can be repeated."""
    folders = [str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("*/test/unit"))]
    return [
        make_pytest_job(
            f"{stage}: {folder}",
            python,
            (str(ROOT / folder), "--hypothesis-seed=0"),
            results_dir / folder.split("/")[0],
            UNIT_LOAD,
            **environment,
        )
        for folder in folders
    ]


def make_workspace_jobs(results_dir):
    """One job for each build mode, and one for each other file."""
    parts = [("test_build_modes.py", mode, BUILD_LOAD) for mode in ("catkin_build", "install", "catkin_make")]
    parts += [("test_demo.py", "", DEMO_LOAD), ("test_rosinstall.py", "", DEMO_LOAD)]
    jobs = []
    for file, mode, load in parts:
        arguments = (str(ROOT / "test" / "workspaces" / file), *(("-k", f"[{mode}]") if mode else ()))
        name = " ".join(["workspaces:", file, mode]).rstrip()
        jobs.append(make_pytest_job(name, sys.executable, arguments, results_dir / (mode or file[:-3]), load))
    return jobs


def make_jobs(stages, results, pattern):
    """All jobs of the stages, in the order in which they begin: what takes long first, what only computes last."""
    jobs = []
    if "workspaces" in stages:
        jobs += make_workspace_jobs(results / "workspaces")
    if "faults" in stages:
        families = [pattern] if pattern in faults.find_families() else faults.find_families()
        jobs += faults.make_jobs(results / "faults", families, results / "faults.jsonl")
    if "rostest" in stages:
        jobs += run_rostests.make_jobs(results / "rostest", pattern)
    if "unit" in stages:
        jobs += make_unit_jobs("unit", results / "unit", sys.executable)
    if "noetic" in stages and os.environ.get("HERO_NOETIC_PYTHON"):
        jobs += make_unit_jobs(
            "noetic", results / "noetic", os.environ["HERO_NOETIC_PYTHON"], PYTHONPATH=os.environ["HERO_NOETIC_PATH"]
        )
    if "lint" in stages:
        environment = {"HERO_RESULTS": str(results / "lint")}
        # It installs its tools the first time.
        command = (str(ROOT / "script" / "lint"),)
        jobs.append(Job("lint", command, results / "lint", LINT_LOAD, TIMEOUT_S, environment, has_own_network=False))
    return jobs


def main():
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("stages", nargs="+")
    parser.add_argument("--pattern", default="", help="of the paths of rostests, or a family of faults")
    options = parser.parse_args()
    passed = run_jobs(make_jobs(options.stages, options.results, options.pattern), count_cores())
    if "faults" in options.stages:
        faults.print_table(faults.read_rows(options.results / "faults.jsonl"))
    return int(not passed)


if __name__ == "__main__":
    sys.exit(main())
