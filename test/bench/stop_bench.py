"""Measures stops of simulated robots of the whole spread: each way to ask for one, each way in which robots move.

Starts its own ROS master, driver and robots: as many for each servo center and core. Run it with script/bench stop.
"""

import argparse
import asyncio
import collections
import json
import math
import os
import pty
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Dict, List, Tuple

import rospy
from measuring import print_machine, stop, wait_for_port
from running_suite import RunningSuite
from std_msgs.msg import Bool
from std_srvs.srv import SetBool
from stop_commander import MODES, TUNINGS
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from hero_test.processes import Dialog, find_free_port

HERE = Path(__file__).resolve().parent
REQUESTS = ("topic", "service", "monitor", "teleop")
"""Ways to stop all robots until they are released; they are commanded meanwhile."""

ENDS = ("program", "dead", "silent")
"""Of the program that commands the robots: Ctrl-C, at which it sends zeros, SIGKILL, SIGSTOP."""

GONE_AFTER_S = {"dead": 0.25, "silent": 0.5}
"""The driver takes a program for gone after this time (orphan_stop_s, silent_stop_s), at which measurements begin."""

RESTARTED = ("program", "dead")
METHODS = (*REQUESTS, "zero", *ENDS)
CENTERS_OFF_US = (0, 30, 50)
CORES = ("core2", "core3")
DEAD_ZONE_US = 15

REST_GOAL_S, PATH_GOAL_M, GAP_GOAL_S = 0.5, 0.04, 0.5
WATCH_S, LIMIT_S = 1.5, 8.0
REGULAR_S = 2.0
"""Time for which a program commands before it ends, also after a pause: longer than the overshoot of the position
controller's first second."""

POLL_S = 0.1
STALL_S = 0.1
"""A try in which the machine left the simulator without time for longer is repeated, so often at most:"""

REPEATS = 3


class Page:
    """One page of the monitor, on its own thread."""

    def __init__(self, port):
        """Connect as a page does."""
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self._socket = asyncio.run_coroutine_threadsafe(self._open(port), self._loop).result(20.0)

    async def _open(self, port):
        url = "127.0.0.1:%d" % port
        page = await websocket_connect(HTTPRequest(f"ws://{url}/live", headers={"Origin": "http://" + url}))
        self._clock_ms = 0
        self._reader = asyncio.ensure_future(self._drain(page))
        return page

    async def _drain(self, page):
        while True:
            text = await page.read_message()
            if text is None:
                return
            self._clock_ms = json.loads(text).get("clock_ms", self._clock_ms)

    def stop(self):
        """Press the button."""
        message = json.dumps({"do": "stop", "heard_ms": self._clock_ms})
        asyncio.run_coroutine_threadsafe(self._write(message), self._loop).result(5.0)

    async def _write(self, message):
        await self._socket.write_message(message)


class Teleop:
    """Teleoperation in its own terminal."""

    def __init__(self, suite):
        """Start it."""
        self._keys, terminal = pty.openpty()
        suite.start(["rosrun", "hero_examples", "teleop"], stdin=terminal, stdout=terminal, stderr=terminal)
        os.close(terminal)
        shown = bytearray()
        threading.Thread(target=self._drain, args=(shown,), daemon=True).start()
        suite.wait_for(lambda: b"hero_0 |" in shown, "the live line of teleop")

    def _drain(self, shown):
        while True:
            try:
                shown += os.read(self._keys, 65536)
            except OSError:  # it has ended
                return

    def stop(self):
        """Press Enter."""
        os.write(self._keys, b"\r")


class Lines(Dialog):
    """A script that answers each line with a line; the benchmark ends with it."""

    Ended = SystemExit

    def __init__(self, suite, *command):
        """Start it."""
        command = [sys.executable, *map(str, command)]
        super().__init__(suite.start(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE))


def start_commander(suite, mode, count):
    """Return a commander that is connected."""
    commander = Lines(suite, HERE / "stop_commander.py", mode, count)
    commander.read()
    return commander


class StopSuite(RunningSuite):
    """A driver, the robots of all groups, and what asks for stops."""

    def __init__(self):
        """Start the driver."""
        folder = Path(tempfile.mkdtemp(prefix="stop_bench_"))
        os.environ["ROS_HOME"] = str(folder)  # the driver keeps there that its robots are stopped
        config = folder / "driver.yaml"
        config.write_text("{allow_self_tuning: true, start_stopped: never}\n")
        super().__init__(0, f"config:={config}")

    def add_robots(self, robots_each):
        """Start this many robots of each center and core."""
        offs_us = CENTERS_OFF_US * robots_each
        self.cells = [(off_us, core) for core in CORES for off_us in offs_us]  # of each robot
        self._swarms = [self._start_swarm(core, index, offs_us) for index, core in enumerate(CORES)]

    def add_requests(self, methods):
        """Start what the methods need, and nothing else: it would cost time that the stop is measured in."""
        self._topic = rospy.Publisher("/hero_driver/stop_request", Bool, queue_size=1, tcp_nodelay=True)
        self._requests = {"topic": lambda: self._topic.publish(Bool(True)), "service": self._call}
        if "monitor" in methods:
            port = find_free_port()
            monitor = self.start(["rosrun", "hero_monitor", "monitor", "_port:=%d" % port], stdout=-1, stderr=-1)
            wait_for_port(port, monitor)
            self._requests["monitor"] = Page(port).stop
        if "teleop" in methods:
            self._requests["teleop"] = Teleop(self).stop

    def _start_swarm(self, core, index, offs_us):
        """Return the robots of one core, in a process of their own."""
        count = len(offs_us)
        options = ["--count", count, "--first-id", index * count, "--port", self.port, "--servo-timing", core]
        for number, off_us in enumerate(offs_us, index * count):
            known = (number, 1500 + off_us, 1500 - off_us, DEAD_ZONE_US)
            options += ["--error", "robot=%d,left_center_us=%d,right_center_us=%d,dead_zone_us=%d" % known]
        return Lines(self, HERE / "stopped_swarm.py", "--arena", "empty", "--motors", "factory", "--quiet", *options)

    def ask_swarms(self, line):
        """Return the answers of the robots of each core."""
        return [json.loads(swarm.ask(line)) for swarm in self._swarms]

    @staticmethod
    def _call():
        rospy.ServiceProxy("/hero_driver/stop", SetBool)(True)

    def press(self, method, commander):
        """Stop the robots by one of METHODS; return when they should."""
        pressed_s = time.monotonic()
        if method in REQUESTS:
            self._requests[method]()
        elif method == "zero":
            return float(commander.ask("zero"))
        else:
            number = {"program": signal.SIGINT, "dead": signal.SIGKILL, "silent": signal.SIGSTOP}[method]
            os.kill(commander.process.pid, number)
            if method == "program":
                return float(commander.read())
        return pressed_s + GONE_AFTER_S.get(method, 0.0)

    def release(self):
        """Release the robots stopped by one of REQUESTS."""
        self._topic.publish(Bool(False))

    def move(self, method, commander):
        """Move the robots after a press; return when all do."""
        if method in REQUESTS:
            self.release()
        if method == "silent":
            os.kill(commander.process.pid, signal.SIGCONT)
        commander.ask("go")
        self.wait_for(lambda: sum(self.ask_swarms("moving")) == len(self.cells), "all robots to move")
        if method in ENDS:
            time.sleep(REGULAR_S)

    def try_stop(self, method, commander):
        """Stop the robots once; return what the swarms noted, with times from the moment at which they should stop."""
        self.ask_swarms("mark")
        due_s = self.press(method, commander)
        while True:
            time.sleep(POLL_S)
            answers = self.ask_swarms(f"read {due_s!r}")
            waited_s = time.monotonic() - due_s
            rests_s = [rest_s for answer in answers for rest_s in answer["rest_s"]]
            if waited_s > LIMIT_S or (waited_s > WATCH_S and None not in rests_s):
                break
        noted = {key: answers[0][key] + answers[1][key] for key in ("path_m", "gap_s", "pulses")}
        noted["rest_s"] = [math.inf if at_s is None else max(0.0, at_s - due_s) for at_s in rests_s]
        noted["stall_s"] = max(answer["stall_s"] for answer in answers)
        return noted


def measure_mode(suite, mode, methods, rounds):
    """Yield the rows of one mode, a cell each: method, centers and core."""
    commander = start_commander(suite, mode, len(suite.cells))
    for method in methods:
        if method in ENDS and mode in TUNINGS:
            continue  # robots that tune themselves have no commander
        commander, rows = measure_method(suite, method, mode, commander, rounds)
        yield from rows
    stop(commander.process, signal.SIGKILL)


def measure_method(suite, method, mode, commander, rounds):
    """Return the commander, which may be another one now, and the rows of one method."""
    spare = None
    cells: Dict[Tuple[int, str], Dict[str, List[float]]] = {cell: collections.defaultdict(list) for cell in suite.cells}
    repeated = kept = 0
    while kept < rounds:
        suite.move(method, commander)
        if method in RESTARTED:
            spare = start_commander(suite, mode, len(suite.cells))
        noted = suite.try_stop(method, commander)
        if method in RESTARTED:
            stop(commander.process)
            commander = spare
        if noted["stall_s"] > STALL_S and repeated < REPEATS * rounds:
            repeated += 1
            continue
        kept += 1
        for index, cell in enumerate(suite.cells):
            for key in ("rest_s", "path_m", "gap_s", "pulses"):
                cells[cell][key].append(noted[key][index])
    if method in REQUESTS:
        suite.release()
    return commander, [summarize(method, mode, cell, repeated, values) for cell, values in cells.items()]


def summarize(method, mode, cell, repeated, values):
    """Return one row of the table."""
    rests_s = sorted(values["rest_s"])
    late = sum(
        rest_s > REST_GOAL_S or path_m > PATH_GOAL_M or gap_s > GAP_GOAL_S
        for rest_s, path_m, gap_s in zip(values["rest_s"], values["path_m"], values["gap_s"])
    )
    return {
        "method": method, "mode": mode, "center_off_us": cell[0], "core": cell[1], "tries": len(rests_s),
        "rest_p50_s": rests_s[len(rests_s) // 2], "rest_worst_s": rests_s[-1], "path_worst_m": max(values["path_m"]),
        "gap_worst_s": max(values["gap_s"]), "pulses": sum(values["pulses"]), "late": late, "repeated": repeated,
    }  # fmt: skip


def print_row(row):
    """Print one row of the table."""
    print(
        "| {method} | {mode} | {center_off_us} | {core} | {rest_p50_s:.2f} / {rest_worst_s:.2f} | {path_worst_m:.3f} | "
        "{gap_worst_s:.2f} | {pulses} | {late} of {tries} |".format(**row),
        flush=True,
    )


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=10, metavar="N", help="robots of each center and core (10)")
    parser.add_argument("--rounds", type=int, default=20, help="stops of each kind (20)")
    parser.add_argument("--via", nargs="*", metavar="METHOD", choices=METHODS, default=METHODS)
    parser.add_argument("--modes", nargs="*", metavar="MODE", choices=MODES, default=MODES)
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends what was started
    print_machine()
    with StopSuite() as suite:
        suite.add_requests(options.via)
        suite.add_robots(options.each)
        print("| by | mode | centers off, us | core | rest p50 / worst, s | path, m | gap, s | pulses | late |")
        print("|---|---|---|---|---|---|---|---|---|")
        for mode in options.modes:
            for row in measure_mode(suite, mode, options.via, options.rounds):
                print_row(row)


if __name__ == "__main__":
    main()
