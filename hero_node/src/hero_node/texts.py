"""Texts from robots, files and other programs, made fit for one line of a terminal. Pure."""

import reprlib
from typing import Any, Sequence

NAMES_SHOWN = 10

_SHORT = reprlib.Repr()
_SHORT.maxlevel = 2
_SHORT.maxstring = _SHORT.maxother = 60


def make_printable(text: str) -> str:
    """Return text without characters that would control the terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def one_line(error: Exception) -> str:
    """Return the text of an error of another library in one printable line."""
    return make_printable(" ".join(str(error).split()))


def shorten(value: Any) -> str:
    """Return a value as a printable text of some words; a list may hold thousands, or itself."""
    return make_printable(_SHORT.repr(value))


def list_names(names: Sequence[str], most: int = NAMES_SHOWN) -> str:
    """Return names as text, and of many only how many more there are."""
    more = len(names) - most
    return ", ".join(names[:most]) + (" and %d more" % more if more > 0 else "")
