"""Intrinsics of a camera, from images of a ChArUco board, or a file of camera_calibration. Pure but for OpenCV."""

import math
from contextlib import suppress
from typing import List, NamedTuple, Optional, Sequence

import cv2
import numpy as np

from hero_node import one_line
from hero_node.files import EntryError, load_entries

from ..camera.camera_model import EQUIDISTANT, MODELS, PLUMB_BOB, RATIONAL, Camera, Intrinsics
from ..errors import CalibrationError
from ..prints.boards import DICTIONARY, create_board, list_board_corners

MIN_VIEWS = 8
JACKKNIFE_GROUPS = 6
MIN_CORNERS = 12
"""In one image; fewer fix no board."""

GOOD_RMS_PX = 0.5
WIDE_RMS_PX, WIDE_SHARE = 0.25, 0.8
"""Error of the model plumb_bob from which on others are tried, and share of it that a better one must reach."""

OUTLIER = 3.0
"""An image whose error is this many times the median is left out: blurred, or a bent board."""

GOOD_FOCAL_ERROR = 0.003
"""Standard deviation of the focal length. The arena's calibration takes most of it up, by the camera's height."""

TILTED_RAD = 0.25
MIN_TILTED = 4
"""Images with a tilted board: without them nearness cannot be told from focal length."""

_WINDOW_SHARE = 0.1
"""Half a window by the side of a square; the markers begin at 0.13 of it."""
_CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.001)

REGIONS = (
    ("upper left", "upper middle", "upper right"),
    ("middle left", "middle", "middle right"),
    ("lower left", "lower middle", "lower right"),
)
MIN_IN_REGION = 20


class BoardView(NamedTuple):
    """The board in one image: ids of its inner corners (K,), and their pixels (K, 2)."""

    ids: np.ndarray
    pixels: np.ndarray


class LensCalibration(NamedTuple):
    """Calibrated intrinsics, how far the board's corners lie from where these put them, and what speaks against them.

    focal_error: standard deviation of the focal length, as a share, found by leaving out groups of views.
    left_out: indices of the views that were left out.
    """

    lens: Intrinsics
    rms_px: float
    focal_error: float
    left_out: List[int]
    problems: List[str]


def find_board(gray: np.ndarray) -> Optional[BoardView]:
    """Return the board in an image (H, W), 8 bit; None if too little of it is seen."""
    made = create_board()
    if hasattr(cv2.aruco, "CharucoDetector"):  # since OpenCV 4.7
        pixels, ids, _, _ = cv2.aruco.CharucoDetector(made).detectBoard(gray)
    else:
        corners, markers, _ = cv2.aruco.detectMarkers(gray, DICTIONARY)
        if markers is None:
            return None
        _, pixels, ids = cv2.aruco.interpolateCornersCharuco(corners, markers, gray, made)
    if ids is None or len(ids) < MIN_CORNERS:
        return None
    return BoardView(np.asarray(ids).ravel(), _refine(gray, np.asarray(pixels, dtype=np.float32).reshape(-1, 2)))


def _refine(gray: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Return corners found again in windows well within their squares: OpenCV 4.6 leaves them half a pixel off."""
    apart_px = np.linalg.norm(pixels[:, None] - pixels, axis=2)
    np.fill_diagonal(apart_px, np.inf)
    # Each by the squares around it: a tilted board's far ones are smaller.
    halves_px = np.clip(_WINDOW_SHARE * apart_px.min(axis=0), 2, 11).astype(int)
    refined = pixels[:, None].copy()
    for half_px in set(halves_px.tolist()):
        chosen = halves_px == half_px
        refined[chosen] = cv2.cornerSubPix(gray, refined[chosen], (half_px, half_px), (-1, -1), _CRITERIA)
    return refined[:, 0]


def calibrate_lens(views: Sequence[BoardView], width_px: int, height_px: int) -> LensCalibration:
    """Return the intrinsics of the camera that saw the board.

    Raises: CalibrationError for fewer than eight images, or images that no lens explains.
    """
    if len(views) < MIN_VIEWS:
        text = "the board was found in %d images; it takes %d, from all sides and tilted" % (len(views), MIN_VIEWS)
        raise CalibrationError(text)
    used = views
    fit = _choose_fit(used, width_px, height_px)
    left_out = np.flatnonzero(fit.errors_px > OUTLIER * np.median(fit.errors_px)).tolist()
    if left_out and len(views) - len(left_out) >= MIN_VIEWS:
        used = [view for index, view in enumerate(views) if index not in left_out]
        fit = _choose_fit(used, width_px, height_px)
    else:
        left_out = []
    focal_error = _measure_focal_error(used, fit)
    problems = []
    if fit.rms_px > GOOD_RMS_PX:
        text = f"error {fit.rms_px:.2f} px rms is above {GOOD_RMS_PX:.1f} px: is the board flat, are the images sharp?"
        problems.append(text)
    if (fit.tilts_rad > TILTED_RAD).sum() < MIN_TILTED:
        problems.append("the board is hardly tilted: take images with it tilted by 30 to 45 degrees")
    elif focal_error > GOOD_FOCAL_ERROR:
        text = "the focal length is known to %.2f %% only: take more images with the board tilted by 30 to 45 degrees"
        problems.append(text % (100.0 * focal_error))
    empty = _list_empty_regions(used, width_px, height_px)
    if empty:
        problems.append(f"take images with the board there: {', '.join(empty)}")
    return LensCalibration(fit.lens, fit.rms_px, focal_error, left_out, problems)


class _Fit(NamedTuple):
    lens: Intrinsics
    rms_px: float
    errors_px: np.ndarray
    tilts_rad: np.ndarray


def _choose_fit(views: Sequence[BoardView], width_px: int, height_px: int) -> _Fit:
    """Return the fit of plumb_bob, unless another model of a lens explains the views clearly better."""
    fits = [_fit(views, width_px, height_px, PLUMB_BOB)]
    for model in (EQUIDISTANT, RATIONAL) if fits[0].rms_px > WIDE_RMS_PX else ():
        # OpenCV seeks the rational one's many numbers too far from the focal lengths of one of the others, not of both.
        for guess in [fit.lens._replace(distortion=np.zeros(0)) if model == RATIONAL else None for fit in fits]:
            with suppress(CalibrationError):  # the views do not suffice for this model
                fits.append(_fit(views, width_px, height_px, model, guess))
    best = min(fits, key=lambda fit: fit.rms_px)
    return best if best.rms_px < WIDE_SHARE * fits[0].rms_px else fits[0]


def _fit(
    views: Sequence[BoardView], width_px: int, height_px: int, model: str, guess: Optional[Intrinsics] = None
) -> _Fit:
    """Return the intrinsics that explain the views best, sought from a guess; None: OpenCV's own."""
    if model == EQUIDISTANT:
        module, calibrate, kind = cv2.fisheye, cv2.fisheye.calibrate, "float64"
        flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
    else:
        module, calibrate, kind = cv2, cv2.calibrateCamera, "float32"
        # k3 trades with k1 and k2: webcams whose field is below 90 degrees do without it.
        flags = cv2.CALIB_RATIONAL_MODEL if model == RATIONAL else cv2.CALIB_FIX_K3
    matrix, distortion = np.eye(3), np.zeros(MODELS[model][-1])
    if guess is not None:
        flags |= module.CALIB_USE_INTRINSIC_GUESS
        matrix = guess.matrix.copy()
        distortion[: len(guess.distortion)] = guess.distortion
    corners_m = [list_board_corners()[view.ids] for view in views]
    objects = [corners[:, None].astype(kind) for corners in corners_m]
    pixels = [view.pixels[:, None].astype(kind) for view in views]
    try:
        rms_px, matrix, distortion, turns, shifts = calibrate(
            objects, pixels, (width_px, height_px), matrix, distortion, flags=flags
        )
    except cv2.error as error:
        raise CalibrationError(f"no lens explains these images: {one_line(error)}") from None
    if not np.isfinite(matrix).all() or not math.isfinite(rms_px):
        raise CalibrationError("no lens explains these images: take them again")
    lens = Intrinsics(width_px, height_px, matrix, distortion.ravel()[: MODELS[model][-1]], model)
    errors_px, tilts_rad = [], []
    for view, corners, turn, shift_m in zip(views, corners_m, turns, shifts):
        rotation = cv2.Rodrigues(turn)[0]
        seen = Camera(lens, rotation, (-rotation.T @ shift_m).ravel()).project(corners)
        errors_px.append(math.sqrt(((seen - view.pixels) ** 2).sum(axis=1).mean()))
        tilts_rad.append(math.acos(min(abs(rotation[2, 2]), 1.0)))
    return _Fit(lens, float(rms_px), np.array(errors_px), np.array(tilts_rad))


def _measure_focal_error(views: Sequence[BoardView], fit: _Fit) -> float:
    """Return the standard deviation of the focal length, as a share, by the jackknife.

    What the corners' residuals tell is too little: a view's errors are alike (a bent board, blur, its place).
    """
    # By chance: people hold the board at like places at regular intervals.
    groups, focals_px = np.random.RandomState(0).permutation(len(views)) % JACKKNIFE_GROUPS, []
    for left_out in range(JACKKNIFE_GROUPS):
        others = [view for view, group in zip(views, groups) if group != left_out]
        without = _fit(others, fit.lens.width_px, fit.lens.height_px, fit.lens.model, fit.lens)
        focals_px.append(np.diagonal(without.lens.matrix)[:2])
    deviations = np.array(focals_px) / np.diagonal(fit.lens.matrix)[:2] - 1.0
    share = (JACKKNIFE_GROUPS - 1.0) / JACKKNIFE_GROUPS
    return float(np.sqrt(share * ((deviations - deviations.mean(axis=0)) ** 2).sum(axis=0)).max())


def _list_empty_regions(views: Sequence[BoardView], width_px: int, height_px: int) -> List[str]:
    pixels = np.vstack([view.pixels for view in views])
    columns, rows = np.clip((3.0 * pixels / (width_px, height_px)).astype(int), 0, 2).T
    return [
        name
        for row, names in enumerate(REGIONS)
        for column, name in enumerate(names)
        if ((rows == row) & (columns == column)).sum() < MIN_IN_REGION
    ]


def load_lens(path: str) -> Intrinsics:
    """Return the intrinsics in a file of camera_calibration. Raises: CalibrationError."""
    try:
        needed = ("image_width", "image_height", "camera_matrix", "distortion_coefficients")
        content = load_entries(path, "image_width: 640").mapping(None, needed)
        width_px, height_px = (content[key].whole(-(10**6), 10**6) for key in needed[:2])
        matrix, distortion = (content[key].mapping(None, ("data",))["data"].plain() for key in needed[2:])
        model = content["distortion_model"].text() if "distortion_model" in content else "plumb_bob"
        return Intrinsics.from_camera_info(width_px, height_px, matrix, model, distortion)
    except EntryError as error:
        raise CalibrationError(f"{error}; is it a file of camera_calibration?") from None
    except (OverflowError, TypeError, ValueError) as error:
        raise CalibrationError(f"{path} is no file of camera_calibration: {one_line(error)}") from None
