"""A YAML file -> its nodes, which know their lines, or one line that says what is wrong.

Borders: the only file that needs PyYAML, and only when a file is read. Without it, a file that is JSON as well can be
read all the same, but for comments on lines of their own; the shipped arenas are written that way.
"""

import json
from typing import Any, Dict, NamedTuple, Optional, Tuple

from .errors import OptionError

_TOO_DEEP = "lists within lists, deeper than can be read"

_LONGEST_SHOWN = 60


def read_nodes(path: str, option: str, remedy: str) -> Any:
    """Return the root node of the file at path, None if it is empty.

    option and remedy name what was asked for and what would do where the file cannot be read at all.

    Raises: OptionError with file, line and reason.
    """
    try:
        with open(path, encoding="utf-8") as file:
            text = file.read()
    except OSError as error:
        raise OptionError("%s cannot be read: %s; %s" % (option, error.strerror, remedy)) from error
    except UnicodeDecodeError as error:
        raise OptionError("%s is not a text file in UTF-8: %s" % (option, error)) from error
    try:
        import yaml
    except ImportError:
        return _read_json(text, option)
    try:
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise OptionError(
            "%s:%d: the character U+%04X may not stand in a YAML file" % (path, line, error.character)
        ) from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = mark.line + 1 if mark is not None else 1
        problem = getattr(error, "problem", None) or str(error)
        raise OptionError("%s:%d: %s" % (path, line, " ".join(problem.split()))) from error
    except RecursionError as error:
        raise OptionError("%s:1: %s" % (path, _TOO_DEEP)) from error


class _JsonNode(NamedTuple):
    """Stands for a node of PyYAML whose line is not known."""

    id: str
    value: Any
    start_mark: Optional[Any] = None


def _read_json(text: str, option: str) -> Any:
    lines = ["" if line.lstrip().startswith("#") else line for line in text.splitlines()]
    try:
        return _convert_json(json.loads("\n".join(lines)))
    except RecursionError as error:
        raise OptionError("%s: %s" % (option, _TOO_DEEP)) from error
    except ValueError as error:
        raise OptionError(
            "%s: PyYAML is missing, and the file is not JSON (%s); install PyYAML: apt install python3-yaml, or "
            "pip install PyYAML" % (option, error)
        ) from error


def _convert_json(value: Any) -> _JsonNode:
    if isinstance(value, dict):
        pairs = [(_convert_json(key), _convert_json(entry)) for key, entry in value.items()]
        return _JsonNode("mapping", pairs)
    if isinstance(value, list):
        return _JsonNode("sequence", [_convert_json(entry) for entry in value])
    return _JsonNode("scalar", "" if value is None else str(value))


def fail_at(path: str, node: Any, reason: str) -> OptionError:
    """Return the error that names file, line and reason."""
    mark = node.start_mark if node is not None else None
    return OptionError("%s:%d: %s" % (path, mark.line + 1 if mark is not None else 1, reason))


def describe_node(node: Any) -> str:
    """Return what a node is, for an error; in a file a list may even contain itself, and have no end."""
    if node.id != "scalar":
        return "a " + str(node.id)
    text = str(node.value)
    return repr(text if len(text) <= _LONGEST_SHOWN else text[:_LONGEST_SHOWN] + "...")


def read_mapping(path: str, node: Any, what: str) -> Dict[str, Tuple[Any, Any]]:
    """Return the keys of a mapping, each with its key node and its value node.

    Raises: OptionError if it is no mapping, or has a key twice.
    """
    if node is None or node.id != "mapping":
        raise fail_at(path, node, what)
    entries: Dict[str, Tuple[Any, Any]] = {}
    for key_node, value_node in node.value:
        if key_node.id != "scalar":
            raise fail_at(path, key_node, "a key must be a word, not a list or a mapping; " + what)
        if key_node.value in entries:
            raise fail_at(path, key_node, "key %s is there twice" % describe_node(key_node))
        entries[key_node.value] = (key_node, value_node)
    return entries
