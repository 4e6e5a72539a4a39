"""The error of experiments that cannot be run, resumed or reported."""

from hero_node.errors import HeroError

__all__ = ["ExperimentError"]


class ExperimentError(HeroError):
    """One line for people: the thing, its value and the remedy."""
