#!/usr/bin/env python
"""Paths that a test recorded (HERO_RECORD=paths.npz) -> a picture of them in their arena.

draw_paths.py paths.npz ARENA picture.png "title"
"""

import sys

import matplotlib
import numpy as np

from hero_sim.arena_file import load_arena
from hero_sim.kinematics import BODY_RADIUS_M

matplotlib.use("Agg")
from matplotlib import pyplot


def draw(paths_file, arena_name, picture_file, title):
    """Draw all paths, with a disc where each robot ends."""
    arena = load_arena(arena_name)
    figure, axes = pyplot.subplots(figsize=(6, 6), constrained_layout=True)
    for x1_m, y1_m, x2_m, y2_m in arena.segments_m:
        axes.plot([x1_m, x2_m], [y1_m, y2_m], color="black", linewidth=1.5)
    for x_m, y_m, radius_m in arena.circles_m:
        axes.add_patch(pyplot.Circle((x_m, y_m), radius_m, color="0.5"))
    with np.load(paths_file) as paths:
        for index, name in enumerate(sorted(paths.files)):
            color = pyplot.get_cmap("tab10")(index % 10)
            axes.plot(paths[name][:, 1], paths[name][:, 2], color=color, linewidth=0.8)
            axes.add_patch(pyplot.Circle(tuple(paths[name][-1, 1:3]), BODY_RADIUS_M, color=color, zorder=3))
    axes.set_aspect("equal")
    axes.set_title(title)
    axes.set_xlabel("x in m")
    axes.set_ylabel("y in m")
    figure.savefig(picture_file, dpi=90)


if __name__ == "__main__":
    draw(*sys.argv[1:5])
