"""Subscribes to emulated robots in its own process, and counts what is missing, late or out of order.

listener.py --count N [--first-id K]
A line on stdin is answered with one line of JSON: `window` ends a window and tells about it, `silent` gives the
robots of which no odom came since the window began, `count` the number of messages since then.
"""

import argparse
import json
import struct
import sys
import threading
import time

import rospy


class Raw(rospy.AnyMsg):
    """Message bytes, unread."""


class Window:
    """What came since the window began."""

    def __init__(self):
        self.delays_s = []
        self.counts = {}
        self.gaps = {}
        self.transforms = 0


class Listener:
    """The subscribers, and what they know of each robot's sequence numbers."""

    def __init__(self, numbers):
        self._lock = threading.Lock()
        self._window = Window()
        self._last = {}
        self._numbers = list(numbers)
        for number in self._numbers:
            for topic in ("odom_raw", "odom"):
                rospy.Subscriber(
                    "/hero_%d/%s" % (number, topic),
                    Raw,
                    self._take,
                    callback_args=(topic, number),
                    queue_size=1000,
                    tcp_nodelay=True,
                )
        rospy.Subscriber("/tf", Raw, self._take_transforms, queue_size=1000, tcp_nodelay=True)

    def _take(self, message, key):
        now_s = time.time()
        seq, secs, nsecs = struct.unpack_from("<3I", message._buff)
        with self._lock:
            window = self._window
            last = self._last.get(key)
            if last is not None and seq != last + 1:
                window.gaps.setdefault(key, []).append(seq - last - 1)
            self._last[key] = seq
            window.counts[key] = window.counts.get(key, 0) + 1
            if key[0] == "odom":
                window.delays_s.append(now_s - secs - nsecs * 1e-9)

    def _take_transforms(self, message):
        with self._lock:
            self._window.transforms += struct.unpack_from("<I", message._buff)[0]

    def count(self):
        """Return how many messages of odometry came since the last window ended."""
        with self._lock:
            return sum(self._window.counts.values())

    def list_silent(self):
        """Return the robots of which no odom came since the last window ended."""
        with self._lock:
            return [number for number in self._numbers if ("odom", number) not in self._window.counts]

    def end_window(self):
        """Return what came since the last call; the robots' numbers count, so each message is there or lost."""
        silent = self.list_silent()
        with self._lock:
            window, self._window = self._window, Window()
        delays_s = sorted(window.delays_s)

        def find_ms(share):
            return delays_s[min(len(delays_s) - 1, int(share * len(delays_s)))] * 1e3 if delays_s else None

        return {
            "messages": sum(window.counts.values()),
            "silent": silent,
            "lost": sum(gap for gaps in window.gaps.values() for gap in gaps if gap > 0),
            "disordered": sum(gap <= 0 for gaps in window.gaps.values() for gap in gaps),
            "transforms": window.transforms,
            "p50_ms": find_ms(0.5),
            "p99_ms": find_ms(0.99),
        }


def main():
    """Run from the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--first-id", type=int, default=0)
    options = parser.parse_args()
    rospy.init_node("fault_listener", anonymous=True, disable_signals=True)
    listener = Listener(range(options.first_id, options.first_id + options.count))
    answers = {"window": listener.end_window, "silent": listener.list_silent, "count": listener.count}
    print("{}", flush=True)
    for line in sys.stdin:
        print(json.dumps(answers[line.strip()]()), flush=True)


if __name__ == "__main__":
    main()
