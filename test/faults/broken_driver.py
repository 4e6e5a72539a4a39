"""The driver with one part broken on purpose, for faults that no input causes.

broken_driver.py PART TRIGGER [anything that the driver takes]
While the file TRIGGER exists, PART raises an exception: `loop` the loop of the sockets itself, `open_link` what a
new connection is told to. With `clock`, the clock of this process, not of the machine, is ahead by as many seconds
as TRIGGER holds.
"""

import os
import sys
import time

from hero_driver import node
from hero_driver.gateway import Gateway
from hero_driver.transport.event_loop import EventLoop

PARTS = {"loop": (EventLoop, "_run_once"), "open_link": (Gateway, "open_link")}


def break_part(part, trigger):
    """Let a part raise while the file trigger exists."""
    owner, name = PARTS[part]
    whole = getattr(owner, name)

    def broken(*arguments):
        if os.path.exists(trigger):
            raise RuntimeError("broken on purpose")
        return whole(*arguments)

    setattr(owner, name, broken)


def set_clock(trigger):
    """Let the clock, as Python and rospy read it, be ahead by what the file trigger holds."""
    true_time_ns = time.time_ns

    def read_ns():
        offset_s = 0
        if os.path.exists(trigger):
            with open(trigger, encoding="utf-8") as file:
                offset_s = int(file.read() or 0)
        return true_time_ns() + offset_s * 10**9

    time.time_ns = read_ns
    time.time = lambda: read_ns() / 1e9


if __name__ == "__main__":
    if sys.argv[1] == "clock":
        set_clock(sys.argv[2])
    else:
        break_part(sys.argv[1], sys.argv[2])
    sys.exit(node.main())
