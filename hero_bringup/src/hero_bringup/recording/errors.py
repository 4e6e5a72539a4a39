"""What the programs of this package end with: one line with the thing, the value and the remedy."""


class RecordingError(Exception):
    """A recording cannot be made or read; the text says why and what to do."""
