"""What was recorded of simulated robots -> pictures: paths in their arena, lights over time."""

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

from hero_node.robot_constants import BODY_RADIUS_M

DPI = 90


def color_of(index):
    """Return the color of a robot."""
    return pyplot.get_cmap("tab10")(index % 10)


def draw_arena(axes, arena):
    """Draw walls and posts alike."""
    for x1_m, y1_m, x2_m, y2_m in arena.segments_m:
        axes.plot([x1_m, x2_m], [y1_m, y2_m], color="black", linewidth=1.5)
    for x_m, y_m, radius_m in arena.circles_m:
        axes.add_patch(pyplot.Circle((x_m, y_m), radius_m, fill=False, edgecolor="black", linewidth=1.5))


def draw_paths(picture, title, arena, paths, goals=None, only_m=None, size_inch=(6, 6)):
    """Save a picture of paths {robot: rows of time, x, y, ...}: a ring where each begins, a disc where it ends.

    goals: places that were asked for, [(x, y)]. only_m: x and y limits, instead of the whole arena.
    """
    figure, axes = pyplot.subplots(figsize=size_inch, constrained_layout=True)
    draw_arena(axes, arena)
    for index, (robot, rows) in enumerate(sorted(paths.items())):
        color = color_of(index)
        axes.plot(rows[:, 1], rows[:, 2], color=color, linewidth=1.0)
        axes.add_patch(pyplot.Circle(tuple(rows[0, 1:3]), BODY_RADIUS_M, color=color, fill=False, zorder=3))
        end = tuple(rows[-1, 1:3])
        axes.add_patch(pyplot.Circle(end, BODY_RADIUS_M, color=color, zorder=3, label="hero_%d" % robot))
    if goals:
        axes.plot(*zip(*goals), "x", color="black", markersize=5, zorder=4)
    if len(paths) <= 4:
        axes.legend(loc="best", fontsize="small")
    if only_m:
        axes.set_xlim(*only_m[0])
        axes.set_ylim(*only_m[1])
    axes.set_aspect("equal")
    axes.set_title(title)
    axes.set_xlabel("x (m), ground truth")
    axes.set_ylabel("y (m)")
    figure.savefig(picture, dpi=DPI)
    pyplot.close(figure)


def draw_lights(picture, shows):
    """Save a picture of lights over time. shows: {title: rows of (time s, {robot: (r, g, b)})}."""
    figure, all_axes = pyplot.subplots(
        len(shows), 1, figsize=(7, 1.9 * len(shows)), sharex=True, constrained_layout=True
    )
    for axes, (title, rows) in zip(np.atleast_1d(all_axes), shows.items()):
        robots = sorted(rows[0][1])
        image = np.array([[colors[robot] for _, colors in rows] for robot in robots])
        axes.imshow(
            image,
            aspect="auto",
            interpolation="nearest",
            extent=(0.0, rows[-1][0] - rows[0][0], len(robots) - 0.5, -0.5),
        )
        axes.set_yticks(range(len(robots)))
        axes.set_yticklabels(["hero_%d" % robot for robot in robots], fontsize="x-small")
        axes.set_title(title, fontsize="medium")
    axes.set_xlabel("time in s")
    figure.savefig(picture, dpi=DPI)
    pyplot.close(figure)
