"""Work that goes on -> a bar in a terminal, a line now and then elsewhere. On stderr, so that output stays clean."""

import sys
import time
from typing import IO, Optional

from tqdm import tqdm

from hero_client.command_line import say

LINE_PERIOD_S = 10.0
"""Between two lines where nobody looks at a bar: a log."""


class Progress:
    """Shows how far one piece of work after the other is."""

    def __init__(self, stream: Optional[IO[str]] = None) -> None:
        """Show on stream, stderr if None."""
        self._stream = sys.stderr if stream is None else stream
        self._bar: Optional[tqdm[None]] = None
        self._title = ""
        self._total = 0
        self._next_line_s = 0.0

    def begin(self, title: str, total: int) -> None:
        """Begin a piece of work of total units."""
        self.end()
        self._title, self._total = title, max(1, total)
        if self._stream.isatty():
            self._bar = tqdm(
                total=self._total,
                desc=title,
                file=self._stream,
                leave=False,
                bar_format="{desc} |{bar}| {percentage:3.0f} %, {remaining} left",
            )
        self._next_line_s = time.monotonic() + LINE_PERIOD_S

    def reach(self, done: int) -> None:
        """Show that done units are finished."""
        if self._bar is not None:
            self._bar.update(done - self._bar.n)
        elif time.monotonic() >= self._next_line_s:
            self._next_line_s = time.monotonic() + LINE_PERIOD_S
            say("%s: %.0f %%" % (self._title, 100.0 * done / self._total), self._stream)

    def end(self) -> None:
        """Take the bar away; safe twice."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None
