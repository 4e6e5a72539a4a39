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
        own = [line for line in called if sources.has_read(line.filename)]
        place = (own or called)[-1]
        # A file of the suite with its folder: a user's may have the same name.
        name = os.sep.join(place.filename.split(os.sep)[-1 if own else -3 :])
        text = f"{label}: {type(error).__name__}: {' '.join(str(error).split())} ({name}, line {place.lineno})"
        raise ExperimentError(text) from error
