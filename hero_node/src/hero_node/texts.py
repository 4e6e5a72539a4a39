"""Texts from robots, files and other programs, made fit for one line of a terminal. Pure."""

__all__ = ["make_printable", "one_line"]


def make_printable(text: str) -> str:
    """Return text without characters that would control the terminal."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def one_line(error: Exception) -> str:
    """Return the text of an error of another library in one printable line."""
    return make_printable(" ".join(str(error).split()))
