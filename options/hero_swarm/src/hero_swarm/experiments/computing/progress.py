"""Progress of a program with many runs: a bar on a terminal, and every 10 s where a file takes what it says."""

import sys
from typing import Any

from tqdm import tqdm

REPORT_S = 10.0


def show_progress(total: int, begun: int, name: str = "") -> Any:
    """Return a tqdm of the runs that are done, of all, and about how long the others take; update() counts more.

    begun: runs that were done before; name: of what is computed, where there may be several.
    """
    period_s = 0.1 if sys.stderr.isatty() else REPORT_S
    return tqdm(total=total, initial=begun, desc=name or None, unit="run", mininterval=period_s, file=sys.stderr)
