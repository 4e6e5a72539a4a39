"""Runs the programs of the test stages side by side, and judges each by its exit status and its JUnit files.

A job says how many cores it keeps busy. Most tests wait more than they compute (for ROS, for robots that move in real
time), so more of them run at once than there are cores. A job that leaves no results (it hung, or died) counts as one
failure. Where the system permits it, each job has a network of its own: ports cannot collide, and no program outside
reaches the robots of a test. Its processes end with it, in sessions of their own too, also where it is killed.
"""

import concurrent.futures
import contextlib
import functools
import os
import signal
import subprocess
import threading
import time
from pathlib import Path
from typing import Dict, List, NamedTuple, Set, Tuple

from results import Counts, count_results, record

LOG_LINES_SHOWN = 80
MARK = "HERO_TEST_JOB"  # in the environment of a job and of all that it starts: the folder of its results


class Job(NamedTuple):
    """One program with tests."""

    name: str  # as in the printed line
    command: Tuple[str, ...]
    results_dir: Path  # the job's own: its JUnit files, and its output as log.txt
    timeout_s: float  # when it hangs; a busy machine needs its time
    load: float = 1 / 3  # cores that it keeps busy, on average; most of a test is waiting
    environment: Dict[str, str] = {}  # besides ours
    has_own_network: bool = True


# The shell stays, as the first process in there: it waits for those whose parents have ended.
CONTAINER = ("unshare", "--pid", "--fork", "--kill-child", "--mount-proc")


@functools.lru_cache(maxsize=None)
def make_container(has_own_network=True):
    """Return a command that gives a program processes of its own, and a network; empty where that is not permitted."""
    command = (*CONTAINER, "sh", "-c", '"$@"; exit $?', "sh")
    if has_own_network:
        command = (*CONTAINER, "--net", "sh", "-c", 'ip link set lo up && "$@"; exit $?', "sh")
    try:
        subprocess.run([*command, "true"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except (OSError, subprocess.CalledProcessError):
        return ()
    return command


def run_command(job):
    """Run a job; return whether it ended well, and its CPU time (s), where it waited for what it started."""
    prefix = make_container(job.has_own_network)
    own_network = "yes" if prefix and job.has_own_network else "no"
    with open(job.results_dir / "log.txt", "wb") as log:
        process = subprocess.Popen(
            [*prefix, *job.command],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, **job.environment, "HERO_OWN_NETWORK": own_network, MARK: str(job.results_dir)},
            start_new_session=True,
        )
        ender = threading.Timer(job.timeout_s, kill_job, [job])
        ender.start()
        _, status, usage = os.wait4(process.pid, 0)
        ender.cancel()
        process.returncode = status  # so that process looks for its child no more
        kill_job(job)
        if os.WIFSIGNALED(status):
            log.write(b"\nkilled by signal %d, after %d s at the latest\n" % (os.WTERMSIG(status), job.timeout_s))
    return status == 0, usage.ru_utime + usage.ru_stime


def kill_job(job):
    """Kill what a job has started and left behind, in sessions of its own too, where containers are not permitted."""
    mark = f"{MARK}={job.results_dir}".encode() + b"\0"
    killed: Set[int] = set()
    while True:  # until none was started meanwhile
        found = {pid for pid in map(int, filter(str.isdigit, os.listdir("/proc"))) if has_mark(pid, mark)} - killed
        if not found:
            return
        for pid in found:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        killed |= found


def has_mark(pid, mark):
    """Return whether a process was started with a mark in its environment; not those of others, or that ended."""
    try:
        return mark in Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return False


def drop_wrappers(results_dir):
    """Remove rostest's own results where they only repeat that all tests of the file passed."""
    for path in results_dir.rglob("rostest-*.xml"):
        counts = Counts()
        counts.add_file(path)
        if not counts.failures:
            path.unlink()


def run_and_judge(job):
    """Run a job; return whether it failed, and what to print."""
    job.results_dir.mkdir(parents=True)
    start_s = time.monotonic()
    is_well, cpu_s = run_command(job)
    drop_wrappers(job.results_dir)
    counts = count_results(job.results_dir)
    if not counts.failures and not (is_well and counts.passed + counts.skipped):
        record(job.results_dir, f"{job.results_dir.name} ends without an error", True)
        counts = count_results(job.results_dir)
    verdict = "FAILED" if counts.failures else "ok"
    lines = [
        f"{job.name} ... {verdict}: {counts.passed} passed, {len(counts.failures)} failed,"
        f" {time.monotonic() - start_s:.1f} s, {cpu_s:.1f} s of CPU"
    ]
    if counts.failures:
        log = (job.results_dir / "log.txt").read_text(errors="replace").splitlines()
        lines += ["    " + line for line in log[-LOG_LINES_SHOWN:]]
    return bool(counts.failures), "\n".join(lines)


def run_jobs(jobs: List[Job], max_load: float) -> bool:
    """Run all jobs in order, another one while those that run have less than this load; return whether all passed.

    Ctrl-C and SIGTERM end them, with all that they have started.
    """
    # A background job of a shell ignores Ctrl-C, and so would all that it starts; the tests send Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    waiting, running = list(jobs), {}
    passed = True
    with concurrent.futures.ThreadPoolExecutor(max(1, len(waiting))) as pool:
        try:
            while waiting or running:
                if waiting and sum(job.load for job in running.values()) < max_load:
                    job = waiting.pop(0)
                    running[pool.submit(run_and_judge, job)] = job
                    continue
                ended, _ = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
                for run in ended:
                    del running[run]
                    has_failed, text = run.result()
                    passed = passed and not has_failed
                    print(text, flush=True)
        except KeyboardInterrupt:
            for job in running.values():
                kill_job(job)
            raise
    return passed


def count_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0))
