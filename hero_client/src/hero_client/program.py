"""The life of a program that moves robots: start, parameters, sleep, and an end that leaves robots standing.

Signals, `rosnode kill` and a lost terminal become one flag that the program's loop looks at; the loop then ends, and
`with` blocks stop the robots while the topics still work. (rospy's own signal handler closes the topics at the same
time as user code runs.) This module knows no robot and no topic.
"""

import io
import math
import os
import select
import signal
import sys
import threading
import time
from types import FrameType
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import rospy

from . import command_line
from .ros_node import NodeError, start_ros_node

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

SHUTDOWN_WAIT_S = 1.0
"""How long `rosnode kill` is held up while the loop ends and stops its robots; stopping takes about 0.2 s."""

ALL_ROBOTS = "all"
"""What a user writes instead of ids for every robot that the driver reports."""


class ProgramError(Exception):
    """The program cannot work as it was started; the text is one line that says why and what to do."""


class Program:
    """A started ROS node with one question, `running`, and waits that end early when the answer becomes no.

    Use as a context manager around everything that moves robots: leaving it tells ROS that the node ends.
    Signals are taken over from the main thread only; they end the program after its loop has noticed.
    """

    def __init__(self, name: str, anonymous: bool = False) -> None:
        """Start the node name; anonymous adds a number so that several can run.

        Raises: ProgramError without a ROS master, or for wrong remappings on the command line.
        """
        self.end_signal: Optional[int] = None
        self._ending = False
        self._due_s = -math.inf
        self._finished = threading.Event()
        self._wake_read_fd, self._wake_write_fd = os.pipe()
        os.set_blocking(self._wake_write_fd, False)
        for number in ENDING_SIGNALS:
            signal.signal(number, self._receive_signal)
        if isinstance(sys.stdout, io.TextIOWrapper):
            # Into a pipe or file Python writes nothing before it has 8 kB, and rospy does not flush.
            sys.stdout.reconfigure(line_buffering=True)
        try:
            start_ros_node(name, anonymous)
        except NodeError as error:
            raise ProgramError(str(error)) from None
        rospy.on_shutdown(self._await_finish)

    def _receive_signal(self, number: int, frame: Optional[FrameType]) -> None:
        self.end_signal = number
        self.end()

    def end(self) -> None:
        """Make `running` false and every wait return; safe from signal handlers and other threads."""
        self._ending = True
        try:
            os.write(self._wake_write_fd, b"\0")
        except BlockingIOError:
            return  # the pipe is full of wake-ups already

    def _await_finish(self) -> None:
        """Hold up ROS's shutdown until the program has left its `with` block."""
        self.end()
        self._finished.wait(SHUTDOWN_WAIT_S)

    @property
    def running(self) -> bool:
        """Whether the program shall go on."""
        return not self._ending

    def sleep(self, duration_s: float) -> bool:
        """Wait for duration_s, or less if the program is to end; return `running`."""
        self.wait_readable([], duration_s)
        return self.running

    def pace(self, period_s: float) -> bool:
        """Wait until period_s after the end of the last such wait was due, or until the program is to end.

        A loop of steps that take time keeps its rate so; a step that took longer than the period is not made up for.
        Returns `running`.
        """
        now_s = time.monotonic()
        self._due_s = max(now_s, self._due_s + period_s) if now_s - self._due_s < 2.0 * period_s else now_s + period_s
        return self.sleep(self._due_s - now_s)

    def wait_readable(self, fds: Sequence[int], timeout_s: float) -> List[int]:
        """Return those of fds that can be read, after at most timeout_s; none if the program is to end."""
        if self._ending:
            return []
        readable, _, _ = select.select([self._wake_read_fd, *fds], [], [], max(0.0, timeout_s))
        return [] if self._ending else [fd for fd in readable if fd != self._wake_read_fd]

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *error: object) -> None:
        self._ending = True
        self._finished.set()
        rospy.signal_shutdown("the program ends")


def run(main: Callable[[], Optional[int]]) -> None:
    """Run main and end the process with its exit status, None: 0; a ProgramError becomes its line and status 1."""
    command_line.run(main, ProgramError)


def read_parameters(defaults: Dict[str, Any]) -> Dict[str, Any]:
    """Return the node's private parameters, with defaults for those that are not set.

    Raises: ProgramError for a parameter that is not in defaults, with the names that are.
    """
    try:
        given = rospy.get_param("~", {})
    except KeyError:
        given = {}
    unknown = sorted(set(given) - set(defaults))
    if unknown:
        raise ProgramError(
            "unknown parameter ~%s; known are: %s" % (unknown[0], ", ".join(sorted(defaults)))
        )
    return {**defaults, **given}


def check_number(name: str, value: Any, low: float, high: float, unit: str = "") -> float:
    """Return value as a float if it is a number in low..high.

    Raises: ProgramError with the name, the value and the range.
    """
    allowed = "a number from %g to %g%s" % (low, high, " " + unit if unit else "")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ProgramError("~%s is %r, but must be %s" % (name, value, allowed))
    if not (math.isfinite(value) and low <= value <= high):
        raise ProgramError("~%s is %r, but must be %s" % (name, value, allowed))
    return float(value)


def check_flag(name: str, value: Any) -> bool:
    """Return value if it is true or false.

    Raises: ProgramError with the name and the value.
    """
    if not isinstance(value, bool):
        raise ProgramError("~%s is %r, but must be true or false" % (name, value))
    return value


def parse_robot_ids(name: str, value: Any) -> Optional[List[int]]:
    """Return the robot ids in value: a number, a list of numbers, or text such as "0 1 2" or "0,1,2" or "0-3".

    None stands for all robots that there are: the word "all".

    Raises: ProgramError for anything else, for a negative or repeated id, and for an empty list.
    """
    example = 'ids such as "0 1 2 3" or "0-3", or "all"'
    words: List[Any]
    if value == ALL_ROBOTS:
        return None
    if isinstance(value, str):
        words = value.replace(",", " ").split()
    elif isinstance(value, (list, tuple)):
        words = list(value)
    else:
        words = [value]
    ids: List[int] = []
    for word in words:
        first, last = _parse_id_range(word)
        if first < 0 or last < first or last - first >= 1000:
            raise ProgramError("~%s holds %r, but must hold robot %s" % (name, word, example))
        ids.extend(range(first, last + 1))
    if not ids:
        raise ProgramError("~%s is empty, but must hold robot %s" % (name, example))
    for robot_id in ids:
        if ids.count(robot_id) > 1:
            raise ProgramError("~%s names robot %d more than once" % (name, robot_id))
    return ids


def _parse_id_range(word: Any) -> Tuple[int, int]:
    """Return first and last id of a word; (-1, -1) if it names none."""
    if isinstance(word, int) and not isinstance(word, bool):
        return word, word
    first, dash, last = str(word).partition("-")
    if not first.isdecimal() or (dash and not last.isdecimal()):
        return -1, -1
    return int(first), int(last if dash else first)
