"""YAML files as nodes that know their lines, and errors that name file, line and reason.

A file may come from anybody: whatever it holds is read or refused with one OptionError.
"""

from typing import Any, Dict, Tuple

import yaml

from .errors import OptionError

__all__ = ["describe_node", "fail_at", "read_mapping", "read_nodes"]

_LONGEST_SHOWN = 60


def read_nodes(path: str, option: str, remedy: str) -> Any:
    """Return the root node of the file at path, None if it is empty.

    option names what was asked for and remedy what would do, for a file that cannot be read at all.

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
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        reason = "the character U+%04X may not stand in a YAML file" % error.character
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark is not None else 1
        reason = " ".join(str(error.problem or error).split())
    except RecursionError:
        line, reason = 1, "lists within lists, deeper than can be read"
    raise OptionError("%s:%d: %s" % (path, line, reason))


def fail_at(path: str, node: Any, reason: str) -> OptionError:
    """Return the error that names file, line and reason."""
    return OptionError("%s:%d: %s" % (path, node.start_mark.line + 1 if node is not None else 1, reason))


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
