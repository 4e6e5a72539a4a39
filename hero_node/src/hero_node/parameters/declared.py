"""Parameters of a program, with a default and a check: a wrong value ends it with one line. Pure."""

import argparse
import dataclasses
import math
from typing import Any, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Type, TypeVar

from ..errors import ProgramError
from ..texts import suggest
from .number_checks import is_number

T = TypeVar("T")

ALL_ROBOTS = "all"

MAX_ROBOTS_IN_RANGE = 1000

MAX_COORDINATE_M = 1e6
"""Largest coordinate of goals; the driver accepts poses within the same limit. Beyond it, sums lose precision."""


class Parameter(NamedTuple):
    """A parameter: what is allowed, and what documents say of it."""

    default: Any
    check: Callable[[str, Any], Any]
    """Name, value -> the checked value. Raises: ProgramError."""
    text: str = ""
    """Meaning, for documents."""
    unit: str = ""
    limits: Optional[Tuple[float, float]] = None
    choices: Tuple[str, ...] = ()


def number(default: float, low: float, high: float, unit: str = "", text: str = "") -> Parameter:
    """Declare a number in low..high, finite, in this unit; text says what it means, for documents."""
    check = _make_check(lambda value: is_number(value, low, high), float, _describe_limits("a number", low, high, unit))
    return Parameter(default, check, text, unit, (low, high))


def whole_number(default: int, low: int, high: int, unit: str = "", text: str = "") -> Parameter:
    """Declare a whole number in low..high."""

    def is_allowed(value: Any) -> bool:
        return is_number(value, low, high) and value == int(value)

    check = _make_check(is_allowed, int, _describe_limits("a whole number", low, high, unit))
    return Parameter(default, check, text, unit, (low, high))


def flag(default: bool, text: str = "") -> Parameter:
    """Declare a parameter that is true or false."""
    return Parameter(default, _make_check(lambda value: isinstance(value, bool), bool, "true or false"), text)


def choice(default: str, choices: Sequence[str], text: str = "") -> Parameter:
    """Declare a parameter that is one of choices."""
    check = _make_check(lambda value: value in choices, str, "one of: " + ", ".join(choices))
    return Parameter(default, check, text, choices=tuple(choices))


def string(default: str, text: str = "") -> Parameter:
    """Declare a parameter that may be any text."""
    return Parameter(default, _make_check(lambda value: isinstance(value, str), str, "a text"), text)


def _make_check(is_allowed: Callable[[Any], bool], kind: Type[Any], allowed: str) -> Callable[[str, Any], Any]:
    """Return a check that lets values through as this kind; allowed says what they must be."""

    def check(name: str, value: Any) -> Any:
        if not is_allowed(value):
            raise make_error(name, value, allowed)
        return kind(value)

    return check


def robot_ids(default: str, text: str = "") -> Parameter:
    """Declare ids of robots; "all" becomes None. See parse_robot_ids()."""
    return Parameter(default, parse_robot_ids, text)


def declare(parameter: Parameter) -> Any:
    """Return the field of a dataclass that holds a parameter; find_declared() finds it again."""
    return dataclasses.field(default=parameter.default, metadata={"parameter": parameter})


def find_declared(settings: Type[Any]) -> Dict[str, Parameter]:
    """Return the parameters that a dataclass and its bases declare, by the names of their fields."""
    fields = dataclasses.fields(settings)
    return {field.name: field.metadata["parameter"] for field in fields if "parameter" in field.metadata}


def check_parameters(declared: Mapping[str, Any], given: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the checked value of each declared parameter, its default where none is given.

    declared: name -> a Parameter, or a default that needs no check. Raises: ProgramError, also for other names.
    """
    for name in sorted(set(given) - set(declared)):
        shown = name if name.isprintable() else ascii(name)
        text = f"unknown parameter ~{shown}{suggest(name, declared, '~')}; known are: {', '.join(sorted(declared))}"
        raise ProgramError(text)
    return {
        name: parameter.check(name, given.get(name, parameter.default))
        if isinstance(parameter, Parameter)
        else given.get(name, parameter)
        for name, parameter in declared.items()
    }


def _describe_limits(kind: str, low: float, high: float, unit: str) -> str:
    return f"{kind} from {low:.15g} to {high:.15g}{' ' + unit if unit else ''}"


def make_error(name: str, value: Any, allowed: str) -> ProgramError:
    """Return the error about a value that is not allowed; allowed: what it must be."""
    return ProgramError(f"~{name} is {value!r}, but must be {allowed}")


def parse_robot_ids(name: str, value: Any) -> Optional[List[int]]:
    """Return the ids in value: a number, a list of numbers, or text such as "0 1 2" or "0-3"; None for "all".

    Raises: ProgramError for anything else, for a negative or repeated id, and for an empty list.
    """
    example = 'ids such as "0 1 2 3" or "0-3", or "all"'
    if value == ALL_ROBOTS:
        return None
    if isinstance(value, str):
        words: Sequence[Any] = value.replace(",", " ").split()
    else:
        words = value if isinstance(value, (list, tuple)) else [value]
    ids: List[int] = []
    for word in words:
        first, last = _parse_id_range(word)
        if first < 0 or last < first or last - first >= MAX_ROBOTS_IN_RANGE:
            raise ProgramError(f"~{name} holds {word!r}, but must hold robot {example}")
        ids.extend(range(first, last + 1))
    if not ids:
        raise ProgramError(f"~{name} is empty, but must hold robot {example}")
    for robot_id in ids:
        if ids.count(robot_id) > 1:
            raise ProgramError("~%s names robot %d more than once" % (name, robot_id))
    return ids


def parse_explicit_ids(name: str, value: Any) -> List[int]:
    """As parse_robot_ids(), for what looks for no robots. Raises: ProgramError for "all", too."""
    ids = parse_robot_ids(name, value)
    if ids is None:
        raise make_error(name, value, 'ids such as "0 1 2" or "0-3"')
    return ids


def robot_ids_option(text: str) -> Optional[List[int]]:
    """Return the ids in the value of a command line option, None for "all". Raises: argparse.ArgumentTypeError."""
    return _read_option(parse_robot_ids, text)


def explicit_ids_option(text: str) -> List[int]:
    """As robot_ids_option(), but "all" is refused. Raises: argparse.ArgumentTypeError."""
    return _read_option(parse_explicit_ids, text)


def _read_option(parse: Callable[[str, Any], T], text: str) -> T:
    try:
        return parse("robots", text)
    except ProgramError as error:
        raise argparse.ArgumentTypeError(str(error).replace("~robots", "it")) from error


def within(low: float, high: float, kind: Type[Any] = float) -> Callable[[str], Any]:
    """Return the type of a command line option that takes numbers of a kind in low..high."""

    def parse(text: str) -> Any:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            text = f"{text} must be a {'whole ' if kind is int else ''}number from {low:.15g} to {high:.15g}"
            raise argparse.ArgumentTypeError(text)
        return value

    return parse


def _parse_id_range(word: Any) -> Tuple[int, int]:
    """Return the first and last id of a word; (-1, -1) if it holds none."""
    if isinstance(word, int) and not isinstance(word, bool):
        return word, word
    first, dash, last = str(word).partition("-")
    if not first.isdecimal() or (dash and not last.isdecimal()):
        return -1, -1
    return int(first), int(last if dash else first)


def parse_poses(name: str, text: Any, ids: Optional[Sequence[int]]) -> Dict[int, Tuple[float, float, Optional[float]]]:
    """Return id -> (x_m, y_m, yaw_rad) from text such as "0 0; 0.3 0 90" (m, degrees), in the order of the ids.

    Of "x y" alone yaw_rad is None. No text: no poses. Raises: ProgramError for anything else.
    """
    parts = [part.split() for part in str(text).split(";") if part.strip()]
    if not parts:
        return {}
    remedy = 'must hold "x y" or "x y heading" for each robot, in m and degrees, separated by ";"'
    if ids is None or len(parts) != len(ids):
        count = ALL_ROBOTS if ids is None else str(len(ids))
        raise ProgramError(f"~{name} has {len(parts)} poses for {count} robots, but {remedy}")
    poses: Dict[int, Tuple[float, float, Optional[float]]] = {}
    for robot_id, part in zip(ids, parts):
        try:
            numbers = [float(word) for word in part]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3) or not all(abs(entry) <= MAX_COORDINATE_M for entry in numbers):
            raise ProgramError(f"~{name} holds {' '.join(part)!r}, but {remedy}")
        yaw_rad = math.radians(numbers[2]) if len(numbers) == 3 else None
        poses[robot_id] = (numbers[0], numbers[1], yaw_rad)
    return poses
