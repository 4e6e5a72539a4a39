"""Commands to several robots at once, of which one robot is a special case."""

import time
from typing import Optional, Protocol, Sequence

import rospy

from .background_motion import BackgroundMotion, Sleep
from .errors import RobotNotReadyError
from .light import Light
from .script import sleep_unless_shutdown

__all__ = [
    "POLL_PERIOD_S",
    "READY_TIMEOUT_S",
    "REPEAT_PERIOD_S",
    "Member",
    "drive_all",
    "leave_all",
    "send_stops",
    "stop_all",
    "wait_for_all",
]

STOP_GAP_S = 0.06
"""Between the two messages of a stop: the firmware drops a Twist that comes within 50 ms of the one before."""

SEND_TIME_S = 0.05
"""rospy sends on threads of its own and does not say when it has; this is many times what a send takes."""

REPEAT_PERIOD_S = 0.1
"""Between the commands of a motion: well within the robot's watchdog of about 2 s."""

READY_TIMEOUT_S = 2.0
"""How long a motion waits for a robot that is not ready; it takes about 0.1 s after the start of a program."""

POLL_PERIOD_S = 0.02
"""Between two checks whether a robot is ready."""

NAMES_SHOWN = 10


class Member(Protocol):
    """What is used here of a Robot."""

    name: str
    driven: bool
    _light: Light
    _motion: Optional[BackgroundMotion]

    def missing(self) -> Optional[str]:
        """See Robot."""

    def check_not_stopped(self) -> None:
        """See Robot."""

    def _end_motion(self) -> None: ...

    def _send_twist(self, linear_m_s: float, angular_rad_s: float) -> None: ...


def wait_for_all(robots: Sequence[Member], timeout_s: float, sleep: Sleep = sleep_unless_shutdown) -> None:
    """Wait until all robots are ready. Raises: RobotNotReadyError after timeout_s, saying what is missing."""
    deadline_s = time.monotonic() + timeout_s
    late = list(robots)
    while True:
        late = [robot for robot in late if robot.missing() is not None]
        if not late:
            return
        if time.monotonic() >= deadline_s or not sleep(POLL_PERIOD_S):
            names = ", ".join(robot.name for robot in late[:NAMES_SHOWN]) + ("..." if len(late) > NAMES_SHOWN else "")
            verb = "is" if len(late) == 1 else "are"
            raise RobotNotReadyError("%s %s not ready after %.3g s: %s" % (names, verb, timeout_s, late[0].missing()))


def drive_all(robots: Sequence[Member], linear_m_s: float, angular_rad_s: float, duration_s: float) -> None:
    """Drive all robots with the same velocities for duration_s, then stop them; see Robot.drive()."""
    for robot in robots:
        robot._end_motion()
    wait_for_all(robots, READY_TIMEOUT_S)
    end_s = time.monotonic() + duration_s
    try:
        while not rospy.is_shutdown():
            remaining_s = end_s - time.monotonic()
            if remaining_s <= 0.0:
                break
            for robot in robots:
                robot.check_not_stopped()
                robot._send_twist(linear_m_s, angular_rad_s)
            time.sleep(min(REPEAT_PERIOD_S, remaining_s))
    finally:
        send_stops(robots)


def stop_all(robots: Sequence[Member]) -> None:
    """Cancel motions in the background and send every robot two stops; returns when they are sent."""
    for robot in robots:
        if robot._motion is not None:
            robot._motion.cancel()
    send_stops(robots)


def leave_all(robots: Sequence[Member]) -> None:
    """Stop the robots that were driven from here, and end blinking; for the end of a program."""
    for robot in robots:
        robot._light.close()
    stop_all([robot for robot in robots if robot.driven])
    time.sleep(SEND_TIME_S)  # for a color that was asked for last


def send_stops(robots: Sequence[Member]) -> None:
    """As stop_all(), but leave motions in the background, one of which may be the caller."""
    if not robots:
        return
    for robot in robots:
        robot._send_twist(0.0, 0.0)
    # The first stop may itself come within 50 ms of the last command, and then only the second one counts.
    time.sleep(STOP_GAP_S)
    for robot in robots:
        robot._send_twist(0.0, 0.0)
    time.sleep(SEND_TIME_S)
