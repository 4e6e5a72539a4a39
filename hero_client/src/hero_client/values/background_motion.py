"""Motions as steps: one description for motions that are waited for, and for those in the background. Pure."""

from abc import abstractmethod
from concurrent.futures import Future
from typing import Callable, Generator

SEND_TIME_S = 0.1
"""rospy sends on threads of its own and does not say when it has; this is many times what a send takes."""

Sleep = Callable[[float], bool]
"""Waits for this many seconds and returns whether to continue; Clock.sleep is one."""

Steps = Generator[float, bool, None]
"""Does a step, yields the seconds until the next one, and is sent whether to continue."""


class FullWait(float):
    """A wait between steps that nothing cuts short, such as that for a stop to be sent."""


def run_steps(steps: Steps, sleep: Sleep, sleep_fully: Sleep) -> None:
    """Take all steps. What a wait raises, such as Ctrl-C, is raised in the steps, which then stop their robots.

    sleep_fully: waits where sleep, which may be cut short, is not allowed to.
    """
    try:
        wait_s = next(steps)
        while True:
            try:
                is_to_continue = (sleep_fully if isinstance(wait_s, FullWait) else sleep)(wait_s)
            except BaseException as error:  # noqa: BLE001 - the steps raise it again
                wait_s = steps.throw(error)
            else:
                wait_s = steps.send(is_to_continue)
    except StopIteration:
        return


class BackgroundMotion(Future):
    """A motion that was started; as a concurrent.futures.Future, but cancel() also ends one that is on its way."""

    @abstractmethod
    def cancel(self) -> bool:
        """Stop the robot; result() then raises GoalError. Returns False if the motion had ended already."""

    @abstractmethod
    def cancel_and_wait(self) -> None:
        """Cancel, and return when the robot's stops are sent."""
