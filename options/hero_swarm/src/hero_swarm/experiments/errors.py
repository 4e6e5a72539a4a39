"""The error of experiments that cannot be run, resumed or reported."""

import os
import traceback
from contextlib import contextmanager
from typing import Iterator

from hero_node.errors import HeroError


class ExperimentError(HeroError):
    """One line for users: the thing, its value and the remedy."""


@contextmanager
def report_place(label: str) -> Iterator[None]:
    """Raise whatever a behavior raises as an ExperimentError of one line, with label and the line of the program."""
    try:
        yield
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        text = "%s: %s: %s (%s, line %s)"
        values = label, type(error).__name__, error, os.path.basename(place.filename), place.lineno
        raise ExperimentError(text % values) from error
