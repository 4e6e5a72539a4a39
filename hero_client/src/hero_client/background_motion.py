"""A motion of a robot on a thread of its own, which can be waited for and cancelled. Knows no robot."""

import threading
from concurrent.futures import Future, wait
from typing import Callable

import rospy

from .errors import HeroError

__all__ = ["BackgroundMotion", "Sleep"]

Sleep = Callable[[float], bool]
"""Waits for so many seconds and returns whether to continue; `Program.sleep` is one."""

END_TIMEOUT_S = 3.0
"""A cancelled motion ends within 0.3 s; one that hangs must not hang its robot's next motion."""


class BackgroundMotion(Future):  # type: ignore[type-arg]
    """A motion that was started; as a concurrent.futures.Future, but cancel() also ends one that is on its way."""

    def __init__(self, drive: Callable[[Sleep], None]) -> None:
        """Start drive on another thread; it ends soon after the function that it is given returned False."""
        super().__init__()
        self._cancelled = threading.Event()
        self.set_running_or_notify_cancel()
        threading.Thread(target=self._run, args=(drive,), name="motion", daemon=True).start()

    def _run(self, drive: Callable[[Sleep], None]) -> None:
        try:
            drive(self._sleep)
        except (HeroError, ValueError, TypeError, rospy.ROSException) as error:
            self.set_exception(error)
        else:
            self.set_result(None)

    def _sleep(self, duration_s: float) -> bool:
        return not self._cancelled.wait(duration_s) and not rospy.is_shutdown()

    def cancel(self) -> bool:
        """Let the robot stop; result() then raises GoalError. Returns False if the motion had ended already."""
        self._cancelled.set()
        return not self.done()

    def cancel_and_wait(self) -> None:
        """Cancel, and return when the robot's stops are sent."""
        self.cancel()
        wait([self], END_TIMEOUT_S)
