"""Dead man's switch: a robot drives only while a page keeps reporting that a button is held. Pure.

Silence stops it: a hidden page, a browser that crashed and a lost network send nothing. Times enter as now_s,
any clock that never steps.
"""

from typing import Dict, List, NamedTuple, Set

HOLD_TIMEOUT_S = 0.4
"""Pages report every 0.1 s while a button is held; a robot is stopped after this time without a report."""


class DriveCommand(NamedTuple):
    """The velocity of one robot, as in Twist."""

    namespace: str
    linear_m_s: float
    angular_rad_s: float


class Hold(NamedTuple):
    """A button that is held."""

    page: int
    last_s: float


class DeadMan:
    """The robots that pages drive."""

    def __init__(self) -> None:
        self._holds: Dict[str, Hold] = {}
        self._stops: Set[str] = set()

    def hold(self, page: int, velocity: DriveCommand, now_s: float) -> bool:
        """Note that a page drives a robot; return False if another page drives it already."""
        held = self._holds.get(velocity.namespace)
        if held is not None and held.page != page:
            return False
        self._holds[velocity.namespace] = Hold(page, now_s)
        self._stops.discard(velocity.namespace)
        return True

    def release(self, page: int, namespace: str) -> None:
        """Stop a robot, if this page drives it."""
        held = self._holds.get(namespace)
        if held is not None and held.page == page:
            self.stop(namespace)

    def drop_page(self, page: int) -> None:
        """Stop all robots that this page drives."""
        for namespace in [name for name, held in self._holds.items() if held.page == page]:
            self.stop(namespace)

    def drop_all(self) -> None:
        """Stop all robots that are driven."""
        for namespace in list(self._holds):
            self.stop(namespace)

    def stop(self, namespace: str) -> None:
        """Stop a robot, whichever program drives it."""
        self._holds.pop(namespace, None)
        self._stops.add(namespace)

    def take_stops(self, now_s: float) -> List[DriveCommand]:
        """Return the stops that are due at this step, each once: the driver repeats them."""
        for namespace in [name for name, held in self._holds.items() if now_s - held.last_s > HOLD_TIMEOUT_S]:
            self.stop(namespace)
        due, self._stops = self._stops, set()
        return [DriveCommand(namespace, 0.0, 0.0) for namespace in sorted(due)]
