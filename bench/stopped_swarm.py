"""Simulated robots that note when a zero reaches their socket and when their wheels rest; for stop_bench.

stopped_swarm.py [anything that hero_sim takes]
Each line on standard input is a command; each answer is one line of JSON. Times are monotonic, of this machine.
mark    forget what was noted
read    {"zero_s": [...], "rest_s": [...], "moving": N}: per robot when the first zero came, and from when on its wheels
        turned by less than one tick of the encoder, null while they turn; how many robots move
"""

import json
import sys
import threading
import time
from typing import List, Optional

import numpy as np

from hero_driver.rosserial import packets
from hero_sim.main import build_parser, simulate
from hero_sim.robot import declarations
from hero_sim.robot_constants import TICK_M

REST_M_S = 0.001
MOVING_M_S = 0.03
ZERO = packets.encode_packet(declarations.ID_VELOCITY_CMD_VEL, bytes(48))


class Watch:
    """What is noted of one swarm."""

    def __init__(self, swarm):
        """Look at the bytes that robots receive, and at their wheels after each step of the world."""
        self._swarm = swarm
        count = len(swarm.robots)
        self._zero_s: List[Optional[float]] = [None] * count
        self._travels = []  # pairs: time, of all wheels (m), since the mark
        for index, robot in enumerate(swarm.robots):
            robot.receive_bytes = self._wrap(index, robot.receive_bytes)
        swarm.after_step = self._look_at_wheels

    def _wrap(self, index, receive):
        def receive_bytes(now_ms, data):
            if self._zero_s[index] is None and ZERO in data:
                self._zero_s[index] = time.monotonic()
            receive(now_ms, data)

        return receive_bytes

    def _look_at_wheels(self, _time_ms):
        self._travels.append((time.monotonic(), self._swarm.world.travels_m.copy()))

    def answer(self, command):
        """Do what a line says; return what to print."""
        if command == "mark":
            self._zero_s[:] = [None] * len(self._zero_s)
            self._travels = []
        speeds_m_s = np.abs(self._swarm.world.speeds_m_s).max(axis=1)
        return {
            "zero_s": list(self._zero_s),
            "rest_s": self._find_rests(speeds_m_s),
            "moving": int((speeds_m_s > MOVING_M_S).sum()),
        }

    def _find_rests(self, speeds_m_s):
        travels = list(self._travels)
        rests_s = [None] * len(self._zero_s)
        if travels:
            left_m = np.abs(np.array([travel_m for _, travel_m in travels]) - travels[-1][1]).max(axis=2)
            for index in np.nonzero(speeds_m_s < REST_M_S)[0]:
                late = np.nonzero(left_m[:, index] >= TICK_M)[0]
                rests_s[index] = travels[late[-1] + 1 if len(late) else 0][0]
        return rests_s


def main():
    """Run until a signal comes."""
    with simulate(build_parser().parse_args(), lambda text: None) as (simulator, _):
        watch = Watch(simulator.swarm)

        def serve():
            for line in sys.stdin:
                print(json.dumps(watch.answer(line.strip())), flush=True)

        threading.Thread(target=serve, daemon=True).start()
        simulator.run()


if __name__ == "__main__":
    main()
