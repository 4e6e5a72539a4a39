"""The errors that end a calibration, of one robot or of all: one line with the thing, the value and the remedy."""

from hero_node import HeroError


class CalibrationError(HeroError):
    """A robot cannot be calibrated, or a file cannot be used; the text says why and what to do."""


class EndedError(Exception):
    """The program was interrupted during a procedure."""
