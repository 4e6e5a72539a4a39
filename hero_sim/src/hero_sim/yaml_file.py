"""A YAML file -> its nodes, which know their lines, or one line that says what is wrong.

Borders: the only file that needs PyYAML, and only when a file is read.
"""

from typing import Any, Dict, Tuple

from .errors import OptionError


def read_nodes(path: str, option: str, remedy: str) -> Any:
    """Return the root node of the file at path, None if it is empty.

    option and remedy name what was asked for and what would do where the file cannot be read at all.

    Raises: OptionError with file, line and reason.
    """
    try:
        import yaml
    except ImportError as error:
        raise OptionError(
            "%s: PyYAML is missing; install it: apt install python3-yaml, or pip install PyYAML" % option
        ) from error
    try:
        with open(path, encoding="utf-8") as file:
            return yaml.compose(file, Loader=yaml.SafeLoader)
    except OSError as error:
        raise OptionError("%s cannot be read: %s; %s" % (option, error.strerror, remedy)) from error
    except UnicodeDecodeError as error:
        raise OptionError("%s is not a text file in UTF-8: %s" % (option, error)) from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = mark.line + 1 if mark is not None else 1
        raise OptionError("%s:%d: %s" % (path, line, getattr(error, "problem", None) or error)) from error


def fail_at(path: str, node: Any, reason: str) -> OptionError:
    """Return the error that names file, line and reason."""
    return OptionError("%s:%d: %s" % (path, node.start_mark.line + 1 if node is not None else 1, reason))


def read_mapping(path: str, node: Any, what: str) -> Dict[str, Tuple[Any, Any]]:
    """Return the keys of a mapping, each with its key node and its value node.

    Raises: OptionError if it is no mapping, or has a key twice.
    """
    if node is None or node.id != "mapping":
        raise fail_at(path, node, what)
    entries: Dict[str, Tuple[Any, Any]] = {}
    for key_node, value_node in node.value:
        if key_node.value in entries:
            raise fail_at(path, key_node, "key %r is there twice" % key_node.value)
        entries[key_node.value] = (key_node, value_node)
    return entries
