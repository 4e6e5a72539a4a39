"""Robots -> colours that people with any kind of colour vision tell apart. Pure."""

from typing import Dict, Sequence, Tuple

Colour = Tuple[float, float, float]

# Okabe and Ito's palette (2008) without its yellow, which is hard to see on white.
_FEW = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

MOST_NAMED = len(_FEW)
"""So many robots get a colour of their own and a line in the legend; more get a shade, and their number beside them."""

STATE_COLOURS = {"ready": "#009E73", "joining": "#56B4E9", "away": "#D55E00", "refused": "#000000"}


def choose_colours(robot_ids: Sequence[int]) -> Dict[int, Colour]:
    """Return a colour for each robot: told apart at a glance if they are few, else a scale by their order."""
    from matplotlib import colors, pyplot

    if len(robot_ids) <= MOST_NAMED:
        return {robot_id: colors.to_rgb(_FEW[index]) for index, robot_id in enumerate(robot_ids)}
    scale = pyplot.get_cmap("viridis")
    # The bright end is hard to see on white.
    steps = [0.85 * index / (len(robot_ids) - 1) for index in range(len(robot_ids))]
    return {robot_id: tuple(scale(step)[:3]) for robot_id, step in zip(robot_ids, steps)}
