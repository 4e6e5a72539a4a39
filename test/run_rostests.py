"""Runs the rostests of the suite, three at once, each under a ROS master of its own; shows the log of one that fails.

Usage: run_rostests.py RESULTS_DIR [PATTERN]
The workspace must be sourced. A rostest that leaves no results (it hung, or died) counts as one failure.
"""

import concurrent.futures
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from results import Counts, count_results, record

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT_S = 600.0  # of one .test file; each <test> in it has its own, shorter time-limit
LOG_LINES_SHOWN = 80
AT_ONCE = 3  # most of a rostest is waiting for robots that move in real time
TIME_LIMIT = re.compile(r'time-limit="([0-9.]+)"')


def read_time_limit_s(path):
    """Return how long a .test file may take at most, by its own word."""
    return max(map(float, TIME_LIMIT.findall(path.read_text())))


def find_rostests(pattern):
    """All .test files of the suite whose path contains the pattern, those first that may take longest."""
    paths = sorted(ROOT.glob("*/test/rostest/*.test"))
    chosen = [path for path in paths if pattern in str(path.relative_to(ROOT))]
    return sorted(chosen, key=read_time_limit_s, reverse=True)


def run_rostest(path, results_dir):
    """Run one .test file; return its status, not 0 if it failed, and its CPU time (s); log.txt gets its output."""
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
        ender = threading.Timer(TIMEOUT_S, kill_session, [process.pid])
        ender.start()
        # wait4() gives the CPU time of the rostest and of all that it has started and seen the end of.
        _, status, usage = os.wait4(process.pid, 0)
        ender.cancel()
        process.returncode = status  # so that process looks for its child no more
        kill_session(process.pid)
    return status, usage.ru_utime + usage.ru_stime


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


def make_python_path(results_dir):
    """Return a PATH on which python is this interpreter: test scripts start with "env python"."""
    programs = Path(results_dir) / "bin"
    programs.mkdir(parents=True)
    for name in ("python", "python3"):
        (programs / name).symlink_to(sys.executable)
    return f"{programs.resolve()}:{os.environ['PATH']}"


def run_and_judge(path, results_dir):
    """Run one .test file; return whether it failed, and what to print."""
    own_results = Path(results_dir) / path.parents[2].name / path.stem
    own_results.mkdir(parents=True)
    start_s = time.monotonic()
    status, cpu_s = run_rostest(path, own_results)
    drop_wrappers(own_results)
    counts = count_results(own_results)
    if not counts.failures and (status != 0 or not counts.passed):
        record(own_results, f"{path.stem} ends with results", True)
        counts = count_results(own_results)
    verdict = "FAILED" if counts.failures else "ok"
    lines = [
        f"{path.relative_to(ROOT)} ... {verdict}: {counts.passed} passed, {len(counts.failures)} failed,"
        f" {time.monotonic() - start_s:.1f} s, {cpu_s:.1f} s of CPU"
    ]
    if counts.failures:
        log = (own_results / "log.txt").read_text(errors="replace").splitlines()
        lines += ["    " + line for line in log[-LOG_LINES_SHOWN:]]
    return bool(counts.failures), "\n".join(lines)


def main(results_dir, pattern=""):
    """Run the rostests, AT_ONCE side by side, and return 1 if any failed."""
    os.environ["PATH"] = make_python_path(results_dir)
    failed = False
    with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as pool:
        runs = [pool.submit(run_and_judge, path, results_dir) for path in find_rostests(pattern)]
        for run in concurrent.futures.as_completed(runs):
            has_failed, text = run.result()
            failed = failed or has_failed
            print(text, flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
