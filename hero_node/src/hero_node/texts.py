"""Texts from robots, files and other programs, made fit for one line of a terminal. Pure."""

import difflib
import reprlib
from typing import Any, Iterable, Sequence

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


def suggest(name: Any, known: Iterable[str], mark: str = "") -> str:
    """Return "; did you mean ...?" with the known name that is spelled most alike; empty if none is near.

    mark: what users write before a name, such as ~.
    """
    return "".join(f"; did you mean {mark}{near}?" for near in difflib.get_close_matches(str(name), list(known), 1))
