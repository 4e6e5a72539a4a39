"""Runs every rostest of the suite, each under a ROS master of its own, and shows the log of one that fails.

Usage: run_rostests.py RESULTS_DIR [PATTERN]
The workspace must be sourced. A rostest that leaves no results (it hung, or died) counts as one failure.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from results import Counts, count_results, record

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 600.0  # of one .test file; each <test> in it has its own, shorter time-limit
LOG_LINES_SHOWN = 80


def find_rostests(pattern):
    """All .test files of the suite whose path contains the pattern."""
    paths = sorted(ROOT.glob("*/test/rostest/*.test"))
    return [path for path in paths if pattern in str(path.relative_to(ROOT))]


def run_rostest(path, results_dir):
    """Run one .test file and return its exit code; its output goes to log.txt in results_dir."""
    package_dir = path.parents[2]
    command = [
        "rostest",
        f"--package={package_dir.name}",
        f"--pkgdir={package_dir}",
        f"--results-base-dir={results_dir}",
        f"--results-filename={path.stem}.xml",
        str(path),
    ]
    environment = dict(os.environ, ROS_TEST_RESULTS_DIR=str(results_dir))
    with open(results_dir / "log.txt", "wb") as log:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env=environment,
            start_new_session=True,
        )
        try:
            return process.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            log.write(f"\nno end after {TIMEOUT_S:.0f} s: killed\n".encode())
            return -1
        finally:
            kill_session(process.pid)


def kill_session(session_id):
    """Kill what a rostest left behind."""
    try:
        os.killpg(session_id, signal.SIGKILL)
    except ProcessLookupError:
        return


def drop_wrappers(results_dir):
    """Remove rostest's own results where they only repeat that all tests of the file passed."""
    for path in results_dir.rglob("rostest-*.xml"):
        counts = Counts()
        counts.add_file(path)
        if not counts.failures:
            path.unlink()


def main(results_dir, pattern=""):
    """Run the rostests and return 1 if any failed."""
    failed = False
    for path in find_rostests(pattern):
        name = str(path.relative_to(ROOT))
        own_results = Path(results_dir) / path.parents[2].name / path.stem
        own_results.mkdir(parents=True)
        print(f"{name} ... ", end="", flush=True)
        start_s = time.monotonic()
        exit_code = run_rostest(path, own_results)
        drop_wrappers(own_results)
        counts = count_results(own_results)
        if not counts.failures and (exit_code != 0 or not counts.passed):
            record(own_results, f"{path.stem} ends with results", True)
            counts = count_results(own_results)
        verdict = "FAILED" if counts.failures else "ok"
        took_s = time.monotonic() - start_s
        print(f"{verdict}: {counts.passed} passed, {len(counts.failures)} failed, {took_s:.1f} s")
        if counts.failures:
            failed = True
            lines = (own_results / "log.txt").read_text(errors="replace").splitlines()
            print("\n".join("    " + line for line in lines[-LOG_LINES_SHOWN:]))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
