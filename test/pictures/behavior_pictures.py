"""Draws every built-in behavior into one picture, as its test runs it: bodies at the end, and their last paths.

Run it with script/pictures behaviors.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "options/hero_swarm/test/unit"))
from test_behaviors import CASES, FRICTIONLESS, OPEN, make, place  # noqa: E402

from hero_client.values import BODY_RADIUS_M  # noqa: E402
from hero_swarm.behaviors import list_names  # noqa: E402
from hero_swarm.trial import Trial  # noqa: E402

COLUMNS = 6
PATH_S = 10.0
SEED = 1


def run(name):
    """Return the trial of one behavior at its end, and the poses of the last seconds (T, N, 3)."""
    _, _, _, robots, time_s, arena, size_m = CASES[name]
    starts, objects = place(arena, robots, [SEED])
    known = ["friction=0"] if name in FRICTIONLESS else ()
    trial = Trial(make(name), arena, robots, [SEED], size_m, starts=starts, objects=objects, known_errors=known)
    path = [poses[0] for time, poses in trial.run(time_s, every_s=0.2) if time >= time_s - PATH_S]
    return trial, np.array(path)


def draw(axes, name):
    """Draw one behavior."""
    trial, path = run(name)
    end = path[-1]
    lights = trial.rows.lights[:, :3]
    colors = np.where(lights.any(axis=1)[:, None], lights, (0.0, 0.45, 0.7))
    axes.add_collection(LineCollection(np.moveaxis(path[..., :2], 1, 0), colors="0.75", linewidths=0.7))
    axes.add_collection(LineCollection(trial.rows.world.arena.segments_m.reshape(-1, 2, 2), colors="0.3", linewidths=1))
    for body in trial.rows.world.list_objects():
        if len(body.corners_m):
            axes.fill(*np.array(body.corners_m).T, color="#c07a2e")
        else:
            circle = np.linspace(0.0, 2.0 * np.pi, 30)
            reach_m = body.shape.reach_m
            axes.fill(body.x_m + reach_m * np.cos(circle), body.y_m + reach_m * np.sin(circle), color="#c07a2e")
    bodies = [Circle(place_m, BODY_RADIUS_M) for place_m in end[:, :2].tolist()]
    axes.add_collection(PatchCollection(bodies, facecolors=colors, linewidths=0))
    headings = np.column_stack((np.cos(end[:, 2]), np.sin(end[:, 2])))
    noses_m = np.stack((end[:, :2], end[:, :2] + BODY_RADIUS_M * headings), axis=1)
    axes.add_collection(LineCollection(noses_m, colors="white", linewidths=0.8))
    bounds_m = trial.rows.world.arena.bounds_m
    low_m, high_m = (path[..., :2].min(axis=(0, 1)), path[..., :2].max(axis=(0, 1)))
    if trial.rows.world.arena is not OPEN:
        low_m, high_m = bounds_m[:2], bounds_m[2:]
    middle_m, half_m = (low_m + high_m) / 2.0, max(high_m - low_m) / 2.0 + 0.08
    axes.set_xlim(middle_m[0] - half_m, middle_m[0] + half_m)
    axes.set_ylim(middle_m[1] - half_m, middle_m[1] + half_m)
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(name, fontsize=8)


def main():
    """Draw all behaviors into docs/pictures/behaviors.png."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="behaviors: the only picture")
    parser.add_argument("--folder", type=Path, default=ROOT / "docs/pictures")
    options = parser.parse_args()
    names = list_names()
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(1.5 * COLUMNS, 1.62 * rows))
    FigureCanvasAgg(figure)
    for number, name in enumerate(names):
        draw(figure.add_subplot(rows, COLUMNS, number + 1), name)
    figure.subplots_adjust(0.01, 0.01, 0.99, 0.95, 0.04, 0.14)
    figure.savefig(options.folder / "behaviors.png", dpi=90)


if __name__ == "__main__":
    main()
