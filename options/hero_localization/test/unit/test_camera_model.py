"""The camera model: known pixels, round trips, planes at a height, wrong camera information."""

import numpy as np
import pytest

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.errors import CalibrationError

MATRIX = np.array(((1390.0, 0.0, 955.0), (0.0, 1385.0, 545.0), (0.0, 0.0, 1.0)))
DISTORTION = np.array((-0.12, 0.03, 0.0008, -0.0006, -0.002))
DOWN = np.diag((1.0, -1.0, -1.0))
"""Map's x axis to the right of the image, its y axis up."""


def overhead(distortion=DISTORTION, tilt_rad=0.0):
    cos, sin = np.cos(tilt_rad), np.sin(tilt_rad)
    tilt = np.array(((1.0, 0.0, 0.0), (0.0, cos, -sin), (0.0, sin, cos)))
    return Camera(Intrinsics(1920, 1080, MATRIX, distortion), tilt @ DOWN, np.array((0.1, -0.2, 2.2)))


def grid(height_m):
    x, y = np.meshgrid(np.linspace(-1.3, 1.5, 15), np.linspace(-0.9, 0.5, 9))
    return np.column_stack((x.ravel(), y.ravel(), np.full(x.size, height_m)))


def test_pinhole_gives_the_pixels_of_similar_triangles():
    camera = overhead(np.zeros(5))
    assert camera.project(np.array(((0.1, -0.2, 0.0),))) == pytest.approx(np.array(((955.0, 545.0),)))
    # One meter to the right and half a meter up in the map, seen from 2.2 m.
    seen = camera.project(np.array(((1.1, 0.3, 0.0),)))
    assert seen == pytest.approx(np.array(((955.0 + 1390.0 / 2.2, 545.0 - 1385.0 * 0.5 / 2.2),)))


def test_distortion_is_that_of_the_formula():
    # By hand: x = 0.4, y = 0, r2 = 0.16: radial = 1 - 0.12 * 0.16 + 0.03 * 0.0256 - 0.002 * 0.004096.
    seen = Intrinsics(1920, 1080, MATRIX, DISTORTION).distort(np.array(((0.4, 0.0),)))
    x = 0.4 * (1.0 - 0.0192 + 0.000768 - 8.192e-6) - 0.0006 * (0.16 + 2 * 0.16)
    assert seen == pytest.approx(np.array(((955.0 + 1390.0 * x, 545.0 + 1385.0 * 0.0008 * 0.16),)))


def test_projection_agrees_with_opencv():
    cv2 = pytest.importorskip("cv2")
    camera, points_m = overhead(tilt_rad=0.15), grid(0.076)
    rotation, _ = cv2.Rodrigues(camera.rotation)
    seen, _ = cv2.projectPoints(points_m, rotation, -camera.rotation @ camera.position_m, MATRIX, DISTORTION)
    assert np.abs(camera.project(points_m) - seen[:, 0]).max() < 1e-6


@pytest.mark.parametrize("tilt_rad", [0.0, 0.2, -0.35])
@pytest.mark.parametrize("height_m", [0.0, 0.076, 0.3])
def test_points_of_a_plane_are_found_again_from_their_pixels(tilt_rad, height_m):
    camera, points_m = overhead(tilt_rad=tilt_rad), grid(height_m)
    found_m = camera.intersect(camera.project(points_m), height_m)
    assert np.abs(found_m - points_m[:, :2]).max() < 1e-6


def test_a_tag_taken_for_lying_on_the_floor_is_52_mm_off():
    """76 mm high at 1.5 m from the axis: what a homography of the floor alone gets wrong."""
    camera = overhead(np.zeros(5))
    pixel = camera.project(np.array(((1.6, -0.2, 0.076),)))
    assert camera.intersect(pixel, 0.076) == pytest.approx(np.array(((1.6, -0.2),)))
    floor_m = camera.intersect(pixel, 0.0)
    assert floor_m[0, 0] - 1.6 == pytest.approx(1.5 * 0.076 / (2.2 - 0.076), abs=1e-9)


def test_what_a_camera_cannot_see_is_nan():
    camera = overhead()
    assert np.isnan(camera.project(np.array(((0.0, 0.0, 2.5),)))).all()
    upwards = camera._replace(rotation=np.eye(3))
    assert np.isnan(upwards.intersect(np.array(((900.0, 500.0),)), 0.0)).all()


def test_pixels_where_the_lens_folds_back_are_nan():
    lens = Intrinsics(1920, 1080, MATRIX, np.array((-0.5, 0.0, 0.0, 0.0, 0.0)))
    assert np.isnan(lens.undistort(np.array(((955.0 + 1390.0 * 0.8, 545.0),)))).all()


def test_each_pixel_may_have_a_height_of_its_own():
    camera = overhead()
    points_m = np.array(((0.5, 0.2, 0.0), (0.5, 0.2, 0.076), (-0.9, 0.4, 0.3)))
    found_m = camera.intersect(camera.project(points_m), points_m[:, 2])
    assert np.abs(found_m - points_m[:, :2]).max() < 1e-6


def test_lens_is_read_from_camera_information():
    lens = Intrinsics.from_camera_info(1920, 1080, MATRIX.ravel().tolist(), "plumb_bob", DISTORTION.tolist())
    assert (lens.matrix == MATRIX).all() and (lens.distortion == DISTORTION).all()
    assert (Intrinsics.from_camera_info(640, 480, MATRIX.ravel(), "", ()).distortion == 0.0).all()


@pytest.mark.parametrize(
    ("matrix", "model", "distortion", "words"),
    [
        ([0.0] * 9, "plumb_bob", [0.0] * 5, "not calibrated"),
        ([1.0] * 8, "plumb_bob", [0.0] * 5, "not calibrated"),
        (MATRIX.ravel(), "equidistant", [0.1] * 5, "equidistant"),
        (MATRIX.ravel(), "rational_polynomial", [0.1] * 12, "with 12"),
        (MATRIX.ravel(), "omnidirectional", [0.1] * 4, "'omnidirectional' with 4 numbers; known are: plumb_bob"),
        (MATRIX.ravel(), "plumb_bob", [float("nan")] * 5, "finite"),
    ],
)
def test_camera_information_that_does_not_fit_is_refused(matrix, model, distortion, words):
    with pytest.raises(ValueError, match=words):
        Intrinsics.from_camera_info(1920, 1080, matrix, model, distortion)


def test_images_of_another_size_are_refused():
    lens = Intrinsics(1920, 1080, MATRIX, DISTORTION)
    lens.check_size(1080, 1920)
    for height_px, width_px in ((1080, 1280), (720, 1920), (1920, 1080)):
        with pytest.raises(CalibrationError, match="images have %d x %d pixels, but" % (width_px, height_px)):
            lens.check_size(height_px, width_px)


def test_rays_of_a_skewed_sensor_are_found_again():
    matrix = MATRIX + ((0.0, 12.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    lens = Intrinsics(1920, 1080, matrix, DISTORTION)
    rays = np.array(((0.3, -0.2), (-0.5, 0.3), (0.0, 0.1)))
    np.testing.assert_allclose(lens.undistort(lens.distort(rays)), rays, atol=1e-9)
    flat = lens._replace(distortion=np.zeros(5)).distort(rays)
    expected = rays * (1390.0, 1385.0) + (955.0, 545.0)
    np.testing.assert_allclose(flat, expected + np.column_stack((12.0 * rays[:, 1], np.zeros(3))))


LENSES = {
    "plumb_bob": (-0.32, 0.11, 0.001, -0.0005, 0.0),
    "rational_polynomial": (0.2, 0.05, 0.0005, -0.0003, 0.001, 0.45, 0.1, 0.005),
    "equidistant": (-0.03, 0.005, -0.003, 0.0005),
}


@pytest.mark.parametrize("model", LENSES)
def test_all_models_bend_as_opencv_does_and_back(model):
    cv2 = pytest.importorskip("cv2")
    lens = Intrinsics.from_camera_info(1920, 1080, (700.0, 0, 955.0, 0, 698.0, 545.0, 0, 0, 1.0), model, LENSES[model])
    reach = 0.75 if model == "plumb_bob" else 1.2  # 53 degrees
    x, y = np.meshgrid(np.linspace(-reach, reach, 15), np.linspace(-reach / 2.0, reach / 2.0, 9))
    rays = np.column_stack((x.ravel(), y.ravel()))
    points = np.column_stack((rays, np.ones(len(rays)))).reshape(-1, 1, 3)
    project = cv2.fisheye.projectPoints if model == "equidistant" else cv2.projectPoints
    none = np.zeros((3, 1))
    bent = project(points, none, none, lens.matrix, lens.distortion)[0].reshape(-1, 2)
    np.testing.assert_allclose(lens.distort(rays), bent, atol=1e-6)
    np.testing.assert_allclose(lens.undistort(bent), rays, atol=1e-5)


def test_a_fisheye_shows_nothing_beyond_its_rim():
    lens = Intrinsics.from_camera_info(1920, 1080, (500.0, 0, 960.0, 0, 500.0, 540.0, 0, 0, 1.0), "fisheye", [0.0] * 4)
    assert lens.model == "equidistant"
    rays = lens.undistort(np.array(((960.0, 540.0), (1400.0, 540.0), (1900.0, 540.0))))
    assert rays[0] == pytest.approx((0.0, 0.0), abs=1e-9) and rays[1, 0] == pytest.approx(np.tan(0.88))
    assert np.isnan(rays[2]).all()
