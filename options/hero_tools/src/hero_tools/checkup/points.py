"""Points of the check: functions that return what they found, run side by side within a time limit."""

import os
import subprocess
import threading
import time
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence

from hero_node import one_line

OK = "OK"
WARN = "WARN"
FAIL = "FAIL"

REPORT_TIMEOUT_S = 3.0
"""Nodes report once a second; a busy PC takes its time to connect."""

LINES_MAX = 10
"""Remedies of one point."""

# Administration tools on Debian, which the PATH of a user does not contain.
TOOL_PATH = "/usr/sbin:/sbin"


class Finding(NamedTuple):
    """Finding of a point, and the remedy: lines to read or to paste."""

    state: str
    text: str
    remedy: Sequence[str] = ()


def ok(text: str, *remedy: str) -> Finding:
    """Nothing to do."""
    return Finding(OK, text, remedy)


def warn(text: str, *remedy: str) -> Finding:
    """May keep robots from being driven."""
    return Finding(WARN, text, remedy)


def fail(text: str, *remedy: str) -> Finding:
    """Keeps robots from being driven."""
    return Finding(FAIL, text, remedy)


Point = Callable[[], Finding]


def run_points(points: Dict[str, Point], timeout_s: float) -> Dict[str, Finding]:
    """Run all points at once and return their findings, at the latest after timeout_s.

    A point that hangs (a silent name server, a disk) or breaks fails; its thread ends with the program.
    """
    found: Dict[str, Finding] = {}

    def run(name: str, point: Point) -> None:
        try:
            found[name] = point()
        except Exception as error:  # noqa: BLE001  a point that broke must not hide the others
            text = f"{type(error).__name__}: {one_line(error)}"
            found[name] = fail(f"this point broke: {text}", "please report it")

    threads = [threading.Thread(target=run, args=item, daemon=True) for item in points.items()]
    for thread in threads:
        thread.start()
    end_s = time.monotonic() + timeout_s
    for thread in threads:
        thread.join(max(0.0, end_s - time.monotonic()))
    remedy = "the ROS master, a name server or a disk hangs; the other points are valid"
    late = fail(f"no answer within {timeout_s:.1f} s", remedy)
    return {name: found.get(name, late) for name in points}


def wait_until(condition: Callable[[], bool], timeout_s: float) -> bool:
    """Return as soon as a condition holds, or whether it does after timeout_s."""
    end_s = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.02)
    return condition()


def ask_system(command: List[str], timeout_s: float = 2.0) -> Optional[str]:
    """Return the output of a command that only reads; None if it is missing, fails, or does not end in time."""
    environment = dict(os.environ, LC_ALL="C", PATH=f"{os.environ.get('PATH', '')}:{TOOL_PATH}")
    try:
        result = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            env=environment, timeout=timeout_s, check=True,
        )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return result.stdout.decode(errors="replace")
