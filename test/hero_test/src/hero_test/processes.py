"""Programs as processes of their own, what they print, and free ports for them. Knows nothing of ROS topics."""

import contextlib
import os
import random
import re
import signal
import socket
import subprocess
import threading
import xmlrpc.client

import rosgraph

from hero_test.waiting import TIMEOUT_S, wait_for

_ports = iter(random.sample(range(22000, 32000), 10000))
"""Below those that systems give to connections, which would take the port before the program that it is for."""


def find_free_port():
    """Return a TCP port that is free now, another one at each call."""
    for port in _ports:
        with contextlib.suppress(OSError), socket.socket() as probe:
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no port is free")


def find_program(package, name):
    """Return the path of a program: rosrun is a shell around it, which would get the signals meant for it."""
    paths = [os.path.join(prefix, "lib", package, name) for prefix in os.environ["CMAKE_PREFIX_PATH"].split(":")]
    return next(path for path in paths if os.path.exists(path))


def find_pid(node):
    """Return the process of a node that runs."""
    return xmlrpc.client.ServerProxy(rosgraph.Master("/test").lookupNode(node)).getPid("/test")[2]


@contextlib.contextmanager
def suspended(*pids):
    """Suspend processes for as long as the context lasts: they keep their sockets, but read and answer nothing."""
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def has_traceback(text):
    """Return whether a program printed a traceback.

    That with which roslaunch and rospy end on Debian 11 does not count: they are older than its Python, whose threads
    have no isAlive.
    """
    return "Traceback" in re.sub(r"(?s)Traceback.*?has no attribute 'isAlive'", "", text)


class Dialog:
    """A process that answers each line that it gets with a line; Ended is raised if it ends instead."""

    Ended = AssertionError

    def __init__(self, process):
        """process: with pipes of text to its standard input and from its output."""
        self.process = process

    def ask(self, line):
        """Send one line; return the answer."""
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.read()

    def read(self):
        """Return the next line that it prints."""
        line = self.process.stdout.readline()
        if not line:
            raise self.Ended(f"{self.process.args} ended with {self.process.wait()}")
        return line


class Program:
    """A program in its own session, and the lines that it prints, errors among them."""

    def __init__(self, *command, environment=None, stdin=subprocess.DEVNULL):
        """environment: variables besides ours."""
        self.process = subprocess.Popen(
            command,
            env={**os.environ, **(environment or {})},
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            universal_newlines=True,
            start_new_session=True,
        )
        self.lines = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        with self.process.stdout:
            for line in self.process.stdout:
                self.lines.append(line.rstrip("\n"))

    def text(self):
        """Return all that it printed so far."""
        return "".join(line + "\n" for line in list(self.lines))

    def find_lines(self, pattern):
        """Return the lines that match a regular expression."""
        return [line for line in list(self.lines) if re.search(pattern, line)]

    def wait_line(self, pattern):
        """Return the first line that matches a regular expression, once it is printed."""
        return wait_for(lambda: self.find_lines(pattern), lambda: f"{pattern!r} among {self.lines}")[0]

    def wait_for_text(self, text):
        """Wait until it has printed a text."""
        self.wait_line(re.escape(text))

    def wait_end(self, timeout_s=TIMEOUT_S):
        """Wait until it has ended by itself; return its exit code. All that it printed is known then."""
        try:
            code = self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        self._reader.join()
        return code

    def end(self, number=signal.SIGINT):
        """Send a signal, wait for the end and return the exit code; safe when it has ended."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.wait_end()

    def close(self):
        """Kill it unless it has ended."""
        if self.process.poll() is None:
            self.process.kill()
        self.wait_end()


class ExampleProgram(Program):
    """A node of hero_examples as a user starts it, with a new name: private parameters outlive a node."""

    _count = 0

    def __init__(self, name, *arguments, environment=None):
        ExampleProgram._count += 1
        node = "__name:=%s_%d" % (name, ExampleProgram._count)
        super().__init__(find_program("hero_examples", name), node, *arguments, environment=environment)
