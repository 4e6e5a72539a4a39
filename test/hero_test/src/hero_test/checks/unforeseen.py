"""An error that no program foresees, and functions that fail by it."""

from unittest.mock import Mock


class UnforeseenError(Exception):
    """Stands for a fault of the program."""


def fail(*_, **__):
    raise UnforeseenError


def fail_once(*answers):
    """Return a function that fails, and then answers: what asks again is not to wait for ever."""
    return Mock(side_effect=[UnforeseenError, *answers])
