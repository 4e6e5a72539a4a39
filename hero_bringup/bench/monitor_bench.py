"""Measures what the fleet monitor costs: simulated robots that walk at random, and pages that look.

Starts its own ROS master; CPU time is taken from the operating system's accounting. Run it with script/bench monitor.
"""

import argparse
import asyncio
import json
import os
import sys
import time
from pathlib import Path

from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "hero_driver" / "bench"))
from driver_bench import (
    find_free_port,
    measure_machine_us,
    read_cpu_s,
    read_memory_mb,
    start,
    stop,
    wait_for_port,
)

SETTLE_S = 5.0
JOIN_TIMEOUT_S = 60.0


class Client:
    """One page: counts what it gets."""

    def __init__(self, port):
        self.url = "127.0.0.1:%d" % port
        self.frames = self.length = 0
        self.ready = 0

    async def open(self, truth=False):
        """Connect as a page does."""
        request = HTTPRequest("ws://%s/live" % self.url, headers={"Origin": "http://" + self.url})
        self.socket = await websocket_connect(request)
        await self.socket.write_message(json.dumps({"do": "look", "truth": truth}))
        self.reader = asyncio.ensure_future(self.read())

    async def read(self):
        """Count until the end."""
        while True:
            text = await self.socket.read_message()
            if text is None:
                return
            self.frames += 1
            self.length += len(text)
            if '"fleet"' in text:
                robots = json.loads(text)["fleet"]["robots"]
                self.ready = sum(robot["state"] == "READY" and bool(robot["odom"]) for robot in robots)

    def close(self):
        """Leave."""
        self.socket.close()


async def measure(title, monitor, clients, seconds):
    """Print one row."""
    await asyncio.sleep(SETTLE_S)
    for client in clients:
        client.frames = client.length = 0
    begin = time.monotonic(), read_cpu_s(monitor.pid)
    await asyncio.sleep(seconds)
    elapsed_s = time.monotonic() - begin[0]
    cpu = 100.0 * (read_cpu_s(monitor.pid) - begin[1]) / elapsed_s
    frames = [client.frames / elapsed_s for client in clients]
    length = sum(client.length for client in clients) / elapsed_s / max(1, len(clients))
    updates = "%.1f" % min(frames) if frames else "-"
    memory_mb = read_memory_mb(monitor.pid)
    print("| %s | %.1f %% | %s | %.1f kB/s | %.0f MB |" % (title, cpu, updates, length / 1e3, memory_mb), flush=True)
    return {"title": title, "cpu_percent": cpu, "updates_hz": frames, "bytes_per_s": length}


async def measure_all(monitor, port, options):
    """Return all rows."""
    rows = [await measure("nobody looks", monitor, [], options.seconds)]
    clients = [Client(port) for _ in range(5)]
    await clients[0].open()
    deadline_s = time.monotonic() + JOIN_TIMEOUT_S
    while clients[0].ready < options.robots and time.monotonic() < deadline_s:
        await asyncio.sleep(0.1)
    print("robots that are ready and send odometry: %d" % clients[0].ready)
    rows.append(await measure("one page", monitor, clients[:1], options.seconds))
    await clients[1].open(truth=True)
    rows.append(await measure("two pages, one with true poses", monitor, clients[:2], options.seconds))
    clients[1].close()
    for client in clients[1:]:
        await client.open()
    rows.append(await measure("five pages", monitor, clients, options.seconds))
    for client in clients:
        client.close()
    return rows


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robots", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=10.0, help="measured time of each row")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    options = parser.parse_args()
    master_port, driver_port, port = find_free_port(), find_free_port(), find_free_port()
    environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % master_port)
    quiet = {"stdout": os.open(os.devnull, os.O_WRONLY), "stderr": os.open(os.devnull, os.O_WRONLY)}
    machine_us = measure_machine_us()
    started = []
    try:
        started.append(start(["roscore", "-p", str(master_port)], environment, **quiet))
        wait_for_port(master_port, started[-1])
        launch = ["roslaunch", "hero_bringup", "hero_bringup.launch", "host:=127.0.0.1", "port:=%d" % driver_port]
        started.append(start([*launch, "sim:=%d" % options.robots], environment, **quiet))
        walk = ["roslaunch", "hero_examples", "random_walk.launch", "robots:=0-%d" % (options.robots - 1)]
        started.append(start(walk, environment, **quiet))
        monitor = start(["rosrun", "hero_bringup", "monitor", "_port:=%d" % port], environment, **quiet)
        started.append(monitor)
        wait_for_port(port, monitor)
        print("sum of 768 bytes: %.2f us; %d robots" % (machine_us, options.robots))
        print("| | CPU of one core | updates/s of each page | to each page | memory |\n|---|---|---|---|---|")
        rows = asyncio.run(measure_all(monitor, port, options))
    finally:
        for process in reversed(started):
            stop(process)
    if options.json:
        report = {"sum_of_768_bytes_us": machine_us, "robots": options.robots, "rows": rows}
        Path(options.json).write_text(json.dumps(report, indent=2) + "\n")


if __name__ == "__main__":
    main()
