"""Dead man's switch: a robot drives only while a page keeps reporting that a button is held. Pure.

Silence stops it: a hidden page, a browser that crashed and a lost network send nothing. A stop or release ends every
hold: those that began before count no more, whatever their page sends. Times enter as now_s, any clock that never
steps, and of presses and stops as ms on the pages' clock.
"""

from typing import Dict, List, NamedTuple, Optional, Set

HOLD_TIMEOUT_S = 0.4
"""Pages report every 0.1 s while a button is held; a robot is stopped after this time without a report."""


class Hold(NamedTuple):
    """A button that is held."""

    page: int
    last_s: float


class DeadMan:
    """The robots that pages drive."""

    def __init__(self) -> None:
        self._holds: Dict[str, Hold] = {}
        self._stops: Set[str] = set()
        self._ended_ms: Dict[str, int] = {}
        self._all_ended_ms = -1

    def is_over(self, robot: str, pressed_ms: float) -> bool:
        """Return whether a stop or release has ended the hold that began with a press."""
        return pressed_ms <= max(self._all_ended_ms, self._ended_ms.get(robot, -1))

    def end_hold(self, robot: str, now_ms: int) -> Optional[int]:
        """Stop a robot until a new press, whichever program drives it; return the page that drove it, if any."""
        held = self._holds.get(robot)
        self._ended_ms[robot] = now_ms
        self.stop(robot)
        return None if held is None else held.page

    def end_all_holds(self, now_ms: int) -> None:
        """Stop all robots that are driven, until a new press."""
        self._all_ended_ms = now_ms
        self.drop_all()

    def hold(self, page: int, robot: str, now_s: float) -> bool:
        """Note that a page drives a robot; return False if another page drives it already."""
        held = self._holds.get(robot)
        if held is not None and held.page != page:
            return False
        self._holds[robot] = Hold(page, now_s)
        self._stops.discard(robot)
        return True

    def release(self, page: int, robot: str) -> None:
        """Stop a robot, if this page drives it."""
        held = self._holds.get(robot)
        if held is not None and held.page == page:
            self.stop(robot)

    def drop_page(self, page: int) -> None:
        """Stop all robots that this page drives."""
        for robot in [name for name, held in self._holds.items() if held.page == page]:
            self.stop(robot)

    def drop_all(self) -> None:
        """Stop all robots that are driven."""
        for robot in list(self._holds):
            self.stop(robot)

    def stop(self, robot: str) -> None:
        """Stop a robot, whichever program drives it."""
        self._holds.pop(robot, None)
        self._stops.add(robot)

    def take_stops(self, now_s: float) -> List[str]:
        """Return the robots that are to be stopped at this step, each once: the driver repeats stops."""
        for robot in [name for name, held in self._holds.items() if now_s - held.last_s > HOLD_TIMEOUT_S]:
            self.stop(robot)
        due, self._stops = self._stops, set()
        return sorted(due)
