"""Errors of the simulator."""

from hero_node import HeroError


class CommandError(HeroError):
    """Bytes from the server that the robot cannot read as the message they should be."""


class OptionError(HeroError):
    """An option or a file that cannot be used; the text names it, its value and what would do."""
