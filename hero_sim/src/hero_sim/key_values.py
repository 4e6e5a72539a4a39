"""`KEY=VALUE,...` of the options --error and --fault. Pure."""

from typing import Dict, Mapping, Tuple

from .errors import OptionError


def parse_values(name: str, text: str, limits: Mapping[str, Tuple[float, float]]) -> Dict[str, float]:
    """Return the values in text; limits are the least and the most of each key.

    Raises: OptionError that begins with name and says what is wrong and what would do.
    """
    values: Dict[str, float] = {}
    for pair in filter(None, text.split(",")):
        key, equals, number = (part.strip() for part in pair.partition("="))
        if not equals:
            raise OptionError(f"{name}: {pair!r} is not KEY=VALUE")
        if key not in limits:
            raise OptionError(f"{name}: unknown key {key!r}; known are {', '.join(limits)}")
        try:
            values[key] = float(number)
        except ValueError as error:
            raise OptionError(f"{name}: {key} must be a number, not {number!r}") from error
        least, most = limits[key]
        if not least <= values[key] <= most:
            raise OptionError(f"{name}: {key} must be {least:.10g}..{most:.10g}, not {number}")
    return values
