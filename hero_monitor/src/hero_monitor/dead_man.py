"""Buttons that are held and let go -> velocities and stops. Pure; time enters as now_s, any clock that never steps.

A robot drives only while a page says again and again that its button is held. Silence stops it: a page that is
hidden, a browser that crashed and a network that is gone say nothing.
"""

from typing import Dict, List, NamedTuple

HOLD_TIMEOUT_S = 0.4
"""Pages speak every 0.1 s while a button is held; after so long without a word the robot is stopped."""

STOPS = 3
"""How often a stop is sent, a step apart: a robot drops what comes within 50 ms of the last command."""


class Velocity(NamedTuple):
    """What one robot is told: m/s ahead, rad/s to the left."""

    namespace: str
    linear_m_s: float
    turn_rad_s: float


class Hold(NamedTuple):
    """A button that is held."""

    page: int
    last_s: float


class DeadMan:
    """All robots that pages drive."""

    def __init__(self) -> None:
        self._holds: Dict[str, Hold] = {}
        self._stops: Dict[str, int] = {}

    def hold(self, page: int, velocity: Velocity, now_s: float) -> bool:
        """A page says that it drives a robot; return False if another page drives it already."""
        held = self._holds.get(velocity.namespace)
        if held is not None and held.page != page:
            return False
        self._holds[velocity.namespace] = Hold(page, now_s)
        self._stops.pop(velocity.namespace, None)
        return True

    def release(self, page: int, namespace: str) -> None:
        """A page says that it lets go of a robot; only the page that holds it can."""
        held = self._holds.get(namespace)
        if held is not None and held.page == page:
            self._begin_stop(namespace)

    def drop_page(self, page: int) -> None:
        """A page is gone: all that it drove stops."""
        for namespace in [name for name, held in self._holds.items() if held.page == page]:
            self._begin_stop(namespace)

    def drop_all(self) -> None:
        """Stop all that is driven."""
        for namespace in list(self._holds):
            self._begin_stop(namespace)

    def _begin_stop(self, namespace: str) -> None:
        del self._holds[namespace]
        self._stops[namespace] = STOPS

    def take_stops(self, now_s: float) -> List[Velocity]:
        """Return the stops that are due at this step; steps are to be 0.06 s apart or more."""
        for namespace in [name for name, held in self._holds.items() if now_s - held.last_s > HOLD_TIMEOUT_S]:
            self._begin_stop(namespace)
        due = [Velocity(namespace, 0.0, 0.0) for namespace in self._stops]
        self._stops = {namespace: left - 1 for namespace, left in self._stops.items() if left > 1}
        return due
