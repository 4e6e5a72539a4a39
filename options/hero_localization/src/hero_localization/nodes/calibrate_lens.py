"""Part lens of calibrate_camera: intrinsics from a board that is moved through the image, or of camera_calibration."""

import argparse
import math
from typing import List, Optional

import numpy as np

from hero_client import Program
from hero_node import say

from ..calibration.lens_calibration import BoardView, LensCalibration, calibrate_lens, find_board, load_lens
from ..tracking.settings import describe_lens
from .calibration_images import Images, finish

MAX_VIEWS = 25
ENOUGH_VIEWS = 20
STILL_PX = 3.0
"""A board that moves by more than this between two images is blurred."""

NEW_PX = 40.0
"""A board whose corners are nearer than this to those of a view that was taken shows nothing new."""

HINT_S = 10.0
"""After this long without the board in an image, possible causes are printed."""


def calibrate_lens_by_board(options: argparse.Namespace, images: Images, program: Program) -> int:
    """Collect views of the board, and calibrate. Return the exit code."""
    say("move the board slowly through the whole image, near and far, tilted by 30 to 45 degrees; hold still between")
    views: List[BoardView] = []
    last: Optional[BoardView] = None
    found_s = program.now_s
    result: Optional[LensCalibration] = None
    while len(views) < MAX_VIEWS and (result is None or result.problems):
        gray = images.take().gray
        view = find_board(gray)
        if view is not None:
            found_s = program.now_s
        elif program.now_s > found_s + HINT_S:
            found_s = program.now_s
            text = "no board in the images (mean shade %.0f of 255): hold it near and flat; are they dark or mirrored?"
            say(text % gray.mean())
        is_still = view is not None and last is not None and _measure_shift(view, last) < STILL_PX
        last = view
        if view is None or not is_still:
            continue
        if any(_measure_shift(view, other) < NEW_PX for other in views):
            continue
        views.append(view)
        if len(views) < ENOUGH_VIEWS:
            say("%d of at least %d images" % (len(views), ENOUGH_VIEWS))
            continue
        result = calibrate_lens(views, *gray.shape[::-1])
        say(f"{len(views)} images: {result.problems[0] if result.problems else 'enough'}")
    assert result is not None
    say(f"error {result.rms_px:.2f} px rms, focal length known to {100.0 * result.focal_error:.2f} %")
    return finish(options.file, describe_lens(result.lens), result.problems)


def _measure_shift(view: BoardView, other: BoardView) -> float:
    """Return by how many pixels the corners that both views show moved, on average; inf if they share none."""
    _, here, there = np.intersect1d(view.ids, other.ids, return_indices=True)
    if not len(here):
        return math.inf
    return float(np.linalg.norm(view.pixels[here] - other.pixels[there], axis=1).mean())


def import_lens(options: argparse.Namespace) -> int:
    """Take the intrinsics in a YAML file of camera_calibration. Return the exit code. Raises: CalibrationError."""
    lens = load_lens(options.yaml)
    say(f"focal lengths {lens.matrix[0, 0]:.1f} and {lens.matrix[1, 1]:.1f} px")
    return finish(options.file, describe_lens(lens), [])
