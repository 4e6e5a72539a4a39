"""Common base of robot and swarm: a robot is a group of one. Pure."""

import math
from contextlib import suppress
from numbers import Real
from operator import index
from typing import Iterator, Optional, Protocol, Sequence, SupportsIndex, TypeVar

from hero_node import Clock, list_names

from ..values.background_motion import SEND_TIME_S, BackgroundMotion, FullWait, Sleep, Steps, run_steps
from ..values.errors import RobotNotReadyError

REPEAT_PERIOD_S = 0.1
"""Time between the commands of a motion: well within the robot's watchdog of about 2 s."""

READY_TIMEOUT_S = 2.0
"""Time that a motion waits for a robot that is not ready; it takes about 0.1 s after the start of a program."""

POLL_PERIOD_S = 0.02
"""Time between two checks whether a robot is ready."""

ROUNDING_S = 1e-6
"""Sums of seconds are this exact."""

Self = TypeVar("Self", bound="Group")


def check_robot_id(robot_id: SupportsIndex) -> int:
    """Return the number, also one of numpy, as int. Raises: ValueError for one that no robot can have."""
    with suppress(TypeError):
        number = index(robot_id)
        if number >= 0 and not isinstance(robot_id, bool):
            return number
    raise ValueError(f"a robot is named by its number, 0 or more, not by {robot_id!r}")


class Member(Protocol):
    """Interface of a robot, as this module uses it: see BaseRobot."""

    name: str
    driven: bool
    _motion: Optional[BackgroundMotion]

    def missing(self) -> Optional[str]:
        """Return why the robot cannot be driven now; None if it can."""

    def check_not_stopped(self) -> None:
        """Raises: StoppedError if all robots are stopped."""

    def _end_motion(self) -> None: ...
    def _end_light(self) -> None: ...
    def _send_velocity(self, linear_m_s: float, angular_rad_s: float) -> None: ...


def wait_for_all(robots: Sequence[Member], timeout_s: float = READY_TIMEOUT_S) -> Steps:
    """Wait until all robots are ready. Raises: RobotNotReadyError after timeout_s, saying what is missing."""
    # Polls, not a clock: a program that was kept from running has not heard its robots either.
    polls = math.ceil(timeout_s / POLL_PERIOD_S)
    late = list(robots)
    is_to_continue = True
    while True:
        late = [robot for robot in late if robot.missing() is not None]
        if not late:
            return
        if polls <= 0 or not is_to_continue:
            names = list_names([robot.name for robot in late])
            verb = "is" if len(late) == 1 else "are"
            raise RobotNotReadyError(f"{names} {verb} not ready after {timeout_s:.3g} s: {late[0].missing()}")
        polls -= 1
        is_to_continue = yield POLL_PERIOD_S


def send_stops(robots: Sequence[Member]) -> Steps:
    """Send every robot one stop, which the driver repeats; ends when they, and what was published before, are sent.

    A stop that a program fails to send is the driver's: it stops robots whose program hangs or has ended.
    """
    for robot in robots:
        robot._send_velocity(0.0, 0.0)
    yield FullWait(SEND_TIME_S)


def stop_after(steps: Steps, robots: Sequence[Member]) -> Steps:
    """Take steps and then stop the robots, however the steps end."""
    try:
        yield from steps
    except GeneratorExit:
        raise  # no steps are taken any more: the program has dropped its stepped robots
    except BaseException:
        yield from send_stops(robots)
        raise
    yield from send_stops(robots)


def carry_out(steps: Steps, robots: Sequence[Member]) -> Steps:
    """Take steps as soon as the robots are ready, and then stop the robots."""
    yield from wait_for_all(robots)
    yield from stop_after(steps, robots)


class Group:
    """Robots that are waited for, driven and stopped together; as a context manager it stops them at the end."""

    _clock: Clock
    _members: Sequence[Member]

    @property
    def now_s(self) -> float:
        """The robots' time: of simulated robots that are stepped, else of this machine."""
        return self._clock.now_s

    def sleep(self, duration_s: float) -> bool:
        """Wait for duration_s of the robots' time; return whether the program is to continue."""
        return self._clock.sleep(duration_s)

    def rate(self, hz: float) -> Iterator[float]:
        """Repeat the body of a `for` loop hz times per second of the robots' time: see Clock.rate()."""
        return self._clock.rate(hz)

    def _run(self, steps: Steps, sleep: Optional[Sleep] = None) -> None:
        run_steps(steps, sleep or self._clock.sleep, self._clock.sleep)

    def wait_until_ready(self: Self, timeout_s: float = 10.0, sleep: Optional[Sleep] = None) -> Self:
        """Wait until every robot takes commands and sends what was subscribed to; return this object itself.

        sleep: waits this many seconds and returns whether to continue, such as Program.sleep.

        Raises: RobotNotReadyError after timeout_s, with the robots that are not and what is missing.
        """
        self._run(wait_for_all(self._members, timeout_s), sleep)
        return self

    def _drive_for(self, linear_m_s: float, angular_rad_s: float, duration_s: float) -> None:
        if not (isinstance(duration_s, Real) and duration_s >= 0.0):
            raise ValueError(f"a duration must be 0 s or more, not {duration_s!r}")
        for robot in self._members:
            robot._end_motion()
        self._run(carry_out(self._drive_steps(linear_m_s, angular_rad_s, duration_s), self._members))

    def _drive_steps(self, linear_m_s: float, angular_rad_s: float, duration_s: float) -> Steps:
        end_s = self.now_s + duration_s
        is_to_continue = True
        while is_to_continue and end_s - self.now_s > ROUNDING_S:
            for robot in self._members:
                robot.check_not_stopped()
                robot._send_velocity(linear_m_s, angular_rad_s)
            is_to_continue = yield min(REPEAT_PERIOD_S, end_s - self.now_s)

    def stop(self) -> None:
        """Stop at once and cancel motions from start_go_to(); returns once the stops are sent, after 0.1 s."""
        self._stop(self._members)

    def _stop(self, robots: Sequence[Member]) -> None:
        for robot in robots:
            if robot._motion is not None:
                robot._motion.cancel()
        self._run(send_stops(robots))

    def _leave(self) -> None:
        """Stop the robots that were driven from here, and end what their lights do; for the end of a program."""
        for robot in self._members:
            robot._end_light()
        self._stop([robot for robot in self._members if robot.driven])

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        # Topics are left to the end of the program: leaving them one by one takes 20 ms each.
        self._leave()
