"""Errors of a camera, its detector and its calibration."""

from hero_node import HeroError


class LocalizationError(HeroError):
    """One line: the thing, its value, the remedy."""


class DetectorError(LocalizationError):
    """A detector that is not installed, or has ended."""


class CalibrationError(LocalizationError):
    """Readings from which nothing can be calibrated."""


class FrameSourceError(LocalizationError):
    """A camera or video that cannot be opened."""


class SettingsError(LocalizationError):
    """A camera's file that cannot be read or used."""
