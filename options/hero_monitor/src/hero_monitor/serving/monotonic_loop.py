"""The event loop of the pages: its timers do not notice when the PC's clock is set."""

import time

import tornado.platform.asyncio


class MonotonicLoop(tornado.platform.asyncio.AsyncIOLoop):
    """tornado's loop, which becomes that of this thread. By the PC's clock, periods would pause when it is set back."""

    def time(self) -> float:
        """Return the time by which timers run, in s."""
        return time.monotonic()
