"""The programs that pages have started, and the recording.

They belong to the monitor, not to a page. Each runs under a guard, which ends it when the monitor ends or hangs; its
robots are stopped afterwards. Those that have robots also end when all robots are stopped, and when no page is open.
"""

import contextlib
import importlib.util
import itertools
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import IO, Any, Callable, Dict, List, Optional, Sequence

import roslib.packages

from hero_client.apps.formations import Point
from hero_node import make_printable, print_error

from . import guard
from .offers import OFFERS, ProgramDescription, read_behaviors

PROGRAMS_MAX = 20

RECORDER_PATIENCE_S, PATIENCE_S = 20.0, 3.0
"""For the end after SIGINT: the recorder may wait 10 s for its files, stopping robots takes about 0.2 s."""

SIZE_PERIOD_S = 1.0
"""Time between two looks at the size of a recording."""

LAST_BYTES = 2000
"""End of what a program has printed: the end tells why it failed."""

DESCRIBE_TIMEOUT_S = 60.0


def find_behaviors(folder: str) -> Dict[str, ProgramDescription]:
    """Return the behaviors of the suite, of installed packages and of files in a folder; may take seconds."""
    if importlib.util.find_spec("hero_swarm") is None:
        return {}
    command = [sys.executable, "-m", "hero_swarm", "describe", os.path.expanduser(folder)]
    try:
        # In a process of its own: what users wrote runs when it is loaded.
        described = subprocess.run(command, stdout=subprocess.PIPE, timeout=DESCRIBE_TIMEOUT_S, check=True).stdout
        return read_behaviors(json.loads(described))
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        print_error(f"no behaviors are offered: {error}")
        return {}


def find_programs() -> Dict[str, str]:
    """Return the programs that are installed here, with their paths; may take a second."""
    wanted = {"record": ("hero_recording", "record")}
    wanted.update((name, (offer.package, offer.program)) for name, offer in OFFERS.items())
    found = {}
    for package, program in set(wanted.values()):
        with contextlib.suppress(roslib.packages.ROSPkgException):
            found[package, program] = next(iter(roslib.packages.find_node(package, program) or []), "")
    return {name: found[program] for name, program in wanted.items() if found.get(program)}


class ChildProcess:
    """One program, from its start to its end."""

    def __init__(
        self, program: str, robots: Sequence[str] = (), places: Sequence[Point] = (), folder: Optional[Path] = None
    ) -> None:
        """robots: by their names. places: where they drive to, for the map. folder: of a recording."""
        self.program, self.robots, self.places, self.folder = program, list(robots), places, folder
        self.title = OFFERS[program].title if program in OFFERS else "recording"
        self.driven = self.robots[OFFERS[program].drives] if program in OFFERS else []
        self.start_s = time.monotonic()
        self.end_s = math.inf
        self.bytes = 0
        self.is_ending = False
        self.failure = ""
        self.thread = threading.current_thread()
        # The guard reads one end; the other is the sign of life, and is closed to end the program.
        self._guard_end, self._monitor_end = os.pipe()
        os.set_blocking(self._monitor_end, False)

    def run(self, command: Sequence[str]) -> None:
        """Run a command until its end, and keep why it failed."""
        with tempfile.TemporaryFile() as output:
            process = self._spawn(command, output)
            code = self._wait_for(process)
            # A guard that was killed leaves its program behind.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            if code != 0 and not self.is_ending:
                self.failure = read_last_line(output) or "ended with status %d" % code

    def _spawn(self, command: Sequence[str], output: IO[bytes]) -> "subprocess.Popen[bytes]":
        patience_s = PATIENCE_S if self.folder is None else RECORDER_PATIENCE_S
        guarded = [sys.executable, "-m", guard.__name__, str(patience_s), *command]
        process = subprocess.Popen(
            guarded, stdin=self._guard_end, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
        )
        os.close(self._guard_end)
        return process

    def _wait_for(self, process: "subprocess.Popen[bytes]") -> int:
        """Return the exit status; meanwhile measure the recording."""
        while True:
            with contextlib.suppress(subprocess.TimeoutExpired):
                return process.wait(SIZE_PERIOD_S)
            if self.folder is not None:
                if not self.bytes:  # the recorder takes seconds to start
                    self.start_s = time.monotonic()
                self.bytes = measure(self.folder)

    def beat(self) -> None:
        """Tell the guard that the monitor runs."""
        with contextlib.suppress(BlockingIOError, BrokenPipeError):
            if not self.is_ending:
                os.write(self._monitor_end, b".")

    def end(self) -> None:
        """Begin to end it."""
        if not self.is_ending:
            self.is_ending, self.end_s = True, time.monotonic()
            os.close(self._monitor_end)


def read_last_line(output: IO[bytes]) -> str:
    """Return the last line that a program has printed, made printable; empty without one."""
    output.seek(max(0, output.seek(0, os.SEEK_END) - LAST_BYTES))
    return make_printable(output.read().decode("utf-8", "replace").strip().rpartition("\n")[2].strip())


def measure(folder: Path) -> int:
    """Return the size of the files in a folder; those that are renamed meanwhile count next time."""
    size = 0
    with contextlib.suppress(OSError):
        size = sum(entry.stat().st_size for entry in os.scandir(folder))
    return size


class Programs:
    """All of them. To be used by one thread; its methods return at once, but for close()."""

    def __init__(self, node_name: str, hand_over: Callable[..., Any], on_end: Callable[[ChildProcess], None]) -> None:
        """node_name: of the monitor; theirs begin with it. hand_over: calls a function on the thread of this object."""
        self._node_name, self._hand_over, self._on_end = node_name.strip("/"), hand_over, on_end
        self._numbers = itertools.count(1)
        self._running: Dict[int, ChildProcess] = {}
        self._failed: Dict[int, ChildProcess] = {}
        self.paths: Dict[str, str] = {}
        """Paths of the programs that are installed."""

    @property
    def count(self) -> int:
        """Number of running programs."""
        return len(self._running)

    def find_driver(self, robots: Sequence[str]) -> str:
        """Return which program drives one of these robots, as a sentence; empty if none does."""
        for child in self._running.values():
            for robot in set(robots).intersection(child.driven):
                return f"{child.title} drives {robot}: end it first"
        return ""

    def find_robots(self, number: int) -> List[str]:
        """Return the robots of a program."""
        child = self._running.get(number) or self._failed.get(number)
        return [] if child is None else child.robots

    def find_recording(self) -> Optional[ChildProcess]:
        """Return the recording, None without one."""
        return next((child for child in self._running.values() if child.folder is not None), None)

    def start(self, child: ChildProcess, arguments: Sequence[str]) -> None:
        """Start a program."""
        number = next(self._numbers)
        self._running[number] = child
        self._failed.clear()  # the user who starts the next one has read it
        title = re.sub(r"\W", "_", os.path.splitext(os.path.basename(child.program))[0])  # of a path, too
        name = "__name:=%s_%s_%d" % (self._node_name, title, number)
        command = [self.paths[child.program], *arguments, name]
        child.thread = threading.Thread(target=self._run, args=(number, child, command), daemon=True)
        child.thread.start()

    def _run(self, number: int, child: ChildProcess, command: Sequence[str]) -> None:
        try:
            child.run(command)
        except OSError as error:
            child.failure = str(error)
        self._hand_over(self._forget, number)

    def _forget(self, number: int) -> None:
        child = self._running.pop(number)
        child.end()
        if child.failure:
            self._failed[number] = child
        self._on_end(child)

    def beat(self) -> None:
        """Tell all guards that the monitor runs; to be called several times a second."""
        for child in self._running.values():
            child.beat()

    def end(self, number: int) -> None:
        """Begin to end one; of one that has failed, drop the report."""
        self._failed.pop(number, None)
        if number in self._running:
            self._running[number].end()

    def end_those_of(self, robots: Sequence[str]) -> None:
        """Begin to end all that have one of these robots."""
        for child in self._running.values():
            if set(robots).intersection(child.robots):
                child.end()

    def end_all(self) -> bool:
        """Begin to end all that have robots; return whether any is left."""
        with_robots = [child for child in self._running.values() if child.robots]
        for child in with_robots:
            child.end()
        return bool(with_robots)

    def close(self, timeout_s: float = PATIENCE_S) -> None:
        """End all, and wait until robots are stopped; a recording closes its files by itself."""
        deadline_s = time.monotonic() + timeout_s
        children = list(self._running.values())
        for child in children:
            child.end()
        for child in children:
            if child.robots:
                child.thread.join(max(0.0, deadline_s - time.monotonic()))
                self._on_end(child)

    def describe(self) -> List[Dict[str, Any]]:
        """Return what pages show."""
        now_s = time.monotonic()
        return [
            {
                "number": number,
                "program": child.program,
                "title": child.title,
                "robots": child.robots,
                "places": [[round(1000 * x_m), round(1000 * y_m)] for x_m, y_m in child.places],
                "seconds": int(max(0.0, min(now_s, child.end_s) - child.start_s)) if number in self._running else 0,
                "bytes": child.bytes,
                "folder": str(child.folder or ""),
                "ending": child.is_ending,
                "failure": child.failure,
            }
            for number, child in [*self._running.items(), *self._failed.items()]
        ]
