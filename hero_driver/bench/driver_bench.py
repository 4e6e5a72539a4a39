"""Loads a rosserial TCP server with an emulated swarm and prints one table, and JSON with --json.

Starts its own ROS master and the server (with --port it takes those that run), listeners and commanders, each in
a process of its own; CPU time is taken from the operating system's accounting (/proc). Run it with script/bench driver.
"""

import argparse
import contextlib
import csv
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import time
import timeit
from pathlib import Path

import rosgraph

LISTENING = "0A"  # state of a socket in /proc/net/tcp, TCP_LISTEN of the kernel
HERE = Path(__file__).resolve().parent
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
SETTLE_S = 3.0

DRIVER_COMMAND = "rosrun hero_driver hero_driver _port:={port}"


def find_free_port():
    """Return a TCP port that is free now."""
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def measure_machine_us():
    """Return the time (us) of summing 768 bytes, by which CPU figures of machines are compared."""
    data = bytes(range(256)) * 3
    return min(timeit.repeat(lambda: sum(data), number=20000, repeat=5)) / 20000 * 1e6


def read_all_cpu_s():
    """Return the CPU seconds by process of everything that runs on this machine.

    /proc/stat would be shorter, but counts whole ticks of the clock: between them it sees nothing of short work.
    """
    return {
        int(entry.name): read_one_cpu_s(entry.name)
        for entry in Path("/proc").iterdir()
        if entry.name.isdigit()
    }


def read_one_cpu_s(pid):
    """Return the CPU seconds that one process has used, 0 if it has ended."""
    try:
        fields = Path("/proc/%s/stat" % pid).read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / TICKS_PER_S


def find_tree(pid):
    """Return pid and all its descendants."""
    children = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except (OSError, ValueError):
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
    """Start a program in a process group of its own."""
    try:
        return subprocess.Popen(command, env=environment, start_new_session=True, text=True, **options)
    except OSError as error:
        raise SystemExit("bench: %s cannot be started: %s" % (command[0], error.strerror)) from error


def stop(process, number=signal.SIGINT):
    """End a program and return what it printed."""
    if process.poll() is None:
        os.killpg(process.pid, number)
    try:
        return process.communicate(timeout=15)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return process.communicate()[0]


def find_settling_s(count):
    """Return the time that count robots, and all programs, need until everything is registered and connected."""
    return SETTLE_S + 0.05 * count


def find_listener(port):
    """Return the process that listens on a TCP port of this machine."""
    sockets = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        with contextlib.suppress(FileNotFoundError):
            for line in Path(table).read_text().splitlines()[1:]:
                fields = line.split()
                if fields[3] == LISTENING and int(fields[1].rpartition(":")[2], 16) == port:
                    sockets.add("socket:[%s]" % fields[9])
    for entry in Path("/proc").iterdir():
        # A process that ends, or somebody else's, shows no files.
        with contextlib.suppress(OSError):
            if entry.name.isdigit() and any(os.readlink(file) in sockets for file in (entry / "fd").iterdir()):
                return int(entry.name)
    raise SystemExit("bench: no process that may be looked at listens on port %d; start it, as the same user" % port)


@contextlib.contextmanager
def serve(options, environment):
    """Give pairs of process id and port of the servers, which listen; those started here end afterwards."""
    if options.port:
        yield [(find_listener(options.port), options.port)]
        return
    servers = []
    try:
        for index in range(options.drivers):
            port = find_free_port()
            command = options.server_command.format(port=port).split()
            if index:
                # A second node of one name would end the first.
                command.append("__name:=hero_driver_%d" % index)
            process = start(command, environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            servers.append((process, port))
        for process, port in servers:
            wait_for_port(port, process)
        yield [(process.pid, port) for process, port in servers]
    finally:
        for process, _ in servers:
            stop(process)


def start_swarms(options, count, servers, environment):
    """Start the emulated robots, spread evenly over the servers."""
    swarms = []
    for index, (_, port) in enumerate(servers):
        first, end = (count * number // len(servers) for number in (index, index + 1))
        command = [sys.executable, str(HERE / "emulated_swarm.py"), "--port", str(port)]
        command += ["--first-id", str(first), "--robots", str(end - first), "--speed", str(options.speed)]
        seconds = find_settling_s(count) + options.seconds + SETTLE_S
        command += ["--seconds", str(seconds)] + ["--nagle"] * options.nagle + ["--warn"] * options.warn
        swarms.append(start(command, environment, stdout=subprocess.PIPE))
    return swarms


def collect(swarms):
    """Return what the swarms sent and got, together."""
    reports = [json.loads(swarm.communicate(timeout=120)[0]) for swarm in swarms]
    joined_s = [report["joined_s"] for report in reports]
    total = {
        key: sum((report[key] for report in reports[1:]), reports[0][key])
        for key in ("thrown_out", "transforms", "bursts_sent", "bursts_due", "odom_stamps_s", "commands_s")
    }
    return dict(total, joined_s=None if None in joined_s else max(joined_s))


def run_once(options, count, environment):
    """Return the figures of one run with count robots."""
    load = [sys.executable, str(HERE / "ros_load.py")]
    with serve(options, environment) as servers:
        # The probe of the port was a connection too: let the server forget it.
        time.sleep(1.0)
        arguments = ["--robots", str(0 if options.unheard else count)]
        listener = start([*load, "listen", *arguments], environment, stdout=subprocess.PIPE)
        commander = start([*load, "command", *arguments], environment, stdout=subprocess.PIPE)
        time.sleep(SETTLE_S)
        swarms = start_swarms(options, count, servers, environment)
        time.sleep(find_settling_s(count))

        def read_figures():
            server_s = sum(read_cpu_s(pid) for pid, _ in servers)
            return time.monotonic(), server_s, read_cpu_s(listener.pid), read_all_cpu_s()

        window_start_s = time.time()
        before = read_figures()
        time.sleep(options.seconds)
        after = read_figures()
        ours = {pid for root in (os.getpid(), *(pid for pid, _ in servers)) for pid in find_tree(root)}
        window_end_s = time.time()
        memory_mb = sum(read_memory_mb(pid) for pid, _ in servers)
        sent = collect(swarms)
        time.sleep(0.5)
        listened = json.loads(stop(listener))
        commanded = json.loads(stop(commander))
    elapsed_s = after[0] - before[0]
    busy_s = {pid: total_s - before[3].get(pid, 0.0) for pid, total_s in after[3].items()}

    def count_in_window(times_s):
        return sum(window_start_s <= time_s < window_end_s for time_s in times_s)

    def list_delays_s(pairs):
        return sorted(end_s - start_s for start_s, end_s in pairs if window_start_s <= start_s < window_end_s)

    ages_s, delays_s = list_delays_s(listened["odoms_s"]), list_delays_s(sent["commands_s"])
    return {
        "robots": count,
        "server_cpu_percent": 100.0 * (after[1] - before[1]) / elapsed_s,
        "subscriber_cpu_percent": 100.0 * (after[2] - before[2]) / elapsed_s,
        "bench_cores": sum(time_s for pid, time_s in busy_s.items() if pid in ours) / elapsed_s,
        "other_cores": sum(time_s for pid, time_s in busy_s.items() if pid not in ours) / elapsed_s,
        "bursts_sent_percent": 100.0 * sent["bursts_sent"] / sent["bursts_due"],
        "odom_delivered_percent": 100.0 * len(ages_s) / max(1, count_in_window(sent["odom_stamps_s"])),
        "transforms_delivered_percent": 100.0 * listened["transforms"] / max(1, sent["transforms"]),
        "odom_p50_ms": percentile_ms(ages_s, 0.5),
        "odom_p99_ms": percentile_ms(ages_s, 0.99),
        "command_delivered_percent": 100.0 * len(delays_s) / max(1, count_in_window(commanded["commands_s"])),
        "command_p50_ms": percentile_ms(delays_s, 0.5),
        "command_p99_ms": percentile_ms(delays_s, 0.99),
        "joined_s": sent["joined_s"],
        "thrown_out": sent["thrown_out"],
        "memory_mb": memory_mb,
    }


ROWS = (
    ("server CPU, % of one core", "server_cpu_percent", "%.1f"),
    ("subscribing process CPU, %", "subscriber_cpu_percent", "%.1f"),
    ("odom delivered, %", "odom_delivered_percent", "%.2f"),
    ("transforms delivered, %", "transforms_delivered_percent", "%.2f"),
    ("odom latency p50, ms", "odom_p50_ms", "%.2f"),
    ("odom latency p99, ms", "odom_p99_ms", "%.2f"),
    ("cmd_vel delivered, %", "command_delivered_percent", "%.2f"),
    ("cmd_vel latency p50, ms", "command_p50_ms", "%.2f"),
    ("cmd_vel latency p99, ms", "command_p99_ms", "%.2f"),
    ("last robot synchronised, s", "joined_s", "%.2f"),
    ("robots thrown out", "thrown_out", "%d"),
    ("server memory, MB", "memory_mb", "%.0f"),
    ("bursts taken of those due, %", "bursts_sent_percent", "%.1f"),
    ("all of this measurement, cores", "bench_cores", "%.2f"),
    ("everything else, cores", "other_cores", "%.2f"),
)


def print_table(results, machine_us):
    """Print medians over the repeats, one column for each number of robots."""
    print("sum of 768 bytes: %.2f us, load of the last minute: %.2f" % (machine_us, os.getloadavg()[0]))
    print("| | %s |" % " | ".join("%d robots" % result["robots"] for result in results))
    print("|---|%s" % ("---|" * len(results)))
    for title, key, form in ROWS:
        cells = ["-" if result[key] is None else form % result[key] for result in results]
        print("| %s | %s |" % (title, " | ".join(cells)))


def append_history(path, results, machine_us):
    """Add a line for each number of robots to the CSV file that shows what commits cost."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=HERE, capture_output=True, text=True, check=True
    ).stdout.strip()
    columns = ["commit", "sum_of_768_bytes_us", "robots", *(key for _, key, _ in ROWS)]
    with path.open("a+", newline="") as file:
        file.seek(0)
        known = next(csv.reader(file), None)
        if known not in (None, columns):
            raise SystemExit("bench: %s has other columns (%s); give another file" % (path, ", ".join(known)))
        writer = csv.writer(file, lineterminator="\n")
        if known is None:
            writer.writerow(columns)
        for result in results:
            cells = ["" if result[key] is None else form % result[key] for _, key, form in ROWS]
            writer.writerow([commit, "%.2f" % machine_us, result["robots"], *cells])


def take_medians(runs):
    """Return one result from several."""
    result = {}
    for key in runs[0]:
        values = [run[key] for run in runs if run[key] is not None]
        result[key] = statistics.median(values) if values else None
    return result


@contextlib.contextmanager
def use_master(options):
    """Give the environment in which the ROS master is found: with --port the one that runs, else one for this only."""
    if options.port:
        refuse_robots()
        yield dict(os.environ)
        return
    port = find_free_port()
    environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % port)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    master = start(["roscore", "-p", str(port)], environment, **quiet)
    try:
        wait_for_port(port, master)
        yield environment
    finally:
        stop(master)


def refuse_robots():
    """End where robots are there already: the commands of the benchmark would drive them."""
    try:
        topics = rosgraph.Master("/driver_bench").getPublishedTopics("/")
    except OSError as error:
        raise SystemExit("bench: no ROS master at %s (%s)" % (rosgraph.get_master_uri(), error)) from error
    robots = [name for name, _ in topics if name.endswith("/odom")]
    if robots:
        raise SystemExit(
            "bench: there are robots already (%s), which the commands of the benchmark would drive; switch them off,"
            " wait until the server has taken their topics down, or start it again" % ", ".join(sorted(robots)[:5])
        )


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, nargs="+", default=[20, 50, 100])
    parser.add_argument("--seconds", type=float, default=10.0, help="measured time of one run")
    parser.add_argument("--repeats", type=int, default=1, help="runs of which the median is printed")
    parser.add_argument("--drivers", type=int, default=1, help="servers, each with its share of the robots")
    parser.add_argument("--speed", type=float, default=1.0, help="multiplies the rates of the robots")
    parser.add_argument("--unheard", action="store_true", help="nobody listens or commands, but for /tf")
    parser.add_argument(
        "--nagle", action="store_true", help="robots' TCP holds small writes back, as HeRo's does"
    )
    parser.add_argument("--warn", action="store_true", help="each robot sends one warning per second")
    server = parser.add_mutually_exclusive_group()
    server.add_argument("--server-command", default=DRIVER_COMMAND, help="{port} stands for the port")
    server.add_argument(
        "--port",
        type=int,
        help="a server that runs on this machine, under the ROS master of ROS_MASTER_URI, and has no robots yet",
    )
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--history", type=Path, metavar="FILE", help="add the figures to this CSV file")
    options = parser.parse_args()
    if options.port and options.drivers != 1:
        parser.error("--drivers %d: --port measures the one server that runs there" % options.drivers)
    machine_us = measure_machine_us()
    results = []
    with use_master(options) as environment:
        for count in options.robots:
            runs = [run_once(options, count, environment) for _ in range(options.repeats)]
            results.append(take_medians(runs))
    print_table(results, machine_us)
    if options.history:
        append_history(options.history, results, machine_us)
    if options.json:
        report = {"sum_of_768_bytes_us": machine_us, "load_average": os.getloadavg(), "results": results}
        Path(options.json).write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
