"""What can go wrong with a robot on request: `KIND[@SECONDS][:key=value,...]` -> Fault.

Pure. The same text is used on the command line (--fault) and in the ROS service.
"""

import math
from typing import Dict, NamedTuple, Optional, Tuple

from .errors import OptionError

REBOOT = "reboot"
VANISH = "vanish"
LEAVE = "leave"
DUPLICATE = "duplicate"
ZERO_TOPICS = "zero-topics"
FROZEN = "frozen"
STALL = "stall"
GARBAGE = "garbage"
HALF_FRAME = "half-frame"
BAD_CHECKSUM = "bad-checksum"
BAD_LENGTH = "bad-length"
LONG_FRAME = "long-frame"
CLOCK_JUMP = "clock-jump"
SLOW_SERVICE = "slow-service"
FOREIGN_FRAMES = "foreign-id"
TUNE_VELOCITY = "tune-velocity"
TUNE_POSITION = "tune-position"
PUSH = "push"

KINDS: Dict[str, Tuple[str, Dict[str, float]]] = {
    REBOOT: ("starts again at once; the old connection gets no FIN", {}),
    VANISH: ("power cut: no FIN, no acknowledgement; comes back by booting after for (0: never)", {"for": 0.0}),
    LEAVE: ("closes its connection (FIN) and dials again after for, still streaming", {"for": 3.0}),
    DUPLICATE: ("starts again with the id of another robot (as one whose flash was erased)", {"of": -1.0}),
    ZERO_TOPICS: ("starts again and answers the first request without declaring anything", {}),
    FROZEN: (
        "its program stands still for so long; the connection stays, the motors keep their pulses",
        {"for": 5.0},
    ),
    STALL: ("its radio carries nothing for so long, then everything at once", {"for": 2.0}),
    GARBAGE: ("sends random bytes between two frames", {"bytes": 200.0}),
    HALF_FRAME: ("sends the first half of a frame, and the next frame right behind it", {}),
    BAD_CHECKSUM: ("sends a frame whose payload does not match its checksum", {}),
    BAD_LENGTH: ("sends a header whose length does not match its checksum", {}),
    LONG_FRAME: ("sends a right header that promises 65535 bytes, which never come", {}),
    CLOCK_JUMP: ("its clock is wrong by so much until the next time answer", {"by": 60.0}),
    SLOW_SERVICE: ("answers service calls so much later, from now on", {"by": 5.0}),
    FOREIGN_FRAMES: ("sends a frame with an id that it did not declare", {"id": 199.0}),
    TUNE_VELOCITY: ("its velocity controller tunes itself, as after a call of pid_calibration", {}),
    TUNE_POSITION: ("its position controller tunes itself", {}),
    PUSH: ("somebody pushes it forward by hand for so long, at speed; its wheels turn", {"for": 3.0, "speed": 0.1}),
}
"""What each fault does, and its keys with their defaults (s, m/s, bytes, ids)."""


class Fault(NamedTuple):
    """One thing that goes wrong."""

    kind: str
    at_s: float  # simulated time; 0 is at once
    robot_id: Optional[int]  # None: every robot
    values: Dict[str, float]


def parse_fault(text: str) -> Fault:
    """Return the fault that text asks for, e.g. `vanish@5:robot=1,for=3`.

    Raises: OptionError that names what is wrong and what would do.
    """
    head, _, tail = text.partition(":")
    kind, _, at_text = head.partition("@")
    if kind not in KINDS:
        raise OptionError("fault %r: unknown kind %r; known are %s" % (text, kind, ", ".join(sorted(KINDS))))
    at_s = _read_number(text, "time after @", at_text) if at_text else 0.0
    values = dict(KINDS[kind][1])
    robot_id: Optional[int] = None
    for pair in filter(None, tail.split(",")):
        key, equals, value_text = pair.partition("=")
        if not equals or key not in values and key != "robot":
            known = ", ".join(["robot"] + sorted(values))
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
