"""Colors of a robot's light, by name or as numbers. Pure."""

from contextlib import suppress
from typing import Dict, Sequence, Tuple, Union

COLORS: Dict[str, Tuple[float, float, float]] = {
    "off": (0.0, 0.0, 0.0),
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
    "yellow": (1.0, 1.0, 0.0),
    "magenta": (1.0, 0.0, 1.0),
    "cyan": (0.0, 1.0, 1.0),
    "white": (1.0, 1.0, 1.0),
    "orange": (1.0, 0.4, 0.0),
}

Color = Union[str, Sequence[float]]


def parse_color(color: Color) -> Tuple[float, float, float]:
    """Return (red, green, blue), each 0..1.

    Raises: ValueError with the names that are known.
    """
    if isinstance(color, str):
        if color not in COLORS:
            raise ValueError(f"no color {color!r}; there are: {', '.join(COLORS)}")
        return COLORS[color]
    with suppress(TypeError, ValueError):
        red, green, blue = map(float, color)
        if all(0.0 <= value <= 1.0 for value in (red, green, blue)):
            return red, green, blue
    raise ValueError(f"a color is a name or three numbers 0..1, not {color!r}")
