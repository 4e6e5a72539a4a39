"""Errors of robots. The text is one line: what, why, and what to do. Pure."""

from hero_node import HeroError


class FrameError(HeroError):
    """No pose of a robot in a frame: it was never measured, or tf has no transform; the text names both."""


class RobotError(HeroError):
    """A robot cannot carry out a command."""


class RobotNotReadyError(RobotError):
    """The robot does not take commands or sends no data; the text says which."""


class StaleDataError(RobotError):
    """The newest message is missing or too old to act upon."""


class NotCalibratedError(StaleDataError):
    """Infrared sensors of a robot are not calibrated, so that it is not known what is near it."""


class StoppedError(RobotError):
    """The robot does not move because all robots are stopped (emergency stop); the text says how to release them."""


class GoalError(RobotError):
    """A motion ended before its goal: an obstacle, blocked wheels, no pose, the time limit, or cancelled."""
