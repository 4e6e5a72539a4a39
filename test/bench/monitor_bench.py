"""Measures what the fleet monitor costs: simulated robots that walk at random, and open pages.

Starts its own ROS master; CPU time is taken from the operating system's accounting. Run it with script/bench monitor.
"""

import argparse
import asyncio
import contextlib
import json
import subprocess
import time

from measuring import (
    print_machine,
    read_cpu_s,
    read_memory_mb,
    start,
    start_master,
    stop,
    wait_for_port,
)
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from hero_test.processes import find_free_port

SETTLE_S = 5.0
JOIN_TIMEOUT_S = 60.0


class Client:
    """One page: counts what it gets."""

    def __init__(self, port):
        self.url = "127.0.0.1:%d" % port
        self.frames = self.length = 0
        self.ready = 0

    async def open(self):
        """Connect as a page does."""
        request = HTTPRequest(f"ws://{self.url}/live", headers={"Origin": "http://" + self.url})
        self.socket = await websocket_connect(request)
        await self.socket.write_message(json.dumps({"do": "show", "picture": False}))
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
    updates = f"{min(frames):.1f}" if frames else "-"
    memory_mb = read_memory_mb(monitor.pid)
    print(f"| {title} | {cpu:.1f} % | {updates} | {length / 1000.0:.1f} kB/s | {memory_mb:.0f} MB |", flush=True)


async def measure_all(monitor, port, options):
    """Print all rows."""
    await measure("no page", monitor, [], options.seconds)
    clients = [Client(port) for _ in range(5)]
    await clients[0].open()
    deadline_s = time.monotonic() + JOIN_TIMEOUT_S
    while clients[0].ready < options.count and time.monotonic() < deadline_s:
        await asyncio.sleep(0.1)
    print("robots that are ready and send odometry: %d" % clients[0].ready)
    await measure("one page", monitor, clients[:1], options.seconds)
    for client in clients[1:]:
        await client.open()
    await measure("five pages", monitor, clients, options.seconds)
    for client in clients:
        client.close()


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seconds", type=float, default=10.0, help="measured time of each row")
    options = parser.parse_args()
    print_machine()
    driver_port, port = find_free_port(), find_free_port()
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with start_master() as environment, contextlib.ExitStack() as started:

        def run(*command):
            process = start(command, environment, **quiet)
            started.callback(stop, process)
            return process

        run(
            "roslaunch",
            "hero_bringup",
            "hero_bringup.launch",
            "host:=127.0.0.1",
            "port:=%d" % driver_port,
            "count:=%d" % options.count,
        )
        run("roslaunch", "hero_examples", "random_walk.launch", "robots:=0-%d" % (options.count - 1))
        monitor = run("rosrun", "hero_monitor", "monitor", "_port:=%d" % port)
        wait_for_port(port, monitor)
        print("| %d robots | CPU of one core | updates/s of each page | to each page | memory |" % options.count)
        print("|---|---|---|---|---|")
        asyncio.run(measure_all(monitor, port, options))


if __name__ == "__main__":
    main()
