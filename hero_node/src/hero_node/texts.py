"""Texts from robots, files and other programs, made fit for one line of a terminal. Pure."""

import reprlib
from typing import Any

__all__ = ["make_printable", "one_line", "shorten"]

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
