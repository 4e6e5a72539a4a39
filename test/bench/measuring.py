"""Shared by the benchmarks: processes, their CPU time and memory, the speed of the machine, the report."""

import contextlib
import os
import signal
import socket
import subprocess
import time
import timeit
from pathlib import Path
from typing import Dict, List

from hero_test.processes import find_free_port

TICKS_PER_S = os.sysconf("SC_CLK_TCK")


def measure_machine_us():
    """Return the time (us) of summing 768 bytes, by which CPU figures of machines are compared."""
    data = bytes(range(256)) * 3
    return min(timeit.repeat(lambda: sum(data), number=20000, repeat=5)) / 20000 * 1e6


def read_all_cpu_s():
    """Return the CPU seconds by process of everything that runs on this machine.

    /proc/stat would be shorter, but counts whole ticks of the clock: between them it sees nothing of short work.
    """
    return {int(entry.name): read_one_cpu_s(entry.name) for entry in Path("/proc").iterdir() if entry.name.isdigit()}


def read_one_cpu_s(pid):
    """Return the CPU seconds that one process has used, 0 if it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS_PER_S
    except (OSError, IndexError):  # the second where it went while it was read
        return 0.0


def find_tree(pid):
    """Return pid and all its descendants."""
    children: Dict[int, List[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, IndexError):
                continue
            children.setdefault(parent, []).append(int(entry.name))
    found, todo = [], [pid]
    while todo:
        found.append(todo.pop())
        todo += children.get(found[-1], [])
    return found


def read_cpu_s(pid):
    """Return the CPU seconds that the process tree of pid has used."""
    return sum(read_one_cpu_s(member) for member in find_tree(pid))


def read_memory_mb(pid):
    """Return the resident memory (MB) of the process tree of pid."""
    total_kb = 0
    for member in find_tree(pid):
        try:
            lines = Path("/proc/%d/status" % member).read_text().splitlines()
        except OSError:
            continue
        total_kb += sum(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))
    return total_kb / 1000.0


def percentile_ms(values_s, share):
    """Return a percentile (ms) of sorted values, None for none."""
    return None if not values_s else values_s[min(len(values_s) - 1, int(share * len(values_s)))] * 1e3


def wait_for_port(port, process):
    """Return when something listens on port."""
    deadline_s = time.monotonic() + 30.0
    while time.monotonic() < deadline_s and process.poll() is None:
        with socket.socket() as sock:
            if sock.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise SystemExit(
        "bench: %s does not listen on port %d; start it by hand to see why" % (" ".join(process.args), port)
    )


def start(command, environment, **options):
    """Start a program in its own process group."""
    try:
        return subprocess.Popen(command, env=environment, start_new_session=True, text=True, **options)
    except OSError as error:
        raise SystemExit(f"bench: {command[0]} cannot be started: {error.strerror}") from error


def stop(process, number=signal.SIGINT):
    """End a program and return what it printed."""
    if process.poll() is None:
        os.killpg(process.pid, number)
    try:
        return process.communicate(timeout=15)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[0]


def find_environment(workspace):
    """Return the program that runs a command in a built workspace, or in a checkout that script/test has built.

    Raises: SystemExit if there is none.
    """
    for folder in (workspace, workspace / ".work" / "ws"):
        environment = folder / "devel" / "env.sh"
        if environment.is_file():
            return str(environment.absolute())
    raise SystemExit(f"bench: {workspace} is not a built workspace; in a checkout, script/test unit builds one")


@contextlib.contextmanager
def start_master():
    """Start a ROS master that ends with the context; give the environment in which programs find it."""
    port = find_free_port()
    environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % port)
    master = start(["roscore", "-p", str(port)], environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        wait_for_port(port, master)
        yield environment
    finally:
        stop(master)


def print_machine():
    """Print the line by which tables of different machines and hours are compared."""
    print(f"sum of 768 bytes: {measure_machine_us():.2f} us, load of the last minute: {os.getloadavg()[0]:.2f}")
