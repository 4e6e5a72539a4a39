"""Simulated robots that note how they come to rest; for stop_bench.

stopped_swarm.py [anything that hero_sim takes]
Each line on standard input is a command; each answer is one line of JSON. Times are monotonic, of this machine.
moving  how many robots have moved in the last half second
mark    forget what was noted
read T  of each robot: rest_s, from when on both wheels were slower than 5 mm/s, null while they are not; path_m that it
        drove since T. Since the mark: gap_s, the longest time between two of its readings; pulses, how many cmd_motor
        came for it after a zero; stall_s, for how long the machine gave the simulator no time to run.
"""

import collections
import json
import sys
import threading
import time
from typing import Deque, List, Tuple

import numpy as np

from hero_driver.rosserial import packets
from hero_sim.main import build_parser, simulate
from hero_sim.robot.models import HERO
from hero_sim.world import STEP_MS

REST_M_S = 0.005
MOVING_M = 0.01
MOVING_STEPS = 50
STEPS_KEPT = 2000
READING_LENGTH = 1000
"""A robot's reading with odometry and encoders is longer, everything else shorter."""

PULSES = packets.encode_packet(HERO.received_ids["cmd_motor"], bytes(4))[:7]
"""Everything of such a packet in front of its payload."""

ZERO = packets.encode_packet(HERO.received_ids["velocity_controller/cmd_vel"], bytes(48))


class Watch:
    """Notes on one swarm."""

    def __init__(self, simulator):
        """Look at the bytes that robots send and receive, and at their wheels after each step of the world."""
        self._swarm = simulator.swarm
        # Pairs: time, travel of all wheels (m).
        self._steps: Deque[Tuple[float, np.ndarray]] = collections.deque(maxlen=STEPS_KEPT)
        self._readings_s: List[List[float]] = [[] for _ in self._swarm.robots]
        self._pulses = [0] * len(self._swarm.robots)
        self._has_zero = [False] * len(self._swarm.robots)
        self._passed_s, self._stall_s = time.monotonic(), 0.0
        for index, robot in enumerate(self._swarm.robots):
            robot.receive_bytes = self._wrap_receive(index, robot.receive_bytes)
            robot.send = self._wrap_send(index, robot.send)
        self._swarm.after_step = self._look_at_wheels
        simulator.before_advance.append(self._look_at_clock)

    def _wrap_receive(self, index, receive):
        def receive_bytes(now_ms, data):
            self._has_zero[index] = self._has_zero[index] or ZERO in data
            self._pulses[index] += self._has_zero[index] * data.count(PULSES)
            receive(now_ms, data)

        return receive_bytes

    def _wrap_send(self, index, send):
        def send_bytes(data):
            if len(data) > READING_LENGTH:
                self._readings_s[index].append(time.monotonic())
            send(data)

        return send_bytes

    def _look_at_wheels(self, _time_ms):
        self._steps.append((time.monotonic(), self._swarm.world.travels_m.copy()))

    def _look_at_clock(self, _now_ms):
        now_s = time.monotonic()
        self._stall_s, self._passed_s = max(self._stall_s, now_s - self._passed_s), now_s

    def _mark(self):
        self._stall_s = 0.0
        self._pulses[:] = [0] * len(self._pulses)
        self._has_zero[:] = [False] * len(self._has_zero)
        for readings_s in self._readings_s:
            del readings_s[:-1]

    def answer(self, command):
        """Do what a line says; return what to print."""
        if command == "mark":
            return self._mark()
        steps = list(self._steps)
        if command == "moving":
            travels_m = np.array([travel_m for _, travel_m in steps[-MOVING_STEPS:]])
            moved_m = np.abs(np.diff(travels_m, axis=0)).sum(axis=0)
            return int((moved_m.max(axis=1) > MOVING_M).sum())
        now_s = time.monotonic()
        gaps_s = [np.diff([*readings_s, now_s]).max() for readings_s in map(list, self._readings_s)]
        rest = self._find_rest(steps, float(command.split()[1]))
        return {**rest, "gap_s": gaps_s, "pulses": list(self._pulses), "stall_s": self._stall_s}

    def _find_rest(self, steps, due_s):
        times_s = np.array([at_s for at_s, _ in steps])
        first = int(np.searchsorted(times_s, due_s))
        if first == len(steps):
            return {"rest_s": [None] * len(self._pulses), "path_m": [0.0] * len(self._pulses)}
        traveled_m = np.diff(np.array([travel_m for _, travel_m in steps[max(first - 1, 0) :]]), axis=0)
        fast = np.abs(traveled_m).max(axis=2) > REST_M_S * STEP_MS / 1000.0
        last_fast = len(fast) - 1 - fast[::-1].argmax(axis=0)
        ends_s = times_s[first:]
        rests_s = [
            None if moves[-1] else float(ends_s[last] if moves.any() else due_s)
            for moves, last in zip(fast.T, last_fast)
        ]
        return {"rest_s": rests_s, "path_m": np.abs(traveled_m.mean(axis=2)).sum(axis=0).tolist()}


def main():
    """Run until a signal comes."""
    with simulate(build_parser().parse_args(), lambda text: None) as (simulator, _):
        watch = Watch(simulator)

        def serve():
            for line in sys.stdin:
                print(json.dumps(watch.answer(line.strip())), flush=True)

        threading.Thread(target=serve, daemon=True).start()
        simulator.run()


if __name__ == "__main__":
    main()
