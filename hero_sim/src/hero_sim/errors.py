"""Errors of the simulator."""

from hero_node.errors import HeroError


class SimulatorError(HeroError):
    """Anything that the simulator reports itself."""


class CommandError(SimulatorError):
    """Bytes from the server that the robot cannot read as the message they should be."""


class OptionError(SimulatorError):
    """An option or a file that cannot be used; the text names it, its value and what would do."""
