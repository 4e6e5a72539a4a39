"""Losses that pages report, with cause and remedy: driver, ROS master, localization, camera. Pure.

A source that was never heard is not lost: without a camera none is missed. Times enter as now_s, any clock that never
steps.
"""

from typing import Dict, List, NamedTuple

SILENT_S = 1.8
"""The driver reports once a second, localization 25 times: what is silent for longer is shown as lost within 2 s."""

FORGOTTEN_S = 10.0
"""Silence of localization: then robots are placed by odometry, as without it, and the page says so."""

MASTER_PERIOD_S = 1.0
"""Time between two questions to the ROS master."""

NO_DRIVER = "roslaunch hero_bringup hero_bringup.launch"


class Loss(NamedTuple):
    """Something unknown, in words for users."""

    source: str  # driver, master, localization, camera
    cause: str
    remedy: str


class LocalizationWatch:
    """Checks whether localization reports, and whether it sees any robot."""

    def __init__(self) -> None:
        self._heard_s = 0.0
        self._is_known = self._had_tracked = self._has_tracked = False

    def receive(self, tracked: int, now_s: float) -> None:
        """Take a report with this many robots that a camera measures."""
        self._heard_s, self._is_known = now_s, True
        self._has_tracked = tracked > 0
        self._had_tracked = self._had_tracked or self._has_tracked

    def pause(self, now_s: float) -> None:
        """Begin to listen again: what was not listened to was not silent."""
        self._heard_s = now_s

    def is_expected(self, now_s: float) -> bool:
        """Return whether it reports, or has not been silent for FORGOTTEN_S."""
        return self._is_known and now_s - self._heard_s <= FORGOTTEN_S

    def is_lost(self, now_s: float) -> bool:
        """Return whether it has fallen silent, but is expected."""
        return self.is_expected(now_s) and now_s - self._heard_s > SILENT_S

    def has_lost_camera(self, now_s: float) -> bool:
        """Return whether it reports, but measures none of the robots that it measured before."""
        return self._had_tracked and not self._has_tracked and now_s - self._heard_s <= SILENT_S


def list_losses(
    drivers: Dict[str, bool], is_master_lost: bool, localization: LocalizationWatch, now_s: float
) -> List[Loss]:
    """Return what is lost, worst first.

    drivers: by name, whether they answer; empty if none was ever heard. is_master_lost: whether the ROS
    master is.
    """
    losses = []
    silent = sorted(name.strip("/") for name, answers in drivers.items() if not answers)
    if silent:
        whose = "its" if len(silent) == 1 else "their"
        cause = f"No answer from {', '.join(silent)}: {whose} robots are unknown"
        remedy = "Switch off robots that move; start the driver again: " + NO_DRIVER
        losses.append(Loss("driver", cause, remedy))
    elif not drivers:
        losses.append(Loss("driver", "No driver", "Start it: " + NO_DRIVER))
    if is_master_lost:
        cause = "No ROS master answers: robots and programs that start now do not appear"
        remedy = "Existing connections keep working, and STOP ALL works; start it again: " + NO_DRIVER
        losses.append(Loss("master", cause, remedy))
    if localization.is_lost(now_s):
        cause = "Localization is silent: positions are unknown"
        remedy = "Look at its terminal, or start it again: roslaunch hero_localization localization.launch"
        losses.append(Loss("localization", cause, remedy))
    elif localization.has_lost_camera(now_s):
        cause = "The camera measures no robot: positions follow odometry, which drifts"
        remedy = "Is it plugged in, uncovered and lit? Does track run? roslaunch hero_localization camera.launch"
        losses.append(Loss("camera", cause, remedy))
    return losses
