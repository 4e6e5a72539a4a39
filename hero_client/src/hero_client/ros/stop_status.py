"""A request to stop all robots, or to release them: which drivers to ask again, and the status that users see.

Pure: knows neither topics nor a clock; times are monotonic.
"""

from typing import List, Mapping, NamedTuple, Optional, Sequence, Set

from hero_msgs.msg import Robot, RobotArray
from hero_node import list_names

TIME_LIMIT_S = 1.4
"""Then users are shown which robots did not stop, on any screen within 1.5 s. A driver reports once per second, and
each change within 0.1 s."""

CROSSING_S = 0.15
"""A report may cross the request; after this time a newer one has arrived."""

NAMES_SHOWN = 20

COLORS = {"info": "", "warn": "\x1b[33m", "error": "\x1b[1;31m"}
"""Colors of terminals (ECMA-48): as usual, yellow, bold red."""

END_COLOR = "\x1b[0m"


class StopStatus(NamedTuple):
    """Status of a request, for users."""

    level: str
    """info, warn or error."""
    text: str
    is_final: bool
    """True if the outcome is known; until then the request is repeated."""


Replies = Mapping[str, Optional[RobotArray]]
"""The newest report of each driver by its name; None while there is none since the request, or none any more."""


class StopRequest:
    """One request to all drivers, and which of them have taken it."""

    def __init__(self, stopped: bool, made_s: float) -> None:
        """stopped: whether to stop or to release; made_s: when, by the clock of update()'s now_s."""
        self.stopped = stopped
        self.made_s = made_s
        self.is_over = False
        self._taken: Set[str] = set()
        self._asked: Set[str] = set()

    def update(self, replies: Replies, all_found: bool, now_s: float) -> None:
        """Take the replies of the drivers that are known.

        The request is over once all have taken it: a driver that starts later is not asked. A release is asked for
        no longer than TIME_LIMIT_S, because a driver that hung must not let its robots go by surprise.
        all_found: whether these drivers are all that the ROS master knows.
        """
        if now_s - self.made_s < CROSSING_S:
            return
        self._taken.update(driver for driver, report in replies.items() if report and report.stopped == self.stopped)
        all_taken = all_found and self._taken.issuperset(replies)
        self.is_over = self.is_over or all_taken or (not self.stopped and self._is_late(now_s))

    def is_open_to(self, driver: str) -> bool:
        """Return whether a driver is to be asked, for the first time or again.

        For a release it is asked once: a repetition could undo the stop of another program that came in between.
        """
        if self.is_over or driver in self._taken:
            return False
        return self.stopped or driver not in self._asked

    def note_asked(self, driver: str) -> None:
        """A driver was asked, over an established connection."""
        self._asked.add(driver)

    def _is_late(self, now_s: float) -> bool:
        return now_s - self.made_s >= TIME_LIMIT_S

    def describe(self, replies: Replies, robots: Sequence[Robot], now_s: float) -> StopStatus:
        """Return the status now; robots: those of all replies, each once."""
        if now_s - self.made_s < CROSSING_S:
            return StopStatus("warn", "stopping" if self.stopped else "releasing", False)
        # A driver that falls silent later has released its robots, but what stopped ones do is then unknown.
        silent = [
            driver for driver, report in replies.items() if not report and (self.stopped or driver not in self._taken)
        ]
        failures = [f"driver {_show(driver)} does not answer" for driver in silent]
        refusing: List[str] = []
        changed: List[str] = []
        for driver, report in replies.items():
            if report and report.stopped != self.stopped:
                (changed if driver in self._taken else refusing).append(_show(driver))
        if changed:
            how = "released" if self.stopped else "stopped"
            return StopStatus("warn", f"another program has {how} the robots of {', '.join(changed)}", True)
        if not self.stopped:
            return self._describe_release(failures, refusing, now_s)
        return self._describe_stop(failures, refusing, robots, now_s)

    def _describe_release(self, failures: List[str], refusing: List[str], now_s: float) -> StopStatus:
        failures = failures + [f"driver {name} is still stopped" for name in refusing]
        if not failures:
            return StopStatus("info", "released: robots may move again", True)
        if not self._is_late(now_s):
            return StopStatus("warn", "releasing", False)
        return StopStatus("error", "NOT RELEASED: " + "; ".join(failures), True)

    def _describe_stop(
        self, failures: List[str], refusing: List[str], robots: Sequence[Robot], now_s: float
    ) -> StopStatus:
        connected = [robot for robot in robots if robot.state not in (Robot.AWAY, Robot.REFUSED)]
        moving = [robot for robot in connected if robot.stop_state == Robot.MOVING]
        unread = [robot for robot in connected if robot.stop_state == Robot.UNCONFIRMED]
        stopping = [robot for robot in connected if robot.stop_state in (Robot.NOT_STOPPED, Robot.STOPPING)]
        away = [robot for robot in robots if robot.state == Robot.AWAY]
        failures = [
            *_tell(moving, "moves", "move"),
            *failures,
            *(f"driver {name} is not stopped" for name in refusing),
            *_tell(stopping, "is not at rest yet", "are not at rest yet"),
        ]
        notes = [
            *_tell(unread, "sends no wheel readings", "send no wheel readings"),
            *_tell(away, "is away", "are away"),
        ]
        if failures:
            if not self._is_late(now_s):
                return StopStatus("warn", "stopping", False)
            return StopStatus("error", "NOT STOPPED: " + "; ".join(failures + notes), False)
        if notes:
            return StopStatus("warn", "stopped, but " + "; ".join(notes), True)
        text = "stopped, all wheels at rest" if connected else "stopped, no robot is connected"
        return StopStatus("info", text, True)


def _show(driver: str) -> str:
    return driver.strip("/")


def _tell(robots: Sequence[Robot], one: str, many: str) -> List[str]:
    """Return what is to be said of robots, with their names; nothing if there are none."""
    if not robots:
        return []
    names = [robot.namespace.strip("/") or robot.address for robot in robots]
    return [f"{list_names(names, NAMES_SHOWN)} {one if len(names) == 1 else many}"]


def paint(level: str, text: str) -> str:
    """Return a line for a terminal in the color of its level."""
    return COLORS[level] + text + (END_COLOR if COLORS[level] else "")
