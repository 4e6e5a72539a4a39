"""Colors of robots and states, distinguishable with any kind of color vision. Pure."""

from typing import Dict, Sequence, Tuple

Color = Tuple[float, float, float]

# Okabe and Ito's palette (2008) without its yellow, which is hard to see on white.
_FEW = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

MOST_NAMED = len(_FEW)
"""Up to this many robots have a color and a line in the legend; more have a shade and are labeled with their id."""

STATE_COLORS = {"ready": "#009E73", "joining": "#56B4E9", "away": "#D55E00", "refused": "#000000"}


def choose_colors(robot_ids: Sequence[int]) -> Dict[int, Color]:
    """Return a color for each robot: distinct ones for few, a scale in order of their ids for many."""
    from matplotlib import colors, pyplot

    if len(robot_ids) <= MOST_NAMED:
        return {robot_id: colors.to_rgb(_FEW[index]) for index, robot_id in enumerate(robot_ids)}
    scale = pyplot.get_cmap("viridis")
    # The bright end is hard to see on white.
    steps = [0.85 * index / (len(robot_ids) - 1) for index in range(len(robot_ids))]
    return {robot_id: tuple(scale(step)[:3]) for robot_id, step in zip(robot_ids, steps)}
