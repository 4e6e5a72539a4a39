"""Times of one robot, and stamps by the server's time answers, in whole ms as ros_lib's NodeHandle computes them.

Pure. Source: setNow(), now() and syncTime() of ros_lib's node_handle.h, by their documented behavior.
"""

from typing import Tuple

from hero_driver.rosserial.payloads import WireTime

NEVER_MS = 2**62
LONG_AGO_MS = -(2**40)
"""Later, and earlier, than any simulated time."""

_NS_PER_S = 10**9


class RobotClock:
    """Clock of one robot; before the first time response it is its uptime."""

    def __init__(self) -> None:
        """Begin without an answer."""
        self._offset_ns = 0

    def receive_answer(self, answer: WireTime, requested_at_ms: int) -> None:
        """Set the clock: the answer counts as the time at which the request was sent, requested_at_ms after
        power-on."""
        self._offset_ns = answer.secs * _NS_PER_S + answer.nsecs - requested_at_ms * 10**6

    def jump(self, by_s: float) -> None:
        """Put the clock wrong by by_s seconds until the next answer."""
        self._offset_ns += int(by_s * _NS_PER_S)

    def stamp(self, now_ms: int) -> Tuple[int, int]:
        """Return seconds and nanoseconds for a message that is made now_ms after power-on."""
        total_ns = max(now_ms * 10**6 + self._offset_ns, 0)
        return (total_ns // _NS_PER_S) & 0xFFFFFFFF, total_ns % _NS_PER_S
