"""Measures stops of simulated robots that drive: from the press to the zero on each socket, and to wheels at rest.

Starts its own ROS master, driver and robots, which are commanded at 10 Hz all the time. Run it with script/bench stop.
"""

import argparse
import asyncio
import contextlib
import json
import socket
import sys
import threading
import time
from pathlib import Path

import rosgraph
import rospy
from measuring import (
    measure_machine_us,
    percentile_ms,
    print_machine,
    wait_for_port,
    write_report,
)
from running_suite import RunningSuite
from std_msgs.msg import Bool
from std_srvs.srv import SetBool
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from hero_client.ros.drivers import Drivers
from hero_monitor.control.freshness import INERT_S
from hero_test.processes import find_free_port, suspended

HERE = Path(__file__).resolve().parent
POLL_S = 0.02
SETTLE_S = 2.0
LIMIT_S = 5.0
REST_GOAL_S = 0.3
HALF_OPEN = 100
METHODS = ("topic", "service", "program", "monitor")
CONDITIONS = ("undisturbed", "hung master", "half-open connections", "hung driver")


class Page:
    """One page of the monitor, on a thread of its own."""

    def __init__(self, port):
        """Connect as a page does."""
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self._socket = asyncio.run_coroutine_threadsafe(self._open(port), self._loop).result(20.0)

    async def _open(self, port):
        url = "127.0.0.1:%d" % port
        page = await websocket_connect(HTTPRequest("ws://%s/live" % url, headers={"Origin": "http://" + url}))
        self._clock_ms = 0
        self._reader = asyncio.ensure_future(self._drain(page))
        return page

    async def _drain(self, page):
        while True:
            text = await page.read_message()
            if text is None:
                return
            self._clock_ms = json.loads(text).get("clock_ms", self._clock_ms)

    def stop(self, stopped):
        """Press the button, or release, which does nothing shortly after a stop."""
        if not stopped:
            time.sleep(INERT_S + 0.2)
        message = json.dumps({"do": "stop" if stopped else "release", "heard_ms": self._clock_ms})
        asyncio.run_coroutine_threadsafe(self._write(message), self._loop).result(5.0)

    async def _write(self, message):
        await self._socket.write_message(message)


class Swarm:
    """The robots, in a process of their own."""

    def __init__(self, suite, robots):
        """Start them and what commands them; return when all move."""
        command = [sys.executable, str(HERE / "stopped_swarm.py"), "--count", str(robots), "--port", str(suite.port)]
        command += ["--arena", "empty", "--quiet"]
        self._process = suite.start(command, stdin=-1, stdout=-1)
        load = [sys.executable, str(HERE / "ros_load.py"), "command", "--speed", "0.1", "--count", str(robots)]
        suite.start(load, stdout=-1)
        self.robots = robots
        suite.wait_for(lambda: self.ask("read")["moving"] == robots, "%d robots that move" % robots)

    def ask(self, command):
        """Return the answer to mark or read."""
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())


def measure_press(swarm, stop):
    """Return (s to the zero, s to rest) of each robot after stop(True); None where that took LIMIT_S."""
    swarm.ask("mark")
    pressed_s = time.monotonic()
    stop(True)
    while True:
        noted = swarm.ask("read")
        is_late = time.monotonic() - pressed_s > LIMIT_S
        if is_late or (None not in noted["zero_s"] and None not in noted["rest_s"]):
            break
        time.sleep(POLL_S)
    return [
        tuple(None if moment_s is None else moment_s - pressed_s for moment_s in moments)
        for moments in zip(noted["zero_s"], noted["rest_s"])
    ]


def measure_row(suite, swarm, title, stop, presses):
    """Press so often; print and return one row."""
    samples = []
    for _ in range(presses):
        stop(False)
        suite.wait_for(lambda: swarm.ask("read")["moving"] == swarm.robots, "all robots to move")
        samples += measure_press(swarm, stop)
    stop(False)
    kept = [sample for sample in samples if None not in sample]
    zeros_s, rests_s = (sorted(values) for values in zip(*kept))
    row = {
        "title": title,
        "robots": swarm.robots,
        "presses": presses,
        "stopped": len(kept),
        "of": len(samples),
        "zero_ms": [percentile_ms(zeros_s, share) for share in (0.5, 1.0)],
        "rest_ms": [percentile_ms(rests_s, share) for share in (0.5, 1.0)],
        "rest_in_time": sum(rest_s <= REST_GOAL_S for rest_s in rests_s),
    }
    print(
        "| %s | %d | %d of %d | %.1f / %.1f | %.0f / %.0f | %d |"
        % (title, swarm.robots, len(kept), len(samples), *row["zero_ms"], *row["rest_ms"], row["rest_in_time"]),
        flush=True,
    )
    return row


@contextlib.contextmanager
def disturbed(suite, condition):
    """Let something hang."""
    with contextlib.ExitStack() as stack:
        if condition == "hung master":
            stack.enter_context(suspended(rosgraph.Master("/bench").getPid()))
        elif condition == "hung driver":
            pid = suite.start_second_driver()
            time.sleep(SETTLE_S)
            stack.enter_context(suspended(pid))
        elif condition == "half-open connections":
            uri = rosgraph.Master("/bench").lookupService("/hero_driver/stop")
            host, port = uri[len("rosrpc://") :].rstrip("/").rsplit(":", 1)
            for _ in range(HALF_OPEN):
                stack.enter_context(socket.create_connection((host, int(port)))).sendall(b"\x10\x00")
        yield


class StopSuite(RunningSuite):
    """A driver without robots of its own, and the methods to stop its robots."""

    def __init__(self, methods):
        """Start what the methods need, and nothing else: it would cost time that the stop is measured in."""
        super().__init__(0)
        self._topic = rospy.Publisher("/hero_driver/stop_request", Bool, queue_size=1, tcp_nodelay=True)
        if "program" in methods:
            self._drivers = Drivers()
        if "monitor" in methods:
            port = find_free_port()
            monitor = self.start(["rosrun", "hero_monitor", "monitor", "_port:=%d" % port], stdout=-1, stderr=-1)
            wait_for_port(port, monitor)
            self._page = Page(port)
        time.sleep(SETTLE_S)

    def start_second_driver(self):
        """Return the process of a driver without robots."""
        command = ["rosrun", "hero_driver", "hero_driver", "__name:=hero_driver_b", "_port:=%d" % find_free_port()]
        return self.start(command, stdout=-1, stderr=-1).pid

    def press(self, method, stopped):
        """Ask for a stop, or a release, in one of METHODS."""
        if method == "topic":
            self._topic.publish(Bool(stopped))
        elif method == "service":
            rospy.ServiceProxy("/hero_driver/stop", SetBool)(stopped)
        elif method == "program":
            self._drivers.request_stop(stopped)
        else:
            self._page.stop(stopped)


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--presses", type=int, default=100, help="of each row")
    parser.add_argument("--via", nargs="*", metavar="METHOD", choices=METHODS, default=METHODS)
    parser.add_argument("--conditions", nargs="*", choices=CONDITIONS, default=CONDITIONS[:1])
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    options = parser.parse_args()
    machine_us = measure_machine_us()
    print_machine(machine_us)
    suite = StopSuite(options.via)
    rows = []
    try:
        swarm = Swarm(suite, options.count)
        print("| | robots | stopped | press to zero, p50 / worst, ms | press to rest, p50 / worst, ms | within 0.3 s |")
        print("|---|---|---|---|---|---|")
        for condition in options.conditions:
            with disturbed(suite, condition):
                for method in options.via:
                    if (condition, method) == ("hung master", "service"):
                        continue  # a service is looked up with the master at each call
                    title = method if condition == CONDITIONS[0] else "%s, %s" % (method, condition)
                    press = lambda stopped, method=method: suite.press(method, stopped)  # noqa: E731
                    rows.append(measure_row(suite, swarm, title, press, options.presses))
    finally:
        suite.close()
    write_report(options.json, machine_us, rows=rows)


if __name__ == "__main__":
    main()
