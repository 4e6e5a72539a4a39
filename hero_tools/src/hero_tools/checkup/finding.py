"""Functions that look at one thing -> findings, side by side and within a time limit.

A point that does not return in time (a name server that is silent, a disk that hangs) becomes a finding of its own;
its thread is left behind and dies with the program.
"""

import threading
import time
from typing import Callable, Dict, List, NamedTuple, Sequence

OK = "OK"
WARN = "WARN"
FAIL = "FAIL"


class Finding(NamedTuple):
    """What was found at one point, and the remedy: lines to read or to paste, none where all is well."""

    point: str
    state: str
    says: str
    remedy: Sequence[str] = ()


Point = Callable[[], List[Finding]]


def run_points(points: Dict[str, Point], timeout_s: float) -> List[Finding]:
    """Run all points at once and return their findings in the order of the points, at the latest after timeout_s."""
    found: Dict[str, List[Finding]] = {}

    def run(name: str, point: Point) -> None:
        try:
            found[name] = point()
        except Exception as error:  # noqa: BLE001  a point that broke must not hide the others
            text = "%s: %s" % (type(error).__name__, " ".join(str(error).split()))
            found[name] = [Finding(name, FAIL, "this point broke: %s" % text, ["please report it"])]

    threads = [
        threading.Thread(target=run, args=(name, point), daemon=True) for name, point in points.items()
    ]
    for thread in threads:
        thread.start()
    end_s = time.monotonic() + timeout_s
    for thread in threads:
        thread.join(max(0.0, end_s - time.monotonic()))
    late = ["a name server or a disk that hangs does this; the other points hold"]
    findings: List[Finding] = []
    for name in points:
        findings += found.get(name) or [Finding(name, FAIL, "no answer within %.1f s" % timeout_s, late)]
    return findings
