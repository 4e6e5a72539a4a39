"""Writes one run as a video, seen from above: .gif with Pillow, all others with ffmpeg."""

import contextlib
import os
import shutil
import subprocess
from typing import Any, Iterator, List, Sequence, Tuple

import numpy as np
from PIL import Image, ImageDraw

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import Arena, list_outlines

from .experiments.errors import ExperimentError
from .trial import OPEN, Trial

FRAMES_PER_S = 10

_SIZE, _FINER = 600, 2
"""Side of the frames in pixels, and how many times finer they are drawn, so that edges are smooth."""
_MARGIN_M = 0.2
_WALL, _OBJECT, _ROBOT = "#666666", "#c07a2e", "#0072b2"


def write_video(trial: Trial, time_s: float, speed: float, path: str) -> None:
    """Run trial, of one world, for time_s, and write it to path, speed times as fast as it was.

    Raises: ExperimentError if the format needs ffmpeg, or the file cannot be written.
    """
    is_gif = path.lower().endswith(".gif")
    if not is_gif and shutil.which("ffmpeg") is None:
        raise ExperimentError(f"--video {path}: apt install ffmpeg, or write a .gif")
    if not os.access(os.path.dirname(path) or ".", os.W_OK):
        raise ExperimentError(f"--video {path}: the folder cannot be written to")
    period_s, arena = speed / FRAMES_PER_S, trial.rows.world.arena
    run = trial.run(time_s, period_s)
    frames = [(poses[0].copy(), *list_outlines(trial.rows.world.list_objects())) for _, poses in run]
    limits_m = _find_limits(arena, frames)
    images = (draw_frame(arena, limits_m, number * period_s, *frame) for number, frame in enumerate(frames))
    (_write_gif if is_gif else _write_with_ffmpeg)(path, images)


def _write_gif(path: str, images: Iterator[Image.Image]) -> None:
    next(images).save(path, save_all=True, append_images=images, duration=1000 // FRAMES_PER_S, loop=0)


def _write_with_ffmpeg(path: str, images: Iterator[Image.Image]) -> None:
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{_SIZE}x{_SIZE}"]
    command += ["-r", str(FRAMES_PER_S), "-i", "-", "-pix_fmt", "yuv420p", path]
    # Where ffmpeg ends early, it says why.
    with contextlib.suppress(BrokenPipeError), subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        for image in images:
            process.stdin.write(image.tobytes())  # type: ignore[union-attr]
    if process.returncode:
        raise ExperimentError(f"--video {path}: ffmpeg cannot write it")


def _find_limits(arena: Arena, frames: List[Any]) -> np.ndarray:
    """Return the lower left and the upper right corner (2, 2) of what is shown: the arena, or where robots were."""
    if arena is not OPEN:
        return arena.bounds_m.reshape(2, 2) + ((-_MARGIN_M,), (_MARGIN_M,))
    places_m = np.concatenate([poses[:, :2] for poses, _, _ in frames])
    return np.array((places_m.min(axis=0) - _MARGIN_M, places_m.max(axis=0) + _MARGIN_M))


def draw_frame(
    arena: Arena, limits_m: np.ndarray, time_s: float, poses: np.ndarray, edges_m: Sequence[Any], discs_m: Sequence[Any]
) -> Image.Image:
    """Return walls, robots, objects (see list_outlines()) and the time as an image."""
    size = _SIZE * _FINER
    pixels_per_m, middle_m = size / float(np.ptp(limits_m, axis=0).max()), limits_m.mean(axis=0)
    image = Image.new("RGB", (size, size), "white")
    pen = ImageDraw.Draw(image)

    def find(x_m: float, y_m: float) -> Tuple[float, float]:
        return size / 2 + pixels_per_m * (x_m - middle_m[0]), size / 2 - pixels_per_m * (y_m - middle_m[1])

    def draw_line(color: str, width: int, x1_m: float, y1_m: float, x2_m: float, y2_m: float) -> None:
        pen.line([find(x1_m, y1_m), find(x2_m, y2_m)], color, width * _FINER)

    def draw_disc(color: str, x_m: float, y_m: float, radius_m: float) -> None:
        pen.ellipse([find(x_m - radius_m, y_m + radius_m), find(x_m + radius_m, y_m - radius_m)], color)

    for segment_m in arena.segments_m.tolist():
        draw_line(_WALL, 3, *segment_m)
    for edge_m in edges_m:
        draw_line(_OBJECT, 3, *edge_m)
    for disc_m in (*arena.circles_m.tolist(), *discs_m):
        draw_disc(_OBJECT, *disc_m)
    for x_m, y_m, yaw_rad in poses.tolist():
        draw_disc(_ROBOT, x_m, y_m, BODY_RADIUS_M)
        nose_m = x_m + BODY_RADIUS_M * np.cos(yaw_rad), y_m + BODY_RADIUS_M * np.sin(yaw_rad)
        draw_line("white", 2, x_m, y_m, *nose_m)
    image = image.resize((_SIZE, _SIZE), Image.BOX)
    ImageDraw.Draw(image).text((12, 12), f"{time_s:.1f} s", "black")
    return image
