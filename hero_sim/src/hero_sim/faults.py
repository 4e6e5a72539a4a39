"""Faults of a robot on request: `KIND[@SECONDS][:robot=ID,key=value]`.

The same text is used on the command line (--fault) and in the ROS service.
"""

from typing import TYPE_CHECKING, Callable, Dict, List, NamedTuple, Optional, Tuple

from .errors import OptionError
from .key_values import parse_values
from .robot_constants import MAX_ID

if TYPE_CHECKING:
    from .simulator import Simulator

MAX_DURATION_S = 1e9
"""Some thirty years."""

_LIMITS = {
    "robot": (0, MAX_ID),
    "for": (0, MAX_DURATION_S),
    "by": (-MAX_DURATION_S, MAX_DURATION_S),
    "of": (-1, MAX_ID),
    "bytes": (0, 65536),
}
"""Least and most of each key: ids, s, bytes."""


class Kind(NamedTuple):
    """One sort of fault: what happens, what does it to a robot with the value of its key, and the value's default."""

    meaning: str
    act: Callable[["Simulator", int, float], None]
    key: Optional[str] = None
    default: float = 0.0


def _vanish(simulator: "Simulator", index: int, for_s: float) -> None:
    simulator.switch_off(index)
    if for_s > 0:
        simulator.reboot(index, after_ms=int(for_s * 1000))


def _duplicate(simulator: "Simulator", index: int, robot_id: float) -> None:
    simulator.reboot(index, int(robot_id) if robot_id >= 0 else simulator.swarm.robots[0].robot_id)


def _declare_nothing(simulator: "Simulator", index: int, _: float) -> None:
    simulator.reboot(index)
    simulator.swarm.robots[index].zero_topics_next = True


def _freeze(simulator: "Simulator", index: int, for_s: float) -> None:
    simulator.swarm.robots[index].freeze(simulator.swarm.now_ms, int(for_s * 1000))
    simulator.swarm.reschedule(index)


def _stall(simulator: "Simulator", index: int, for_s: float) -> None:
    simulator.radios[index].stall(simulator.swarm.now_ms, int(for_s * 1000))


def _send_garbage(simulator: "Simulator", index: int, length: float) -> None:
    robot = simulator.swarm.robots[index]
    robot.send(b"\xff\xfe" + robot.rng.bytes(int(length)))
    simulator.serve_robot(index)


def _jump_clock(simulator: "Simulator", index: int, by_s: float) -> None:
    simulator.swarm.robots[index].clock.jump(by_s)


def _slow_services(simulator: "Simulator", index: int, by_s: float) -> None:
    simulator.swarm.robots[index].answer_delay_ms = int(by_s * 1000)


KINDS: Dict[str, Kind] = {
    "reboot": Kind("restarts at once; the old connection gets no FIN", lambda run, index, _: run.reboot(index)),
    "vanish": Kind("power cut: no FIN, no acknowledgement; boots again after for (0: never)", _vanish, "for"),
    "leave": Kind(
        "closes its connection (FIN) and connects again after for, still streaming",
        lambda run, index, for_s: run.leave(index, int(for_s * 1000)),
        "for",
        3.0,
    ),
    "duplicate": Kind(
        "restarts with the id of another robot, as one whose flash was erased (-1: of the first robot)",
        _duplicate,
        "of",
        -1.0,
    ),
    "zero-topics": Kind("restarts and answers the first request without declaring anything", _declare_nothing),
    "frozen": Kind("its program blocks for this time; connection and servo pulses stay", _freeze, "for", 5.0),
    "stall": Kind("its radio carries nothing for this time, then everything at once", _stall, "for", 2.0),
    "garbage": Kind("sends the start of a packet and this many random bytes", _send_garbage, "bytes", 200.0),
    "clock-jump": Kind("its clock is wrong by so much until the next time answer", _jump_clock, "by", 60.0),
    "slow-service": Kind("answers service calls so much later, from now on", _slow_services, "by", 5.0),
}


class Fault(NamedTuple):
    """One thing that goes wrong."""

    kind: str
    at_s: float  # simulated time; 0 is at once
    robot_id: Optional[int]  # None: every robot
    value: float  # of the kind's key


def parse_fault(text: str) -> Fault:
    """Return the fault that text describes, e.g. `vanish@5:robot=1,for=3`.

    Raises: OptionError that names what is wrong and what would do.
    """
    name = f"fault {text!r}"
    head, _, tail = text.partition(":")
    kind_name, _, at_s = head.partition("@")
    kind = KINDS.get(kind_name)
    if kind is None:
        raise OptionError(f"{name}: unknown kind {kind_name!r}; known are {', '.join(KINDS)}")
    at = parse_values(name, "SECONDS=" + at_s if at_s else "", {"SECONDS": (0, MAX_DURATION_S)})
    values = parse_values(name, tail, {key: _LIMITS[key] for key in ("robot", kind.key) if key is not None})
    robot_id = int(values["robot"]) if "robot" in values else None
    return Fault(kind_name, at.get("SECONDS", 0.0), robot_id, values.get(kind.key or "", kind.default))


class FaultInjector:
    """Injects faults into one simulator, each at its time."""

    def __init__(self, simulator: "Simulator", report: Callable[[str], None]) -> None:
        """The simulator calls run() between its steps; report takes lines for users."""
        self._simulator = simulator
        self._report = report
        self._waiting: List[Tuple[int, int, Fault]] = []  # time (ms) and robot of each, the next one first
        simulator.before_advance.append(self.run)

    def add(self, fault: Fault) -> str:
        """Schedule a fault for its time, or at once if that is past; return what will happen, in words.

        Raises: OptionError if it names a robot that is not here.
        """
        robots = self._simulator.swarm.robots
        indices = [index for index, robot in enumerate(robots) if fault.robot_id in (None, robot.robot_id)]
        if not indices:
            here = ", ".join(str(robot.robot_id) for robot in robots)
            raise OptionError(f"fault {fault.kind}: robot {fault.robot_id} is not simulated here ({here})")
        self._waiting += [(int(fault.at_s * 1000), index, fault) for index in indices]
        self._waiting.sort(key=lambda waiting: waiting[0])
        return f"{', '.join(robots[index].name for index in indices)}: {KINDS[fault.kind].meaning}"

    def run(self, now_ms: int) -> None:
        """Inject what is due."""
        while self._waiting and self._waiting[0][0] <= now_ms:
            _, index, fault = self._waiting.pop(0)
            self._report(f"fault {fault.kind} for {self._simulator.swarm.robots[index].name}")
            KINDS[fault.kind].act(self._simulator, index, fault.value)
