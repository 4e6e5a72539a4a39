"""Faults -> things done to robots and their connections, at their simulated time."""

import heapq
from typing import Callable, List, Tuple

import numpy as np

from hero_driver.rosserial import packets, payloads

from . import faults
from .errors import OptionError
from .faults import Fault
from .simulator import Simulator

_SPOILED_LOG = packets.encode_packet(
    packets.ID_LOG, payloads.encode_log(payloads.Log(payloads.LOG_INFO, "a line that is spoiled on its way"))
)


class FaultInjector:
    """Spoils robots of one simulator."""

    def __init__(
        self, simulator: Simulator, rng: np.random.RandomState, report: Callable[[str], None]
    ) -> None:
        """Draw garbage from rng; the simulator calls back between its steps."""
        self._simulator = simulator
        self._rng = rng
        self._report = report
        self._queue: List[Tuple[int, int, Callable[[], None]]] = []
        self._count = 0
        simulator.before_advance = self.run

    def add(self, fault: Fault) -> str:
        """Take a fault for its time, or for at once if that is past; return what will happen, in words.

        Raises: OptionError if it names a robot that is not here.
        """
        indices = self._find_robots(fault)
        at_ms = max(int(fault.at_s * 1000), self._simulator.swarm.now_ms)
        for index in indices:
            self._schedule(at_ms, self._bind(fault, index))
        names = ", ".join(self._simulator.swarm.robots[index].name for index in indices)
        return "%s: %s" % (names, faults.KINDS[fault.kind][0])

    def _find_robots(self, fault: Fault) -> List[int]:
        robots = self._simulator.swarm.robots
        if fault.robot_id is None:
            return list(range(len(robots)))
        found = [index for index, robot in enumerate(robots) if robot.robot_id == fault.robot_id]
        if not found:
            here = ", ".join(str(robot.robot_id) for robot in robots)
            raise OptionError(
                "fault %s: robot %d is not simulated here (%s)" % (fault.kind, fault.robot_id, here)
            )
        return found

    def _schedule(self, at_ms: int, action: Callable[[], None]) -> None:
        self._count += 1  # keeps the order of faults at the same time
        heapq.heappush(self._queue, (at_ms, self._count, action))

    def run(self, now_ms: int) -> None:
        """Do what is due."""
        while self._queue and self._queue[0][0] <= now_ms:
            heapq.heappop(self._queue)[2]()

    def _bind(self, fault: Fault, index: int) -> Callable[[], None]:
        def act() -> None:
            self._report("fault %s for %s" % (fault.kind, self._simulator.swarm.robots[index].name))
            self._apply(fault, index)

        return act

    def _apply(self, fault: Fault, index: int) -> None:
        simulator = self._simulator
        robot = simulator.swarm.robots[index]
        now_ms = simulator.swarm.now_ms
        if fault.kind == faults.REBOOT:
            simulator.reboot(index)
        elif fault.kind == faults.ZERO_TOPICS:
            simulator.reboot(index)
            robot.zero_topics_next = True
        elif fault.kind == faults.DUPLICATE:
            other = int(fault.values["of"])
            simulator.reboot(index, other if other >= 0 else simulator.swarm.robots[0].robot_id)
        elif fault.kind == faults.VANISH:
            simulator.switch_off(index)
            if fault.values["for"] > 0:
                self._schedule(now_ms + int(fault.values["for"] * 1000), lambda: simulator.reboot(index))
        elif fault.kind == faults.LEAVE:
            simulator.leave(index, int(fault.values["for"] * 1000))
        elif fault.kind == faults.FROZEN:
            robot.freeze(now_ms, int(fault.values["for"] * 1000))
            simulator.swarm.reschedule(index)
        elif fault.kind == faults.STALL:
            simulator.radios[index].stall(now_ms, int(fault.values["for"] * 1000))
        elif fault.kind == faults.CLOCK_JUMP:
            robot.clock.jump(fault.values["by"])
        elif fault.kind == faults.SLOW_SERVICE:
            robot.answer_delay_ms = int(fault.values["by"] * 1000)
        elif fault.kind in (faults.TUNE_VELOCITY, faults.TUNE_POSITION):
            robot.start_tuning(now_ms, of_velocity=fault.kind == faults.TUNE_VELOCITY)
            simulator.serve_robot(index)
        elif fault.kind == faults.PUSH:
            robot.body.push(fault.values["speed"], int(fault.values["for"] * 1000))
        else:
            robot.send(self._spoil(fault))
            simulator.serve_robot(index)

    def _spoil(self, fault: Fault) -> bytes:
        """Return the wrong bytes of one fault."""
        if fault.kind == faults.GARBAGE:
            return bytes(self._rng.randint(0, 256, int(fault.values["bytes"])).astype(np.uint8))
        if fault.kind == faults.HALF_FRAME:
            return _SPOILED_LOG[: len(_SPOILED_LOG) // 2]
        if fault.kind == faults.BAD_CHECKSUM:
            return _SPOILED_LOG[:-1] + bytes((_SPOILED_LOG[-1] ^ 0x55,))
        if fault.kind == faults.BAD_LENGTH:
            return _SPOILED_LOG[:4] + bytes((_SPOILED_LOG[4] ^ 0x55,)) + _SPOILED_LOG[5:]
        if fault.kind == faults.LONG_FRAME:
            return packets.encode_packet(packets.ID_LOG, bytes(packets.LONGEST_PAYLOAD_LENGTH))[
                : packets.HEADER_LENGTH
            ]
        return packets.encode_packet(int(fault.values["id"]) & 0xFFFF, b"\x01\x02\x03\x04")
