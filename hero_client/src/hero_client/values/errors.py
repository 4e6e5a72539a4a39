"""Everything that goes wrong in a program that uses robots. The text is one line: what, why, and what to do. Pure."""

__all__ = [
    "FrameError",
    "GoalError",
    "HeroError",
    "NodeError",
    "ProgramError",
    "RobotError",
    "RobotNotReadyError",
    "StaleDataError",
    "StoppedError",
]


class HeroError(Exception):
    """The base of all errors of this package. A program that does not catch it prints its text and ends with 1."""


class ProgramError(HeroError):
    """The program cannot work as it was started, for example because of a wrong parameter."""


class NodeError(ProgramError):
    """The program's ROS node cannot start, or the ROS master does not answer."""


class FrameError(HeroError):
    """No pose of a robot in a frame: it was never measured, or tf has no transform; the text names both."""


class RobotError(HeroError):
    """A robot cannot do what it was told."""


class RobotNotReadyError(RobotError):
    """The robot does not take commands or sends no data; the text says which."""


class StaleDataError(RobotError):
    """The newest message is missing or too old to act upon."""


class StoppedError(RobotError):
    """The robot does not move because all robots are stopped (emergency stop); the text says how to release them."""


class GoalError(RobotError):
    """A motion ended before its goal: an obstacle, blocked wheels, no pose, the time limit, or cancelled."""
