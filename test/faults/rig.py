"""Parts of the fault suite: ROS masters, programs controlled by a pipe, resources of a process."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import rosgraph
import rospy

from hero_test.processes import Dialog, find_free_port
from hero_test.waiting import wait_for

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BENCH = ROOT / "test" / "bench"
DEADLINE_S = 60.0
EMULATED_NAMES = 12
STOCK_NAMES = 19
"""Topics and services of an emulated robot and of one with the complete stock firmware, odom_raw included."""


class Program(Dialog):
    """A program that answers each line that it gets with one line of JSON; it ends with `with`."""

    def __init__(self, *command, prefix=(), environment=None):
        super().__init__(
            subprocess.Popen(
                [*prefix, *command],
                env={**os.environ, **(environment or {})},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                universal_newlines=True,
                start_new_session=True,
            )
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.communicate()

    def read(self):
        """Return the next line that it prints, as what its JSON holds."""
        return json.loads(super().read())

    def interrupt(self):
        """Send SIGINT; return the last line that it prints."""
        self.process.send_signal(signal.SIGINT)
        return json.loads(self.process.communicate(timeout=DEADLINE_S)[0].splitlines()[-1])


def start_python(script, *arguments, **options):
    """Return a running script of the fault suite or, by its path, any other one."""
    return Program(sys.executable, str(HERE / script), *map(str, arguments), **options)


def wait_until_commanded(count):
    """Wait until somebody publishes commands to so many robots."""
    topics = {"/hero_%d/velocity_controller/cmd_vel" % number for number in range(count)}
    wait_for(lambda: topics <= {topic for topic, _ in rospy.get_published_topics()}, "commands to %d robots" % count)


class Master:
    """A ROS master on a port of its own, without rosout."""

    def __init__(self, host="localhost", port=0):
        self.port = port or find_free_port()
        self.environment = {"ROS_MASTER_URI": "http://%s:%d" % (host, self.port), "ROS_HOSTNAME": host}
        self._process = None

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.kill()

    def start(self):
        """Start it and return when it answers."""
        self._process = subprocess.Popen(
            ["rosmaster", "--core", "-p", str(self.port)],
            env={**os.environ, **self.environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        uri = self.environment["ROS_MASTER_URI"]
        wait_for(lambda: rosgraph.is_master_online(uri), "a ROS master at " + uri)

    @property
    def pid(self):
        """Its process."""
        return self._process.pid

    def kill(self):
        """End it without a word, as a power cut does."""
        self._process.kill()
        self._process.wait()


class Holdings(NamedTuple):
    """What a process holds."""

    memory_kb: int
    threads: int
    files: int
    registrations: int

    def describe_growth(self, before):
        """Return the changes since before, in words."""
        return "memory %+.1f MB, threads %+d, files %+d, registrations %+d" % (
            (self.memory_kb - before.memory_kb) / 1000.0,
            self.threads - before.threads,
            self.files - before.files,
            self.registrations - before.registrations,
        )


def count_robots_names(driver):
    """Return how many topics and services of robots a driver has registered, by the master."""
    state = rosgraph.Master("/faults").getSystemState()
    return sum(driver.node in nodes and name.startswith("/hero_") for part in state for name, nodes in part)


def count_holdings(driver):
    """Return what a driver holds now; its registrations are those that the master knows."""
    pid = driver.process.pid
    status = Path("/proc/%d/status" % pid).read_text()
    values = dict(line.split(":", 1) for line in status.splitlines())
    state = rosgraph.Master("/faults").getSystemState()
    return Holdings(
        int(values["VmRSS"].split()[0]),
        int(values["Threads"]),
        len(os.listdir("/proc/%d/fd" % pid)),
        sum(driver.node in nodes for part in state for _, nodes in part),
    )
