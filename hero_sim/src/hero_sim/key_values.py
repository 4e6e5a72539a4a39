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
            raise OptionError("%s: %r is not KEY=VALUE" % (name, pair))
        if key not in limits:
            raise OptionError("%s: unknown key %r; known are %s" % (name, key, ", ".join(limits)))
        try:
            values[key] = float(number)
        except ValueError as error:
            raise OptionError("%s: %s must be a number, not %r" % (name, key, number)) from error
        least, most = limits[key]
        if not least <= values[key] <= most:
            raise OptionError("%s: %s must be %.10g..%.10g, not %s" % (name, key, least, most, number))
    return values
