"""Errors of nodes and programs. The text is one line: what, why, and what to do. Pure."""


class HeroError(Exception):
    """The base of all errors. A program that does not catch it prints its text and ends with 1."""


class ProgramError(HeroError):
    """The program cannot work as it was started, for example because of a wrong parameter."""


class NodeError(ProgramError):
    """The program's ROS node cannot start, or the ROS master does not answer."""
