"""The lens from rendered images of a ChArUco board, and what too few or poor images are told."""

import cv2
import numpy as np
import pytest

from hero_localization.calibration import lens_calibration
from hero_localization.calibration.lens_calibration import (
    REGIONS,
    BoardView,
    _list_empty_regions,
    calibrate_lens,
    find_board,
)
from hero_localization.camera.camera_model import Intrinsics
from hero_localization.errors import CalibrationError
from hero_localization.prints import boards
from hero_localization.prints.boards import COLUMNS, ROWS, SQUARE_M, draw_board, list_board_corners
from hero_localization.simulated_camera.view import CameraOptions, list_rays
from hero_test.nonempty import nonempty

OPTIONS = CameraOptions(
    width_px=960,
    height_px=540,
    focal_px=(695.0, 692.0),
    center_px=(474.0, 276.0),
    distortion=(-0.1, 0.03, 0.001, -0.0005, 0),
)


def render(options, turn, position_m, random):
    """Return the image of a board, centered at position_m in the optical frame, of shade 0.8 on a ground of 108."""
    lens, cell, fine = options.geometry.lens, 100, 3
    printed = np.pad(draw_board(cell), 2 * cell, constant_values=255)
    rim_m = np.array(printed.shape[::-1]) * SQUARE_M / cell / 2.0
    rays = list_rays(lens)
    to_ray = np.column_stack((cv2.Rodrigues(np.array(turn, dtype=float))[0][:, :2], position_m))
    # Rays meet the board at x, y (m) from its center, and are of the depth that brings their matrix to 1.
    to_texel = np.array(((cell / SQUARE_M, 0, 0), (0, cell / SQUARE_M, 0), (0, 0, 1.0)))
    to_texel[:2, 2] = rim_m * cell / SQUARE_M - 0.5
    texels = cv2.perspectiveTransform(rays, to_texel @ np.linalg.inv(to_ray))
    size = (fine * options.width_px, fine * options.height_px)
    texels = cv2.resize(texels, size, interpolation=cv2.INTER_LINEAR)
    image = cv2.remap(printed, texels, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=110)
    image = cv2.resize(image, (options.width_px, options.height_px), interpolation=cv2.INTER_AREA).astype(float)
    image = cv2.GaussianBlur(image, (0, 0), options.blur_px)
    noisy = 20.0 + 0.8 * image + random.normal(0.0, options.noise, image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def list_holds(count, tilt_rad, seed=0):
    """Return turn and position of a board held all over the image."""
    random = np.random.RandomState(seed)
    holds = []
    for index in range(count):
        u, v = 160.0 + 640.0 * (index % 3) / 2.0, 110.0 + 320.0 * (index // 3 % 3) / 2.0
        distance_m = random.uniform(0.38, 0.5)
        turn = (
            *(tilt_rad * random.choice((-1.0, 1.0), 2) * random.uniform(0.5, 1.0, 2)),
            random.uniform(-0.3, 0.3),
        )
        (fx, fy), (cx, cy) = OPTIONS.focal_px, OPTIONS.center_px
        holds.append((turn, ((u - cx) / fx * distance_m, (v - cy) / fy * distance_m, distance_m)))
    return holds


@pytest.fixture(scope="module")
def views():
    random = np.random.RandomState(5)
    pictures = [render(OPTIONS, *hold, random) for hold in list_holds(18, 0.55)]
    found = [find_board(picture) for picture in pictures]
    assert sum(view is not None for view in found) >= 16
    return [view for view in found if view is not None]


def project(holds, noise_px=0.1, seed=0):
    """Return views as exact as a good image's, without rendering."""
    random, view = np.random.RandomState(seed), OPTIONS.geometry
    corners_m = list_board_corners()
    center_m = np.array((COLUMNS * SQUARE_M / 2.0, ROWS * SQUARE_M / 2.0, 0.0))
    result = []
    for turn, position_m in holds:
        shift = np.array(position_m) - cv2.Rodrigues(np.array(turn))[0] @ center_m
        pixels = cv2.projectPoints(corners_m, np.array(turn), shift, view.lens.matrix, view.lens.distortion)[0][:, 0]
        inside = ((pixels > 0) & (pixels < (OPTIONS.width_px, OPTIONS.height_px))).all(axis=1)
        noisy = pixels + random.normal(0.0, noise_px, pixels.shape)
        result.append(BoardView(np.nonzero(inside)[0], noisy[inside].astype(np.float32)))
    return result


def test_corners_of_a_tilted_board_are_right_near_and_far():
    fine, cell_px = 4, 120
    printed = np.pad(draw_board(cell_px), cell_px, constant_values=255)
    rows, columns = printed.shape
    rim = np.array(((0, 0), (columns, 0), (columns, rows), (0, rows)), np.float32)
    seen = fine * np.array(((280, 60), (660, 130), (840, 500), (90, 430)), np.float32)
    homography = cv2.getPerspectiveTransform(rim, seen)
    light = cv2.warpPerspective(printed, homography, (fine * 960, fine * 540), borderValue=120)
    gray = cv2.GaussianBlur(cv2.resize(light, (960, 540), interpolation=cv2.INTER_AREA), (0, 0), 0.7)
    view = find_board(gray)
    corners = (list_board_corners()[:, :2] / SQUARE_M + 1.0) * cell_px - 0.5
    expected = (cv2.perspectiveTransform(corners[None], homography)[0] + 0.5) / fine - 0.5
    assert len(view.ids) == len(corners)
    assert np.abs(view.pixels - expected[view.ids]).max() < 0.15


def calibrate(views):
    return calibrate_lens(views, OPTIONS.width_px, OPTIONS.height_px)


@pytest.mark.slow
def test_lens_is_found_from_rendered_pictures(views):
    found = calibrate(views)
    assert found.problems == []
    assert found.rms_px < 0.3
    assert (found.lens.matrix[0, 0], found.lens.matrix[1, 1]) == pytest.approx(OPTIONS.focal_px, rel=0.003)
    axes = np.meshgrid(np.linspace(-0.6, 0.6, 9), np.linspace(-0.35, 0.35, 5))
    rays = np.column_stack([axis.ravel() for axis in axes])
    view = OPTIONS.geometry
    true = view.project(np.column_stack((rays, np.ones(len(rays)))) @ view.rotation + view.position_m)
    shift = found.lens.distort(rays) - true
    # A shift of the whole image and a turn of the camera are one.
    assert np.abs(shift - shift.mean(axis=0)).max() < 1.0


@pytest.mark.slow
def test_boards_corners_are_found_where_they_are(views):
    exact = project(list_holds(18, 0.55), 0.0)
    for found, true in nonempty(zip(views, exact)):
        at = dict(zip(true.ids, true.pixels))
        errors = [found.pixels[row] - at[corner] for row, corner in enumerate(found.ids) if corner in at]
        assert np.sqrt(np.mean(np.square(errors))) < 0.3


def test_picture_without_a_board_gives_none():
    assert find_board(np.full((540, 960), 120, np.uint8)) is None


@pytest.mark.slow
def test_regions_without_a_board_are_named():
    holds = [hold for hold in list_holds(36, 0.5) if hold[1][0] > -0.1]
    problems = calibrate(project(holds)).problems
    assert any("middle left" in problem and "middle right" not in problem for problem in problems)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "left_out"), [(8, []), (9, [4])])
def test_bad_pictures_stay_where_too_few_others_are_left(count, left_out):
    views = project(list_holds(count, 0.5))
    off = np.random.RandomState(0).normal(0.0, 4.0, views[4].pixels.shape).astype(np.float32)
    views[4] = views[4]._replace(pixels=views[4].pixels + off)
    assert calibrate(views).left_out == left_out


@pytest.mark.slow
def test_the_focal_length_is_no_worse_than_reported():
    """Of views whose corners are wrong together, as those of a board that is a little bent or blurred."""
    random, off, reported = np.random.RandomState(1), [], []
    for seed in range(4):
        views = []
        for view in project(list_holds(20, 0.6, seed), noise_px=0.05, seed=seed):
            center = view.pixels.mean(axis=0)
            bend = np.eye(2) + random.normal(0.0, 5e-4, (2, 2))
            views.append(view._replace(pixels=((view.pixels - center) @ bend + center).astype(np.float32)))
        found = calibrate(views)
        off.append(found.lens.matrix[0, 0] / OPTIONS.focal_px[0] - 1.0)
        reported.append(found.focal_error)
    assert np.sqrt(np.mean(np.square(off))) < 1.5 * np.sqrt(np.mean(np.square(reported)))


def put_corners(places):
    """Return a view with so many corners at shares of the image's width and height."""
    pixels = [(u * 960.0, v * 540.0) for (u, v), count in places.items() for _ in range(count)]
    return BoardView(np.arange(len(pixels)), np.array(pixels, dtype=np.float32))


def test_each_third_of_the_image_needs_twenty_corners():
    names = [name for row in REGIONS for name in row]
    middles = [(u, v) for v in (0.17, 0.5, 0.83) for u in (0.17, 0.5, 0.83)]
    for name, middle in zip(names, middles):
        for count, missing in ((19, [name]), (20, [])):
            view = put_corners({other: count if other == middle else 25 for other in middles})
            assert _list_empty_regions([view], 960, 540) == missing
    # The rims belong to it, and what lies just beyond them.
    corners = {(-0.01, -0.01): 20, (1.01, 1.01): 20, (0.34, 0.32): 20}
    assert [name for name in names if name not in _list_empty_regions([put_corners(corners)], 960, 540)] == [
        "upper left", "upper middle", "lower right",
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("tilt_rad", "is_told"), [(0.21, True), (0.29, False)])
def test_four_views_tilted_by_a_quarter_radian_are_enough(tilt_rad, is_told):
    tilts_rad = [tilt_rad] * 4 + [0.02] * 6
    holds = [((0.0, tilt, 0.1), place) for tilt, (_, place) in zip(tilts_rad, list_holds(10, 0.5))]
    problems = calibrate(project(holds, noise_px=0.05)).problems
    assert any("hardly tilted" in problem for problem in problems) == is_told


@pytest.fixture
def judge(monkeypatch):
    """Return a function that calibrates from as many views as there are errors, of a fit that has these."""

    def run(errors_px, rms_px=0.1, tilts_rad=(0.3,) * 9, focal_error=0.001):
        used = []

        def fit(views, width_px, height_px, model, guess=None):
            if model != "plumb_bob":
                raise CalibrationError("the views do not suffice")
            used.append([int(view.ids[0]) for view in views])
            chosen = np.array([errors_px[index] for index in used[-1]])
            lens = Intrinsics(960, 540, np.eye(3), np.zeros(5))
            return lens_calibration._Fit(lens, rms_px, chosen, np.array(tilts_rad))

        monkeypatch.setattr(lens_calibration, "_fit", fit)
        monkeypatch.setattr(lens_calibration, "_measure_focal_error", lambda *_: focal_error)
        everywhere = {(u, v): 25 for u in (0.1, 0.5, 0.9) for v in (0.1, 0.5, 0.9)}
        views = [put_corners(everywhere)._replace(ids=np.array([index])) for index in range(len(errors_px))]
        return calibrate_lens(views, 960, 540), used

    return run


def test_a_lens_is_good_up_to_the_limits_of_its_errors(judge):
    good = [1.0] * 9
    for changes, word in (
        ({"rms_px": 0.5}, None), ({"rms_px": 0.51}, "error 0.51 px rms is above 0.5 px"),
        ({"focal_error": 0.003}, None), ({"focal_error": 0.0031}, "known to 0.31 % only"),
        ({"tilts_rad": (0.26,) * 4}, None), ({"tilts_rad": (0.26,) * 3 + (0.24,) * 9}, "hardly tilted"),
    ):  # fmt: skip
        problems = judge(good, **changes)[0].problems
        assert len(problems) == (word is not None) and (word or "") in "".join(problems), changes
    both = judge(good, tilts_rad=(0.0,) * 9, focal_error=0.1)[0].problems
    assert len(both) == 1 and "tilted by 30 to 45 degrees" in both[0], "one remedy for both"
    assert judge(good, focal_error=0.002)[0].focal_error == 0.002


def test_an_image_three_times_as_wrong_as_the_median_is_left_out(judge):
    for worst, left_out in ((2.9, []), (3.1, [2])):
        found, used = judge([1.0, 1.0, worst, *[1.0] * 6])
        assert found.left_out == left_out and len(used) == 1 + len(left_out)
        assert used[-1] == [index for index in range(9) if index not in left_out]
    found, used = judge([1.0, 1.0, 9.0, *[1.0] * 5])
    assert found.left_out == [] and used == [list(range(8))], "eight are needed"


def test_eight_views_are_enough(judge):
    assert judge([1.0] * 8)[0].problems == []
    with pytest.raises(CalibrationError, match="found in 7 images; it takes 8"):
        judge([1.0] * 7)


def test_the_focal_error_is_that_of_the_jackknife(monkeypatch):
    """Of means of numbers, for which the jackknife gives the standard error itself."""
    random = np.random.RandomState(3)
    values = random.normal(700.0, 5.0, (6, 2))
    views = [BoardView(np.array([index]), value) for index, value in enumerate(values)]

    def fit(others, width_px, height_px, model, guess):
        matrix = np.diag((*np.mean([view.pixels for view in others], axis=0), 1.0))
        return lens_calibration._Fit(Intrinsics(960, 540, matrix, np.zeros(5)), 0.1, np.ones(1), np.ones(1))

    monkeypatch.setattr(lens_calibration, "_fit", fit)
    whole = fit(views, 960, 540, "plumb_bob", None)
    errors = values.std(axis=0, ddof=1) / np.sqrt(6.0) / values.mean(axis=0)
    found = lens_calibration._measure_focal_error(views, whole)
    assert found == pytest.approx(errors.max(), rel=1e-6)


@pytest.mark.slow
def test_images_that_no_lens_explains_are_refused():
    views = [BoardView(np.arange(12), np.zeros((12, 2), np.float32)) for _ in range(8)]
    with pytest.raises(CalibrationError, match="no lens explains these images"):
        calibrate(views)


def test_twelve_corners_make_a_view(monkeypatch):
    monkeypatch.setattr(boards, "COLUMNS", 4)
    monkeypatch.setattr(boards, "ROWS", 5)
    printed = np.pad(draw_board(60), 60, constant_values=255)
    view = find_board(printed)
    assert sorted(view.ids) == list(range(12))
    # Pixels have their centers at whole numbers, corners lie between.
    expected = (list_board_corners()[:, :2] / SQUARE_M + 1.0) * 60.0 - 0.5
    np.testing.assert_allclose(view.pixels, expected[view.ids], atol=0.1)
    printed[:180, :180] = 255
    assert find_board(printed) is None, "eleven or fewer"


def test_a_board_is_that_of_the_print():
    assert (COLUMNS, ROWS, SQUARE_M, boards.MARKER_M) == (9, 7, 0.025, 0.0185)
    corners_m = list_board_corners()
    x_m, y_m = np.meshgrid(np.arange(1, 9) * 0.025, np.arange(1, 7) * 0.025)
    # Versions of OpenCV begin at the upper or at the lower left.
    ordered_m = corners_m[np.lexsort((corners_m[:, 0].round(4), corners_m[:, 1].round(4)))]
    np.testing.assert_allclose(ordered_m, np.column_stack((x_m.ravel(), y_m.ravel(), np.zeros(48))), atol=1e-7)
    drawn = draw_board(40)
    assert drawn.shape == (280, 360) and drawn[2, 2] == 0 and drawn[2, 42] == 255 == drawn[42, 2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "distortion", "seed"),
    [
        ("rational_polynomial", (0.2, 0.05, 0.0005, -0.0003, 0.001, 0.45, 0.1, 0.005), 0),
        ("rational_polynomial", (-0.1, 0.02, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0), 0),
        ("rational_polynomial", (-0.1, 0.02, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0), 6),  # plumb_bob's focal length is far off
        ("rational_polynomial", (-0.1, 0.02, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0), 18),
        ("equidistant", (-0.03, 0.005, -0.003, 0.0005), 0),
    ],
)
def test_wide_lenses_are_calibrated_by_the_model_that_explains_them(model, distortion, seed):
    matrix = (350.0, 0.0, 474.0, 0.0, 349.0, 276.0, 0.0, 0.0, 1.0)
    lens = Intrinsics.from_camera_info(960, 540, matrix, model, distortion)
    random, views, reach = np.random.RandomState(seed), [], 2.0 if model == "equidistant" else 1.0
    center_m = np.array((COLUMNS * SQUARE_M / 2.0, ROWS * SQUARE_M / 2.0, 0.0))
    while len(views) < 16:
        turn, depth_m = random.uniform(-0.6, 0.6, 3), random.uniform(0.15, 0.3)
        at_m = depth_m * np.array((*reach * random.uniform((-1.2, -0.7), (1.2, 0.7)), 1.0))
        points_m = (list_board_corners() - center_m) @ cv2.Rodrigues(turn)[0].T + at_m
        if points_m[:, 2].min() < 0.05:
            continue
        pixels = lens.distort(points_m[:, :2] / points_m[:, 2:])
        inside = np.flatnonzero(((pixels > 0) & (pixels < (960, 540))).all(axis=1))
        if len(inside) > 30:
            noisy = pixels[inside] + random.normal(0.0, 0.1, (len(inside), 2))
            views.append(BoardView(inside, noisy.astype(np.float32)))
    found = lens_calibration._choose_fit(views, 960, 540)
    assert found.rms_px < 0.15 and found.lens.model == model
    rays = np.column_stack([axis.ravel() for axis in np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-0.6, 0.6, 7))])
    assert np.abs(found.lens.distort(rays) - lens.distort(rays)).max() < 2.5, (
        "a shift of the image is one of the camera"
    )
