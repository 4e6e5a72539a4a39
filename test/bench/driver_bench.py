"""Loads a rosserial TCP server with an emulated swarm and prints one table.

Starts its own ROS master and the server, listeners and commanders, each in its own process; CPU time comes from the
operating system's accounting (/proc). With --against, the driver and the one of another workspace are measured at the
same time, each with its own master and robots: the speed of a virtual machine changes from one run to the next by more
than versions differ. Run it with script/bench driver.
"""

import argparse
import contextlib
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Dict, Generator, List

from measuring import (
    find_environment,
    find_tree,
    percentile_ms,
    print_machine,
    read_all_cpu_s,
    read_cpu_s,
    read_memory_mb,
    start,
    start_master,
    stop,
    wait_for_port,
)

from hero_test.processes import find_free_port

HERE = Path(__file__).resolve().parent
SETTLE_S = 3.0

DRIVER_COMMAND = "rosrun hero_driver hero_driver _port:={port}"


def find_settling_s(count):
    """Return the time that count robots, and all programs, need until everything is registered and connected."""
    return SETTLE_S + 0.05 * count


@contextlib.contextmanager
def serve(options, server_command, environment):
    """Give pairs of process id and port of the servers, which listen and end afterwards."""
    servers = []
    try:
        for index in range(options.drivers):
            port = find_free_port()
            command = server_command.format(port=port).split()
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
        command += ["--first-id", str(first), "--count", str(end - first), "--speed", str(options.speed)]
        seconds = find_settling_s(count) + options.seconds + SETTLE_S
        command += ["--seconds", str(seconds)]
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


def run_together(runs):
    """Return the results of runs by name: generators that yield the time to wait before the next step, all the same."""
    results: Dict[str, dict] = {}
    while len(results) < len(runs):
        for name, run in runs.items():
            try:
                wait_s = next(run)
            except StopIteration as end:
                results[name] = end.value
                wait_s = 0.0
        time.sleep(wait_s)
    return results


def run_once(options, server_command, count, environment) -> Generator[float, None, Dict[str, Any]]:
    """Return the figures of one run with count robots, by run_together()."""
    load = [sys.executable, str(HERE / "ros_load.py")]
    with serve(options, server_command, environment) as servers:
        # The probe of the port was a connection too: let the server forget it.
        yield 1.0
        arguments = ["--count", str(count)]
        listener = start([*load, "listen", *arguments], environment, stdout=subprocess.PIPE)
        commander = start([*load, "command", *arguments], environment, stdout=subprocess.PIPE)
        yield SETTLE_S
        swarms = start_swarms(options, count, servers, environment)
        yield find_settling_s(count)

        def read_figures():
            server_s = sum(read_cpu_s(pid) for pid, _ in servers)
            return time.monotonic(), server_s, read_cpu_s(listener.pid), read_all_cpu_s()

        window_start_s = time.time()
        before = read_figures()
        yield options.seconds
        after = read_figures()
        ours = {pid for root in (os.getpid(), *(pid for pid, _ in servers)) for pid in find_tree(root)}
        window_end_s = time.time()
        memory_mb = sum(read_memory_mb(pid) for pid, _ in servers)
        yield SETTLE_S
        sent = collect(swarms)
        yield 0.5
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
    ("last robot synchronized, s", "joined_s", "%.2f"),
    ("robots thrown out", "thrown_out", "%d"),
    ("server memory, MB", "memory_mb", "%.0f"),
    ("bursts taken of those due, %", "bursts_sent_percent", "%.1f"),
    ("all of this measurement, cores", "bench_cores", "%.2f"),
    ("everything else, cores", "other_cores", "%.2f"),
)


def print_table(results):
    """Print medians over the rounds, one column for each server and number of robots."""
    heads = ["%d robots%s" % (result["robots"], result["server"] and ", " + result["server"]) for result in results]
    print(f"| | {' | '.join(heads)} |")
    print(f"|---|{'---|' * len(results)}")
    for title, key, form in ROWS:
        cells = ["-" if result[key] is None else form % result[key] for result in results]
        print(f"| {title} | {' | '.join(cells)} |")


def print_run(name, runs):
    """Print the newest run of a server: its figures show whether the machine was steady."""
    run = runs[-1]
    print(
        "round %d: %d robots%s: CPU %.1f %%, p99 of odom %s, of cmd_vel %s, everything else %.2f cores"
        % (
            len(runs),
            run["robots"],
            name and ", " + name,
            run["server_cpu_percent"],
            *("-" if run[key] is None else "%.2f ms" % run[key] for key in ("odom_p99_ms", "command_p99_ms")),
            run["other_cores"],
        ),
        file=sys.stderr,
        flush=True,
    )


def take_medians(runs):
    """Return one result from several runs of one server with the same number of robots."""
    result = {}
    for key in runs[0]:
        values = [run[key] for run in runs if run[key] is not None]
        result[key] = statistics.median(values) if values else None
    return result


def measure_all(options, commands):
    """Return the medians for each number of robots and server."""
    results = []
    with contextlib.ExitStack() as stack:
        environments = {name: stack.enter_context(start_master()) for name in commands}
        for count in options.count:
            runs: Dict[str, List[dict]] = {name: [] for name in commands}
            for _ in range(options.rounds):
                together = {
                    name: run_once(options, command, count, environments[name]) for name, command in commands.items()
                }
                for name, result in run_together(together).items():
                    runs[name].append(result)
                    print_run(name, runs[name])
            results += [{"server": name, **take_medians(runs[name])} for name in commands]
    return results


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, nargs="+", default=[20, 50, 100])
    parser.add_argument("--seconds", type=float, default=10.0, help="measured time of one run")
    parser.add_argument("--rounds", type=int, default=1, help="runs of each server, whose median is printed")
    parser.add_argument("--drivers", type=int, default=1, help="servers, each with its share of the robots")
    parser.add_argument("--speed", type=float, default=1.0, help="multiplies the rates of the robots")
    server = parser.add_mutually_exclusive_group()
    server.add_argument("--server-command", default=DRIVER_COMMAND, help="{port} is replaced by the port")
    server.add_argument(
        "--against",
        type=Path,
        metavar="DIR",
        help="measure the driver of the workspace DIR, or of the checkout DIR, at the same time as this one",
    )
    options = parser.parse_args()
    commands = {"": options.server_command}
    if options.against:
        # Both are started in the same way.
        commands = {
            "this driver": f"{find_environment(HERE.parents[1])} {DRIVER_COMMAND}",
            "the other": f"{find_environment(options.against)} {DRIVER_COMMAND}",
        }
    print_machine()
    print_table(measure_all(options, commands))


if __name__ == "__main__":
    main()
