"""Why a calibration ends, for one robot or for all: one line with the thing, the value and the remedy."""


class CalibrationError(Exception):
    """A robot cannot be calibrated, or a file cannot be used; the text says why and what to do."""
