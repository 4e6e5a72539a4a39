"""The error of this package's programs, one line with the thing, the value and the remedy."""

from contextlib import contextmanager
from typing import Iterator

from hero_node import HeroError, make_printable


class RecordingError(HeroError):
    """A recording cannot be made or read; the text says why and what to do."""


@contextmanager
def explain_bag_errors(what: str) -> Iterator[None]:
    """Turn whatever rosbag raises in the block into one line that begins with what. Raises: RecordingError."""
    try:
        yield
    except HeroError:
        raise
    except OSError as error:
        raise RecordingError(f"{what}: {error.strerror or error}") from error
    except Exception as error:  # rosbag checks little: a wrong byte may raise anything
        reason = make_printable(str(error))[:200]
        raise RecordingError(f"{what}: it is damaged, or no bag ({type(error).__name__}: {reason})") from error
