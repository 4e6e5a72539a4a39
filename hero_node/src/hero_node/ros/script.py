"""The frame of a plain script: a ROS node that starts by itself, errors as one line, a loop with a rate."""

import ast
import os
import runpy
import signal
import sys
import threading
from types import FrameType
from typing import Any, NoReturn, Optional, Sequence, Type

import rospy

from ..command_line import check_node_arguments, find_line, print_error, run
from ..errors import HeroError, ProgramError
from .master import check_master
from .ros_clock import ROS_CLOCK
from .ros_node import start_ros_node

_START = threading.Lock()
"""Threads of a script may open robots at the same time."""

rate = ROS_CLOCK.rate


def start_node(name: str = "hero_program") -> None:
    """Start a ROS node for a plain script, unless one runs already; Robot and Swarm call this.

    Ctrl-C raises KeyboardInterrupt as in every Python program, SIGTERM and SIGHUP raise SystemExit: `with` blocks stop
    their robots before ROS shuts down. An uncaught HeroError is printed as one line. Raises: NodeError: no ROS master.
    """
    if sys.excepthook is sys.__excepthook__ and not hasattr(sys, "ps1"):  # no shell or notebook
        sys.excepthook = _print_exception
        threading.excepthook = lambda ended: _print_exception(*ended[:3])
    with _START:
        if rospy.core.is_initialized():
            check_master()  # rospy itself would wait for a master for ever
            return
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, _raise_exit)
            signal.signal(signal.SIGHUP, _raise_exit)
        start_ros_node(name, anonymous=True)


def run_script(package: str, file: str, arguments: Sequence[str]) -> NoReturn:
    """Run a script of plain rospy, and end the process; package: its own, for the usage; file: its path.

    arguments: names of those that it takes; a script without any is a node, and needs a master.
    """

    def main() -> None:
        with open(file, encoding="utf-8") as script:
            text = ast.get_docstring(ast.parse(script.read()))
        check_node_arguments(package, os.path.basename(file), text, arguments)
        if not arguments:
            check_master()
        try:
            runpy.run_path(file, run_name="__main__")
        except ModuleNotFoundError as error:
            raise ProgramError(f"{error}; script/bootstrap (or rosdep) installs what all programs need") from error

    run(main)


def _print_exception(kind: Type[BaseException], error: Any, traceback: Any) -> None:
    """Print a HeroError as one line and Ctrl-C not at all; a mistake in the script keeps its traceback."""
    if issubclass(kind, HeroError):
        print_error(str(error) + find_line(error))
    elif not issubclass(kind, (KeyboardInterrupt, SystemExit)):
        sys.__excepthook__(kind, error, traceback)


def _raise_exit(number: int, frame: Optional[FrameType]) -> None:
    for ending in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(ending, signal.SIG_IGN)  # a second one must not break off the stopping of the robots
    sys.exit(128 + number)
