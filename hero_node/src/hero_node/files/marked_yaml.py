"""YAML with line numbers: each value knows its line, for errors. Pure but for PyYAML.

Anchors and merge keys are refused: a line would not be unique, and a short file could stand for a huge one.
"""

import math
from contextlib import suppress
from typing import Any, Callable, Collection, Dict, List, NamedTuple, NoReturn, Optional, Tuple

import yaml

from ..errors import HeroError
from ..parameters.number_checks import is_number, is_whole_number
from ..texts import make_printable, one_line, shorten, suggest
from .safe_file import read_file
from .yaml_text import MAX_CHARACTERS, YamlError, decode_text

MAX_DEPTH = 20
"""Levels of lists and mappings within each other; an experiment has four."""


class EntryError(HeroError):
    """A mistake in a file: one line with file, line, name, value and what is allowed."""

    def __init__(self, text: str) -> None:
        super().__init__(make_printable(text))


class Entry(NamedTuple):
    """A value of the file, a list of entries, or a dictionary of them; its name, such as "seeds.count"; its place."""

    value: Any
    name: str
    place: str

    def refuse(self, text: str) -> NoReturn:
        """Raise EntryError: place, name and value, and what it must be."""
        shown = {"list": "a list", "dict": "a mapping"}.get(type(self.value).__name__) or shorten(self.value)
        raise EntryError(f"{self.place}: {self.name} is {shown}, but must be {text}")

    def number(self, low: float, high: float, unit: str, may_be_nan: bool = False) -> float:
        """Return a number in low..high, or nan where it may be that; YAML takes some, such as 1e3, for texts."""
        value = self.value
        if isinstance(value, str):
            with suppress(ValueError):
                value = float(value)
        if may_be_nan and value != value:
            return math.nan
        if not is_number(value) or not low <= value <= high:
            limits = f" from {low:g} to {high:g}" if math.isfinite(high - low) else ""
            self.refuse(f"a number{limits}{' ' + unit if unit else ''}")
        return float(value)

    def whole(self, low: int, high: int) -> int:
        """Return a whole number in low..high."""
        value = self.value
        if not is_whole_number(value, low, high):
            self.refuse("a whole number from %d to %d" % (low, high))
        return int(value)

    def text(self) -> str:
        """Return a text that is not empty."""
        if not isinstance(self.value, str) or not self.value:
            self.refuse("a text")
        return str(self.value)

    def choice(self, choices: Collection[str]) -> str:
        """Return one of choices."""
        if not isinstance(self.value, str) or self.value not in choices:
            self.refuse(f"one of: {', '.join(choices)}{suggest(self.value, choices)}")
        return str(self.value)

    def entries(self) -> List["Entry"]:
        """Return the entries of a list that is not empty."""
        if not isinstance(self.value, list) or not self.value:
            self.refuse("a list such as [a, b], not an empty one")
        return list(self.value)

    def numbers(self, count: int, low: float, high: float, what: str, may_be_nan: bool = False) -> List[float]:
        """Return the numbers of a list of count, which what describes, each as number() does."""
        if not isinstance(self.value, list) or len(self.value) != count:
            self.refuse(what)
        return [item.number(low, high, "", may_be_nan) for item in self.value]

    def plain(self) -> Any:
        """Return the value without marks."""
        if isinstance(self.value, dict):
            return {name: entry.plain() for name, entry in self.value.items()}
        return [entry.plain() for entry in self.value] if isinstance(self.value, list) else self.value

    def mapping(
        self, allowed: Optional[Collection[str]] = None, required: Collection[str] = (), remedy: str = ""
    ) -> Dict[str, "Entry"]:
        """Return name -> entry of a mapping with only the allowed names (None: any), and all the required ones.

        remedy: where other names belong, for the error that refuses one.
        """
        if not isinstance(self.value, dict):
            self.refuse("a mapping such as {%s: ...}" % next(iter(allowed or ("name",))))
        where = f" in {self.name}" if self.name else ""
        for name, entry in self.value.items():
            if allowed is not None and name not in allowed:
                hint = suggest(name, allowed) + (remedy and f"; {remedy}")
                text = "%s: unknown %s%s; allowed are: %s%s"
                raise EntryError(text % (entry.place, shorten(name), where, ", ".join(allowed), hint))
        for name in required:
            if name not in self.value:
                raise EntryError(f"{self.place}: {name} is missing{where}")
        return dict(self.value)

    def single(self, allowed: Collection[str]) -> Tuple[str, "Entry"]:
        """Return name and entry of a mapping with one name."""
        mapping = self.mapping(allowed)
        if len(mapping) != 1:
            self.refuse("a mapping with one name")
        return next(iter(mapping.items()))


def load_entries(path: str, example: str, read: Callable[[str], bytes] = read_file, **options: bool) -> Entry:
    """Return what a file holds, as read_entries(). Raises: EntryError also for one that cannot be read."""
    try:
        return read_entries(decode_text(read(path)), path, example, **options)
    except OSError as error:
        raise EntryError(f"{path}: cannot be read: {error.strerror}") from error
    except YamlError as error:
        raise EntryError(f"{path}: not YAML: {error}") from error


def mark_values(value: Any, place: str, name: str = "") -> Entry:
    """Return values that come from no file as entries; place: where they come from."""
    if isinstance(value, dict):
        value = {str(key): mark_values(item, place, _join(name, str(key))) for key, item in value.items()}
    elif isinstance(value, (list, tuple)):
        value = [mark_values(item, place, name) for item in value]
    return Entry(value, name, place)


def read_entries(text: str, file: str, example: str, as_texts: bool = False, may_be_empty: bool = False) -> Entry:
    """Return the mapping that text, the contents of file, holds; example: of a line in it.

    as_texts: no value is a date, truth value or None; numbers are texts, which number() takes.
    Raises: EntryError with file and line for what is not YAML, not a mapping, or too large.
    """
    if len(text) > MAX_CHARACTERS:
        raise EntryError("%s: longer than %d characters" % (file, MAX_CHARACTERS))
    try:
        loader = (_TextLoader if as_texts else _Loader)(text)
        loader.name = file
        node = loader.get_single_node()
    except yaml.MarkedYAMLError as error:
        raise EntryError(f"{_find_place(error.problem_mark)}: not YAML: {error.problem}") from None
    except yaml.YAMLError as error:
        raise EntryError(f"{file}: not YAML: {one_line(error)}") from None
    if node is None and may_be_empty:
        return Entry({}, "", file)
    if not isinstance(node, yaml.MappingNode):
        raise EntryError(f"{file}: must hold names and values, such as {example}")
    return _convert(node, "", loader)


class _Limits:
    """Refuses deep nesting and anchors before anything that works recursively meets them."""

    _depth = 0

    def compose_node(self: Any, parent: Any, index: Any) -> Any:
        event = self.peek_event()
        self._depth += isinstance(event, yaml.CollectionStartEvent)
        if event.anchor is not None or self._depth > MAX_DEPTH:
            what = "more than %d levels" % MAX_DEPTH if event.anchor is None else "anchors cannot be used"
            raise EntryError(f"{_find_place(event.start_mark)}: {what}")
        node = super().compose_node(parent, index)  # type: ignore[misc]
        self._depth -= isinstance(event, yaml.CollectionStartEvent)
        return node


class _Loader(_Limits, yaml.SafeLoader):  # type: ignore[misc]
    pass


class _TextLoader(_Limits, yaml.BaseLoader):  # type: ignore[misc]
    pass


def _find_place(mark: yaml.Mark) -> str:
    return "%s, line %d" % (mark.name, mark.line + 1)


def _convert(node: yaml.Node, name: str, loader: Any) -> Entry:
    place = _find_place(node.start_mark)
    if isinstance(node, yaml.MappingNode):
        return Entry(_convert_mapping(node, name, loader), name, place)
    if isinstance(node, yaml.SequenceNode):
        return Entry([_convert(item, name, loader) for item in node.value], name, place)
    try:
        return Entry(loader.construct_object(node), name, place)
    except Exception as error:  # noqa: BLE001 - PyYAML raises many kinds at invalid dates and numbers
        raise EntryError(f"{place}: {name}: {one_line(error)}") from None


def _convert_mapping(node: yaml.MappingNode, name: str, loader: Any) -> Dict[str, Entry]:
    mapping: Dict[str, Entry] = {}
    for key_node, value_node in node.value:
        place = _find_place(key_node.start_mark)
        if not isinstance(key_node, yaml.ScalarNode):
            raise EntryError(f"{place}: a name must be a text")
        key = str(key_node.value)
        if key in mapping:
            raise EntryError(f"{place}: {shorten(key)} appears twice")
        mapping[key] = _convert(value_node, _join(name, key), loader)
    return mapping


def _join(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key
