"""Writes one run as an animated GIF, seen from above."""

import math
import os
from typing import List, Sequence

import numpy as np
from PIL import Image, ImageDraw

from hero_node.files import replace_file
from hero_sim.scene import ARROW, CYLINDER, TEXT, Shape, draw_arena, draw_objects, draw_robots
from hero_sim.world import Arena

from .experiments.errors import ExperimentError
from .trial import OPEN, Trial

FRAMES_PER_S = 10

_SIZE, _FINER = 600, 2
"""Side of the frames in pixels, and how many times finer they are drawn, so that edges are smooth."""
_MARGIN_M = 0.2
_FLOOR, _UNLIT = "#c8c8c8", (0.0, 0.45, 0.7, 1.0)
"""Colors of bare floor, so that black and white areas show, and of robots without a light."""
_MIN_WIDTH = 3


def write_video(trial: Trial, time_s: float, speed: float, path: str) -> None:
    """Run trial, of one world, for time_s, and write it to path, speed times as fast as it was.

    Raises: ExperimentError if the file has another ending, or cannot be written.
    """
    if not path.lower().endswith(".gif"):
        raise ExperimentError(f"--video {path}: must end with .gif; ffmpeg -i FILE.gif FILE.mp4 makes others")
    if not os.access(os.path.dirname(path) or ".", os.W_OK):
        raise ExperimentError(f"--video {path}: the folder cannot be written to")
    period_s, arena = speed / FRAMES_PER_S, trial.rows.world.arena
    frames = [_list_shapes(trial) for _ in trial.run(time_s, period_s)]
    limits_m = _find_limits(arena, frames)
    images = (draw_frame(limits_m, number * period_s, frame) for number, frame in enumerate(frames))
    with replace_file(path) as file:
        next(images).save(file, "GIF", save_all=True, append_images=images, duration=1000 // FRAMES_PER_S, loop=0)


def _list_shapes(trial: Trial) -> List[Shape]:
    """Return the shapes of the arena, the objects and the robots, from the floor up."""
    world, lights = trial.rows.world, trial.rows.lights
    shown = np.where(lights[:, 3:] > 0.0, lights, _UNLIT).tolist()
    robots = draw_robots(world, [""] * len(shown), shown)
    return [*draw_arena(world.arena), *draw_objects(world.list_objects()), *robots]


def _find_limits(arena: Arena, frames: Sequence[Sequence[Shape]]) -> np.ndarray:
    """Return the lower left and the upper right corner (2, 2) of what is shown: the arena, or where robots were."""
    if arena is not OPEN:
        return arena.bounds_m.reshape(2, 2) + ((-_MARGIN_M,), (_MARGIN_M,))
    places_m = np.array([shape.pose[:2] for shapes in frames for shape in shapes])
    return np.array((places_m.min(axis=0) - _MARGIN_M, places_m.max(axis=0) + _MARGIN_M))


def draw_frame(limits_m: np.ndarray, time_s: float, shapes: Sequence[Shape]) -> Image.Image:
    """Return shapes and the time as an image."""
    size = _SIZE * _FINER
    pixels_per_m = size / float(np.ptp(limits_m, axis=0).max())
    middle_x_m, middle_y_m = limits_m.mean(axis=0).tolist()
    image = Image.new("RGB", (size, size), _FLOOR)
    pen = ImageDraw.Draw(image)
    for shape in shapes:
        color = tuple(round(255.0 * part) for part in shape.color[:3])
        (x_m, y_m, yaw_rad), (length_m, width_m, _) = shape.pose, shape.size_m
        x, y = size / 2 + pixels_per_m * (x_m - middle_x_m), size / 2 - pixels_per_m * (y_m - middle_y_m)
        half, width = pixels_per_m * length_m / 2.0, max(_MIN_WIDTH * _FINER, round(pixels_per_m * width_m))
        if shape.kind == CYLINDER:
            pen.ellipse([x - half, y - half, x + half, y + half], color)
        elif shape.kind != TEXT:  # along the middle line, of arrows from their start
            ahead, left = half * math.cos(yaw_rad), half * math.sin(yaw_rad)
            start, end = (0, 2) if shape.kind == ARROW else (-1, 1)
            pen.line([x + start * ahead, y - start * left, x + end * ahead, y - end * left], color, width)
    image = image.reduce(_FINER)
    ImageDraw.Draw(image).text((12, 12), f"{time_s:.1f} s", "black")
    return image
