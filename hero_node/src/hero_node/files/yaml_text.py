"""YAML from files and parameters as values, or one line that says what is wrong with it. Knows no ROS."""

from typing import Any

import yaml

from ..texts import one_line
from .safe_file import read_file

MAX_CHARACTERS = 500_000
"""PyYAML reads about 160,000 in a second, in which nothing else of the program runs; real files have some thousand."""


class YamlError(ValueError):
    """A text that is no YAML, or more than can be read; the error's text is one line."""


def read_text(path: str) -> str:
    """Return the text of a file. Raises: OSError as read_file(). YamlError if it is no UTF-8, or too long."""
    return decode_text(read_file(path))


def decode_text(content: bytes) -> str:
    """Return the text that a file holds. Raises: YamlError if it is no UTF-8, or too long."""
    try:
        text = content.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise YamlError(one_line(error)) from None
    if len(text) > MAX_CHARACTERS:
        raise YamlError("it has more than %d characters" % MAX_CHARACTERS)
    return text


def parse_yaml(text: str) -> Any:
    """Return what a text of at most MAX_CHARACTERS says. Raises: YamlError."""
    if len(text) > MAX_CHARACTERS:
        raise YamlError("it has more than %d characters" % MAX_CHARACTERS)
    try:
        return yaml.safe_load(text)
    except RecursionError:
        raise YamlError("lists or tables within each other, deeper than can be read") from None
    except Exception as error:  # noqa: BLE001 - PyYAML raises many kinds at invalid dates and numbers
        raise YamlError(one_line(error)) from None
