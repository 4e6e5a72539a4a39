"""The frame of a program that moves robots: start, rate, sleep, and an end that stops the robots.

Signals, `rosnode kill` and a lost terminal become one flag that the program's loop checks; the loop then ends, and
`with` blocks stop the robots while the topics still work, which rospy's own signal handler would close.
"""

import io
import os
import select
import signal
import sys
import threading
import time
from types import FrameType
from typing import List, Optional, Sequence

import rospy

from ..clock import Clock
from ..command_line import say
from .private_parameters import delete_own_parameters
from .ros_node import start_ros_node

ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

SHUTDOWN_WAIT_S = 1.0
"""Delay of `rosnode kill` while the loop ends and stops its robots; stopping takes about 0.2 s."""


class Program(Clock):
    """A started ROS node, whether it is `running`, and waits that end early when it is to end.

    Use as a context manager around everything that moves robots; signals are taken over from the main thread only.
    """

    def __init__(self, name: str, anonymous: bool = False) -> None:
        """Start the node name; anonymous adds a number. Raises: NodeError: no ROS master, or wrong remappings."""
        self.end_signal: Optional[int] = None
        self._ending = False
        self._finished = threading.Event()
        self._wake_read_fd, self._wake_write_fd = os.pipe()
        os.set_blocking(self._wake_write_fd, False)
        for number in ENDING_SIGNALS:
            signal.signal(number, self._receive_signal)
        if isinstance(sys.stdout, io.TextIOWrapper):
            # Into a pipe or file Python writes nothing before it has 8 kB, and rospy does not flush.
            sys.stdout.reconfigure(line_buffering=True)
        start_ros_node(name, anonymous)
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
        """Return whether the program is to continue."""
        return not self._ending

    @property
    def now_s(self) -> float:
        """This machine's monotonic time, s."""
        return time.monotonic()

    def sleep(self, duration_s: float) -> bool:
        """Wait for duration_s, or less if the program is to end; return `running`."""
        self.wait_readable([], duration_s)
        return self.running

    def wait_readable(self, fds: Sequence[int], timeout_s: float) -> List[int]:
        """Return those of fds that can be read, after at most timeout_s; none if the program is to end."""
        if self._ending:
            return []
        readable, _, _ = select.select([self._wake_read_fd, *fds], [], [], max(0.0, timeout_s))
        return [] if self._ending else [fd for fd in readable if fd != self._wake_read_fd]

    def ask(self, question: str) -> Optional[str]:
        """Ask the user in the terminal; return the answer in lower case, None without one or if the program is to end.

        input() would keep waiting after Ctrl-C: signals only set a flag.
        """
        if sys.stdin is None:
            return None
        say(question, end="")
        while not self.wait_readable([sys.stdin.fileno()], 1.0):
            if not self.running:
                say("")
                return None
        # Byte by byte: what a file object read ahead, the next wait would not see.
        answer = b""
        while not answer.endswith(b"\n"):
            byte = os.read(sys.stdin.fileno(), 1)
            if not byte:
                break
            answer += byte
        return answer.decode(errors="replace").strip().lower() if answer else None

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *error: object) -> None:
        self._ending = True
        self._finished.set()
        delete_own_parameters()
        rospy.signal_shutdown("the program ends")
