"""Runs the stages of script/test side by side, which starts it: tests that wait beside builds and checks that compute.

Usage: run_stages.py RESULTS_DIR [STAGE[=PATTERN] ...] [--paths PATH ...]
The workspace must be sourced. HERO_PYTHON38 is the interpreter of the stages noetic and noetic_rostest; without one,
they are left out.
"""

import argparse
import os
import sys
from importlib.util import find_spec
from pathlib import Path

import run_rostests
import sources
from jobs import Job, count_cores, run_jobs

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 3600.0  # of one that hangs
OPTIONS_PYTHON = (3, 10)  # with an older one the stage options is left out
COSTS = ROOT / "test" / "costs.txt"  # of the jobs, as measured

sys.path.insert(0, str(ROOT / "test" / "faults"))
import run as faults  # noqa: E402


def make_pytest_job(name, arguments, results_dir):
    """Return a job of pytest."""
    command = (sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments)
    junit = ("--junitxml", str(results_dir / "results.xml"))
    return Job(name, (*command, *junit), results_dir, TIMEOUT_S)


def make_unit_jobs(results_dir, packages):
    """Return a job for each package; the tests of a few packages are divided among processes, by pytest-xdist."""
    jobs = []
    for package in sorted(packages):
        files = sorted(map(str, packages[package]))
        workers = min(2 * count_cores() // len(packages), len(files))
        divided = ["-n", str(workers), "--dist", "loadfile"] if workers > 1 and find_spec("xdist") else []
        jobs.append(make_pytest_job("unit: " + package, [*divided, *files], results_dir / package))
    return jobs


def find_unit_tests(paths=()):
    """Return the files of the unit tests of each package: all, or of the packages or tests that the paths name."""
    if not paths:
        paths = sources.PACKAGES.values()
    packages = {}
    for path in paths:
        package = sources.PACKAGES.get(sources.package_of(path / "x"))
        if package is None:
            continue
        is_test = path.name.startswith("test_") and package / "test" / "unit" in path.parents
        found = {path} if is_test else set((package / "test" / "unit").rglob("test_*.py"))
        if found:
            packages.setdefault(package.name, set()).update(found)
    return packages


def make_workspace_jobs(results_dir):
    """Return one job for each file."""
    jobs = [make_core_job(results_dir / "core", "not unit_tests")]  # they have run, with all packages
    for path in sorted((ROOT / "test" / "workspaces").glob("test_*.py")):
        if path.name != "test_core.py":
            jobs.append(make_pytest_job("workspaces: " + path.name, [str(path)], results_dir / path.stem))
    environment = {"PATH": run_rostests.make_program_path(results_dir), **run_rostests.DISTUTILS}
    return [job._replace(environment=environment) for job in jobs]


def make_core_job(results_dir, selection):
    """Return the job that builds and tests the core without the other packages."""
    arguments = (str(ROOT / "test" / "workspaces" / "test_core.py"), "-k", selection)
    return make_pytest_job("core", arguments, results_dir)


def keep_matching(jobs, pattern, stage):
    """Return the jobs whose names contain the pattern. Raises: ValueError if there are none."""
    found = [job for job in jobs if pattern in job.name]
    if not found:
        names = " ".join(sorted(job.name for job in jobs))
        raise ValueError(f"no {stage} matches {pattern!r}; there are: {names}")
    return found


def make_jobs(stages, results, paths):
    """Return all jobs of the stages, which have patterns, and of the paths, in the order in which they begin."""
    jobs = []
    # What these install the first time comes from the network.
    if "noetic" in stages and os.environ.get("HERO_PYTHON38"):
        own_results = results / "noetic"
        command = (str(ROOT / "test" / "noetic" / "run"), os.environ["HERO_PYTHON38"], str(own_results))
        jobs.append(Job("noetic", command, own_results, TIMEOUT_S, has_own_network=False))
    if "options" in stages and sys.version_info >= OPTIONS_PYTHON:
        own_results = results / "options"
        command = (str(ROOT / "test" / "options" / "run"), str(own_results))
        jobs.append(Job("options", command, own_results, TIMEOUT_S, has_own_network=False))
    if "noetic_rostest" in stages and os.environ.get("HERO_PYTHON38"):
        own_results = results / "noetic_rostest"
        script = str(ROOT / "test" / "noetic" / "run_rostests")
        command = (script, os.environ["HERO_PYTHON38"], str(own_results), stages["noetic_rostest"] or "hero_driver/")
        jobs.append(Job("noetic_rostest", command, own_results, TIMEOUT_S, count_cores(), has_own_network=False))
    if "lint" in stages:
        own_results = results / "lint"
        environment = {"HERO_RESULTS": str(own_results)}
        command = (str(ROOT / "script" / "lint"),)
        jobs.append(Job("lint", command, own_results, TIMEOUT_S, environment=environment, has_own_network=False))
        tests = [str(ROOT / "test" / "documents")]
        documents = make_pytest_job("documents", tests, results / "documents")
        jobs.append(documents._replace(has_own_network=False))
    if "workspaces" in stages:
        found = make_workspace_jobs(results / "workspaces")
        if "core" in stages:  # builds in the same folder, and runs the unit tests, too
            found = [job for job in found if job.name != "core"]
        jobs += keep_matching(found, stages["workspaces"], "job of workspaces")
    if "core" in stages:
        jobs.append(make_core_job(results / "core", ""))
    if "unit" in stages:
        jobs += make_unit_jobs(results / "unit", find_unit_tests())
    if "faults" in stages:
        found = faults.make_jobs(results / "faults", faults.find_families(), results / "faults.jsonl")
        jobs += keep_matching(found, stages["faults"], "family of faults")
    if "rostest" in stages:
        jobs += keep_matching(run_rostests.make_jobs(results / "rostest"), stages["rostest"], "rostest")
    rostests = [path for path in paths if path.suffix == ".test"]
    if rostests:
        jobs += run_rostests.make_jobs(results / "rostest", paths=rostests)
    if len(paths) > len(rostests):
        unit_tests = find_unit_tests([path for path in paths if path.suffix != ".test"])
        jobs += make_unit_jobs(results / "unit", unit_tests)
    if paths and not jobs:
        print("-- no unit tests here: the rules of test/lint, which read launch files and documents, too", flush=True)
        jobs.append(make_pytest_job("rules", [str(ROOT / "test" / "lint")], results / "lint"))
    return add_costs(jobs)


def add_costs(jobs):
    """Return the jobs with their loads, the longest first: waiting and computing ones mix, short ones end together."""
    costs = {}
    for line in COSTS.read_text().splitlines():
        if not line.startswith("#"):
            duration_s, cpu_s, name = line.split(maxsplit=2)
            costs[name] = (float(duration_s), float(cpu_s))
    known = [job._replace(load=costs[job.name][1] / costs[job.name][0]) for job in jobs if job.name in costs]
    return sorted(known, key=lambda job: -costs[job.name][0]) + [job for job in jobs if job.name not in costs]


def main():
    """Run from the command line; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("stages", nargs="*")
    parser.add_argument("--paths", type=Path, nargs="*", default=(), help="packages, or files of them")
    options = parser.parse_args()
    stages = {stage: pattern for stage, _, pattern in (given.partition("=") for given in options.stages)}
    try:
        jobs = make_jobs(stages, options.results, options.paths)
        passed = run_jobs(jobs, 1.1 * count_cores())  # what runs beside it waits a little longer than was measured
    except ValueError as error:
        print(f"test: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    if {"rostest", "faults"} & set(stages) or any(path.suffix == ".test" for path in options.paths):
        print(f"the robots of rostests and faults were drawn with HERO_SEED={os.environ.get('HERO_SEED', '0')}")
    if "faults" in stages:
        faults.print_table(faults.read_rows(options.results / "faults.jsonl"))
    return int(not passed)


if __name__ == "__main__":
    sys.exit(main())
