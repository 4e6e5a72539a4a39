"""The error of experiments that cannot be run, resumed or reported."""

import os
import traceback
from contextlib import contextmanager
from typing import Iterator

from hero_node import HeroError

from ..sources import Sources


class ExperimentError(HeroError):
    """One line for users: the thing, its value and the remedy."""


@contextmanager
def report_place(label: str, sources: Sources) -> Iterator[None]:
    """Raise whatever programs of the user raise as an ExperimentError of one line: label, error, line of a program.

    sources: files of the user, whose lines tell more than those that they call.
    """
    try:
        yield
    except Exception as error:
        called = traceback.extract_tb(error.__traceback__)
        place = ([line for line in called if sources.has_read(line.filename)] or called)[-1]
        text = "%s: %s: %s (%s, line %s)"
        where = os.path.basename(place.filename), place.lineno
        values = label, type(error).__name__, " ".join(str(error).split()), *where
        raise ExperimentError(text % values) from error
