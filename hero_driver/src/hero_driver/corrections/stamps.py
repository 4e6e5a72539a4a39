"""Corrects stamps of robots: not in the future, never backwards, not uptime.

The robot's clock is set anew every 2.5 s and jumps then (node_handle.h:361); before the first answer it
counts from boot. Pure: stamps are integers in nanoseconds since the epoch, time of arrival comes in.
"""

from typing import Dict, Union

NS_PER_S = 10**9

STEP_NS = 1000
"""Distance of a stamp from the one before it while the robot's clock has gone back: 1 us keeps them distinct."""


STEP_SLACK_NS = 1000 * STEP_NS
"""Limit of many such steps in a row."""


Topic = Union[str, bytes]
"""Key of a sequence of rising stamps: a topic by its name, a transform by its frames."""


class StampFilter:
    """Corrects the stamps of all topics of one robot.

    Attributes:
        corrected: stamps that were replaced so far.
        last_ns: the newest stamp of each topic. One that correct() has let through unchanged at this time of arrival
            may be written here for other topics with older ones, without asking again.
    """

    def __init__(self, use_arrival: bool, max_future_s: float, max_age_s: float) -> None:
        """Take the time of arrival instead of the robot's with use_arrival, or outside the two limits.

        max_future_s: how far a stamp may lie after its arrival; max_age_s: how far before.
        """
        self._use_arrival = use_arrival
        self._max_future_ns = int(max_future_s * NS_PER_S)
        # Where the arrival is taken, no stamp is in the limits.
        self._lowest_ns = self._max_future_ns + 1 if use_arrival else -int(max_age_s * NS_PER_S)
        self.last_ns: Dict[Topic, int] = {}
        self.corrected = 0

    def correct(self, topic: Topic, stamp_ns: int, arrival_ns: int) -> int:
        """Return the stamp (ns) to publish on topic for a message stamped stamp_ns that came at arrival_ns."""
        last_ns = self.last_ns.get(topic)
        result_ns = stamp_ns
        if not self._lowest_ns <= stamp_ns - arrival_ns <= self._max_future_ns:
            result_ns = arrival_ns
            if not self._use_arrival:
                self.corrected += 1
        if last_ns is not None and result_ns <= last_ns:
            if last_ns - arrival_ns > self._max_future_ns + STEP_SLACK_NS:
                # No stamp that was let through lies this far ahead of its arrival: ROS time itself went back
                # (the clock was set, or a bag or simulation began anew).
                self.last_ns.clear()
            else:
                result_ns = last_ns + STEP_NS
                self.corrected += 1
        self.last_ns[topic] = result_ns
        return result_ns
