"""Progress of a program with many runs: a bar on a terminal, else a line every 10 s."""

import sys
import time
from typing import Any

from tqdm import tqdm

REPORT_S = 10.0


class Progress:
    """Runs that are done, of all, and about how long the others take."""

    def __init__(self, total: int, begun: int, name: str = "") -> None:
        """Begin; begun: runs that were done before; name: of what is computed, where there may be several."""
        self._total, self._begun, self._done, self._name = total, begun, 0, f"{name}: " if name else ""
        self._start_s = self._told_s = time.monotonic()
        shown = {"desc": name or None, "unit": "run", "disable": None, "file": sys.stderr}
        self._bar = tqdm(total=total, initial=begun, **shown)

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *_: Any) -> None:
        self._bar.close()

    def add(self, runs: int, remark: str = "") -> None:
        """Count runs that are done; remark: how good they are."""
        self._bar.set_postfix_str(remark, refresh=False)
        self._bar.update(runs)
        self._done += runs
        now_s, left = time.monotonic(), self._total - self._begun - self._done
        if self._bar.disable and now_s >= self._told_s + REPORT_S and left > 0:
            self._told_s, left_s = now_s, (now_s - self._start_s) * left / self._done
            told = self._name, self._begun + self._done, self._total, left_s, remark and f"; {remark}"
            print("%s%d of %d runs, about %.0f s left%s" % told, file=sys.stderr)
