"""Corrects stamps (ns) of robots: not in the future, never backwards, not uptime. Pure: time of arrival comes in.

The robot's clock is set anew every 2.5 s and jumps then (node_handle.h:361); before that it counts from boot. It takes
the time at which its request came as that at which it was sent: until the next one it is ahead by as long as that was
under way, or waited for a busy computer. No message comes before its time, so arrival is nearer to the truth then.
"""

import collections
import itertools
from typing import DefaultDict, Dict, Iterator, Union

NS_PER_S = 10**9

MAX_FUTURE_NS = NS_PER_S // 20
MAX_AGE_NS = 5 * NS_PER_S
"""Stamps further in the future, or in the past, are of a clock that was not set: their corrections are counted."""

LEAD_NS = 2 * 10**6
"""Stamps up to this far in the future stay as they are: messages take unlike times."""

STEP_NS = 1000
"""Distance of a stamp from the one before it while the robot's clock has gone back: 1 us keeps them distinct."""

STEP_SLACK_NS = 1000 * STEP_NS
"""Limit of many such steps in a row."""

Topic = Union[str, bytes]
"""Key of a sequence of rising stamps: a topic by its name, a transform by its frames."""


class StampFilter:
    """Corrects the stamps of all topics of one robot, and counts their messages; corrected: stamps that were wrong.

    last_ns: the newest stamp of each topic. One that correct() has let through unchanged may be written here for other
    topics with older ones, at the same time of arrival.
    """

    def __init__(self) -> None:
        self.last_ns: Dict[Topic, int] = {}
        self.corrected = 0
        self._ahead_ns = self._replacement_ns = 0
        self._seqs: DefaultDict[str, Iterator[int]] = collections.defaultdict(itertools.count)

    def count(self, topic: str) -> int:
        """Return the sequence number of the next message on topic."""
        return next(self._seqs[topic])

    def correct(self, topic: Topic, stamp_ns: int, arrival_ns: int) -> int:
        """Return the stamp (ns) to publish on topic for a message stamped stamp_ns that came at arrival_ns."""
        last_ns = self.last_ns.get(topic)
        result_ns = stamp_ns
        if not -MAX_AGE_NS <= stamp_ns - arrival_ns <= MAX_FUTURE_NS:
            result_ns = arrival_ns
            self.corrected += 1
        elif stamp_ns == self._ahead_ns:
            result_ns = self._replacement_ns  # odometry and transforms of a reading stay together in two reads, too
        elif stamp_ns > arrival_ns + LEAD_NS:
            self._ahead_ns, self._replacement_ns = stamp_ns, arrival_ns
            result_ns = arrival_ns
        if last_ns is not None and result_ns <= last_ns:
            if last_ns - arrival_ns > MAX_FUTURE_NS + STEP_SLACK_NS:
                # No stamp that was let through lies this far ahead of its arrival: ROS time itself went back
                # (the clock was set, or a bag or simulation began anew).
                self.last_ns.clear()
            else:
                result_ns = last_ns + STEP_NS
                self.corrected += 1
        self.last_ns[topic] = result_ns
        return result_ns
