"""Faults at their simulated time, as things done to robots and their connections."""

import functools
import heapq
from typing import Callable, Dict, List, Tuple

import numpy as np

from hero_driver.rosserial import packets, payloads

from .errors import OptionError
from .faults import KINDS, Fault
from .simulator import Simulator

__all__ = ["FaultInjector"]

_LOG = packets.encode_packet(
    packets.ID_LOG, payloads.encode_log(payloads.Log(payloads.LOG_INFO, "a line that is corrupted on the way"))
)
_LONG = packets.encode_packet(packets.ID_LOG, bytes(packets.LONGEST_PAYLOAD_LENGTH))

_WRONG_BYTES = {
    "half-packet": _LOG[: len(_LOG) // 2],
    "bad-checksum": _LOG[:-1] + bytes((_LOG[-1] ^ 0x55,)),
    "bad-length": _LOG[:4] + bytes((_LOG[4] ^ 0x55,)) + _LOG[5:],
    "long-packet": _LONG[: packets.HEADER_LENGTH],
}

Values = Dict[str, float]


class FaultInjector:
    """Injects faults into one simulator."""

    def __init__(
        self, simulator: Simulator, rng: np.random.RandomState, report: Callable[[str], None]
    ) -> None:
        """Draw garbage from rng; the simulator calls run() between its steps."""
        self._simulator = simulator
        self._rng = rng
        self._report = report
        self._queue: List[Tuple[int, int, Callable[[], None]]] = []
        self._count = 0
        self._actions: Dict[str, Callable[[int, Values], None]] = {
            "reboot": self._reboot,
            "vanish": self._vanish,
            "leave": self._leave,
            "duplicate": self._duplicate,
            "zero-topics": self._declare_nothing,
            "frozen": self._freeze,
            "stall": self._stall,
            "clock-jump": self._jump_clock,
            "slow-service": self._slow_services,
            "push": self._push,
            "garbage": self._send_garbage,
            "foreign-id": self._send_foreign_id,
        }
        for kind, data in _WRONG_BYTES.items():
            self._actions[kind] = functools.partial(self._send, data=data)
        simulator.before_advance.append(self.run)

    def add(self, fault: Fault) -> str:
        """Schedule a fault for its time, or at once if that is past; return what will happen, in words.

        Raises: OptionError if it names a robot that is not here.
        """
        robots = self._simulator.swarm.robots
        indices = [index for index, robot in enumerate(robots) if fault.robot_id in (None, robot.robot_id)]
        if not indices:
            here = ", ".join(str(robot.robot_id) for robot in robots)
            raise OptionError(
                "fault %s: robot %d is not simulated here (%s)" % (fault.kind, fault.robot_id or 0, here)
            )
        at_ms = max(int(fault.at_s * 1000), self._simulator.swarm.now_ms)
        for index in indices:
            self._schedule(at_ms, functools.partial(self._inject, fault, index))
        return "%s: %s" % (", ".join(robots[index].name for index in indices), KINDS[fault.kind].meaning)

    def _schedule(self, at_ms: int, action: Callable[[], None]) -> None:
        self._count += 1  # keeps the order of faults at the same time
        heapq.heappush(self._queue, (at_ms, self._count, action))

    def run(self, now_ms: int) -> None:
        """Inject what is due."""
        while self._queue and self._queue[0][0] <= now_ms:
            heapq.heappop(self._queue)[2]()

    def _inject(self, fault: Fault, index: int) -> None:
        self._report("fault %s for %s" % (fault.kind, self._simulator.swarm.robots[index].name))
        self._actions[fault.kind](index, fault.values)

    # -- power and program ---------------------------------------------------------------------------------

    def _reboot(self, index: int, values: Values) -> None:
        del values
        self._simulator.reboot(index)

    def _vanish(self, index: int, values: Values) -> None:
        self._simulator.switch_off(index)
        if values["for"] > 0:
            back_ms = self._simulator.swarm.now_ms + int(values["for"] * 1000)
            self._schedule(back_ms, lambda: self._simulator.reboot(index))

    def _duplicate(self, index: int, values: Values) -> None:
        of = int(values["of"])
        self._simulator.reboot(index, of if of >= 0 else self._simulator.swarm.robots[0].robot_id)

    def _declare_nothing(self, index: int, values: Values) -> None:
        del values
        self._simulator.reboot(index)
        self._simulator.swarm.robots[index].zero_topics_next = True

    def _freeze(self, index: int, values: Values) -> None:
        swarm = self._simulator.swarm
        swarm.robots[index].freeze(swarm.now_ms, int(values["for"] * 1000))
        swarm.reschedule(index)

    def _jump_clock(self, index: int, values: Values) -> None:
        self._simulator.swarm.robots[index].clock.jump(values["by"])

    def _slow_services(self, index: int, values: Values) -> None:
        self._simulator.swarm.robots[index].answer_delay_ms = int(values["by"] * 1000)

    def _push(self, index: int, values: Values) -> None:
        self._simulator.swarm.robots[index].body.push(values["speed"], int(values["for"] * 1000))

    # -- link ----------------------------------------------------------------------------------------------

    def _leave(self, index: int, values: Values) -> None:
        self._simulator.leave(index, int(values["for"] * 1000))

    def _stall(self, index: int, values: Values) -> None:
        self._simulator.radios[index].stall(self._simulator.swarm.now_ms, int(values["for"] * 1000))

    def _send(self, index: int, values: Values, data: bytes) -> None:
        del values
        self._simulator.swarm.robots[index].send(data)
        self._simulator.serve_robot(index)

    def _send_garbage(self, index: int, values: Values) -> None:
        self._send(index, values, self._rng.bytes(int(values["bytes"])))

    def _send_foreign_id(self, index: int, values: Values) -> None:
        self._send(index, values, packets.encode_packet(int(values["id"]) & 0xFFFF, b"\x01\x02\x03\x04"))
