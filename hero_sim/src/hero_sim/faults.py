"""What can go wrong with a robot on request: `KIND[@SECONDS][:key=value,...]`.

Pure. The same text is used on the command line (--fault) and in the ROS service.
"""

import math
from typing import Dict, List, NamedTuple, Optional

from .errors import OptionError

__all__ = ["KINDS", "Fault", "describe_kinds", "parse_fault"]


class Kind(NamedTuple):
    """One sort of fault: what happens, and its keys with their defaults (s, m/s, bytes, ids)."""

    meaning: str
    defaults: Dict[str, float] = {}


KINDS: Dict[str, Kind] = {
    "reboot": Kind("restarts at once; the old connection gets no FIN"),
    "vanish": Kind("power cut: no FIN, no acknowledgement; boots again after for (0: never)", {"for": 0.0}),
    "leave": Kind("closes its connection (FIN) and connects again after for, still streaming", {"for": 3.0}),
    "duplicate": Kind("restarts with the id of another robot (as one whose flash was erased)", {"of": -1.0}),
    "zero-topics": Kind("restarts and answers the first request without declaring anything"),
    "frozen": Kind("its program blocks for so long; connection and servo pulses stay", {"for": 5.0}),
    "stall": Kind("its radio carries nothing for so long, then everything at once", {"for": 2.0}),
    "garbage": Kind("sends random bytes between two packets", {"bytes": 200.0}),
    "half-packet": Kind("sends the first half of a packet, and the next packet right behind it"),
    "bad-checksum": Kind("sends a packet whose payload does not match its checksum"),
    "bad-length": Kind("sends a header whose length does not match its checksum"),
    "long-packet": Kind("sends a valid header that promises 65535 bytes, which never come"),
    "clock-jump": Kind("its clock is wrong by so much until the next time answer", {"by": 60.0}),
    "slow-service": Kind("answers service calls so much later, from now on", {"by": 5.0}),
    "foreign-id": Kind("sends a packet with an id that it did not declare", {"id": 199.0}),
    "push": Kind("is pushed forward by hand at speed; its wheels turn", {"for": 3.0, "speed": 0.1}),
}


class Fault(NamedTuple):
    """One thing that goes wrong."""

    kind: str
    at_s: float  # simulated time; 0 is at once
    robot_id: Optional[int]  # None: every robot
    values: Dict[str, float]


def parse_fault(text: str) -> Fault:
    """Return the fault that text describes, e.g. `vanish@5:robot=1,for=3`.

    Raises: OptionError that names what is wrong and what would do.
    """
    head, _, tail = text.partition(":")
    kind, _, at_text = head.partition("@")
    if kind not in KINDS:
        raise OptionError("fault %r: unknown kind %r; known are %s" % (text, kind, ", ".join(sorted(KINDS))))
    at_s = _read_number(text, "time after @", at_text) if at_text else 0.0
    values = dict(KINDS[kind].defaults)
    robot_id: Optional[int] = None
    for pair in filter(None, tail.split(",")):
        key, equals, value_text = pair.partition("=")
        if not equals or key not in values and key != "robot":
            known = ", ".join(["robot", *sorted(values)])
            raise OptionError("fault %r: %r is not one of %s, as key=value" % (text, pair, known))
        value = _read_number(text, key, value_text)
        if key == "robot":
            robot_id = int(value)
        else:
            values[key] = value
    return Fault(kind, at_s, robot_id, values)


def _read_number(text: str, what: str, number: str) -> float:
    try:
        value = float(number)
    except ValueError as error:
        raise OptionError("fault %r: %s must be a number, not %r" % (text, what, number)) from error
    if not math.isfinite(value) or value < 0 and what != "by":
        raise OptionError("fault %r: %s must be 0 or more, not %s" % (text, what, number))
    return value


def describe_kinds() -> List[str]:
    """Return one line for each kind of fault, with its keys and their defaults."""
    lines = ["KIND[@SECONDS][:robot=ID,key=value,...]; without robot it happens to every robot."]
    for name, kind in sorted(KINDS.items()):
        keys = " ".join("%s=%g" % item for item in sorted(kind.defaults.items()))
        lines.append("  %-13s %s%s" % (name, kind.meaning, " (%s)" % keys if keys else ""))
    return lines
