"""Writes one run as a video, seen from above: .gif with Pillow, all others with ffmpeg.

Without matplotlib.animation: that of Noetic calls `convert` of ImageMagick when it is imported, and fails if that does.
"""

import contextlib
import itertools
import os
import shutil
import subprocess
from typing import Any, Iterator, List, Sequence, Tuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.figure import Figure
from PIL import Image

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import list_outlines

from .experiments.errors import ExperimentError
from .trial import OPEN, Trial

FRAMES_PER_S = 10

_SIZE_IN = 6.0
_MARGIN_M = 0.2


def write_video(trial: Trial, time_s: float, speed: float, path: str) -> None:
    """Run trial, of one world, for time_s, and write it to path, speed times as fast as it was.

    Raises: ExperimentError if the format needs ffmpeg, or the file cannot be written.
    """
    is_gif = path.lower().endswith(".gif")
    if not is_gif and shutil.which("ffmpeg") is None:
        raise ExperimentError(f"--video {path}: apt install ffmpeg, or write a .gif")
    folder = os.path.dirname(path) or "."
    if not os.access(folder, os.W_OK):
        raise ExperimentError(f"--video {path}: the folder cannot be written to")
    run = trial.run(time_s, speed / FRAMES_PER_S)
    frames = [(poses[0].copy(), *list_outlines(trial.rows.world.list_objects())) for _, poses in run]
    figure = Figure(figsize=(_SIZE_IN, _SIZE_IN))
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    low_m, high_m = _find_limits(trial, frames)
    axes.set_xlim(low_m[0], high_m[0])
    axes.set_ylim(low_m[1], high_m[1])
    axes.set_aspect("equal")
    arena = trial.rows.world.arena
    axes.add_collection(LineCollection(arena.segments_m.reshape(-1, 2, 2), colors="0.4", linewidths=2))
    axes.add_collection(_make_circles(axes, arena.circles_m, "#c07a2e"))

    def draw_frames() -> Iterator[np.ndarray]:
        parts: List[Any] = []
        for number, frame in enumerate(frames):
            for part in parts:
                part.remove()
            parts = draw_moving(axes, number * speed / FRAMES_PER_S, *frame)
            canvas.draw()
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy()

    (_write_gif if is_gif else _write_with_ffmpeg)(path, draw_frames())


def _write_gif(path: str, frames: Iterator[np.ndarray]) -> None:
    images = map(Image.fromarray, frames)
    next(images).save(path, save_all=True, append_images=images, duration=1000 // FRAMES_PER_S, loop=0)


def _write_with_ffmpeg(path: str, frames: Iterator[np.ndarray]) -> None:
    first = next(frames)
    size = "%dx%d" % (first.shape[1], first.shape[0])
    command = ["ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size]
    command += ["-r", str(FRAMES_PER_S), "-i", "-", "-pix_fmt", "yuv420p", path]
    # Where ffmpeg ends early, it says why.
    with contextlib.suppress(BrokenPipeError), subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        for frame in itertools.chain((first,), frames):
            process.stdin.write(frame.tobytes())  # type: ignore[union-attr]
    if process.returncode:
        raise ExperimentError(f"--video {path}: ffmpeg cannot write it")


def _make_circles(axes: Any, circles_m: np.ndarray, color: str) -> EllipseCollection:
    """Return circles (C, 3), x y radius."""
    diameters_m = 2.0 * circles_m[:, 2]
    return EllipseCollection(
        diameters_m, diameters_m, np.zeros(len(diameters_m)), units="x", offsets=circles_m[:, :2],
        transOffset=axes.transData, facecolors=color,
    )  # fmt: skip


def _find_limits(trial: Trial, frames: List[Any]) -> Tuple[np.ndarray, np.ndarray]:
    """Return the lower left and the upper right corner (m) of what is shown: the arena, or where robots were."""
    arena = trial.rows.world.arena
    if arena is not OPEN:
        return arena.bounds_m[:2] - _MARGIN_M, arena.bounds_m[2:] + _MARGIN_M
    places_m = np.concatenate([poses[:, :2] for poses, _, _ in frames])
    return places_m.min(axis=0) - _MARGIN_M, places_m.max(axis=0) + _MARGIN_M


def draw_moving(
    axes: Any, time_s: float, poses: np.ndarray, edges_m: Sequence[Any], discs_m: Sequence[Any]
) -> List[Any]:
    """Draw robots, objects (see list_outlines()) and the time; return the parts."""
    places_m, headings = poses[:, :2], np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2])))
    noses_m = np.stack((places_m, places_m + BODY_RADIUS_M * headings), axis=1)
    bodies_m = np.column_stack((places_m, np.full(len(poses), BODY_RADIUS_M)))
    collections = (
        LineCollection(np.reshape(edges_m, (-1, 2, 2)), colors="#c07a2e", linewidths=2),
        _make_circles(axes, np.reshape(discs_m, (-1, 3)), "#c07a2e"),
        _make_circles(axes, bodies_m, "#0072B2"),
        LineCollection(noses_m, colors="white", linewidths=1),
    )
    text = axes.text(0.02, 0.97, f"{time_s:.1f} s", transform=axes.transAxes, va="top")
    return [*map(axes.add_collection, collections), text]
