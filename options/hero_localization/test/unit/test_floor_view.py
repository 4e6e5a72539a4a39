"""Views from above: places in the map are at their pixels, whichever way the camera looks."""

import numpy as np
import pytest
from test_camera_model import DISTORTION, MATRIX

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.errors import SettingsError
from hero_localization.tracking import floor_view
from hero_localization.tracking.floor_view import MAX_SIDE_PX, FloorView
from hero_localization.tracking.tag_pose import TagCorners
from hero_test.nonempty import nonempty

HEIGHT_M = 0.076


def hang_camera(tilt_rad, yaw_rad):
    """Return a camera above (0.1, -0.2) that looks down, tilted about its x axis, turned by yaw_rad."""
    (cos, sin), (cos_yaw, sin_yaw) = ((np.cos(angle), np.sin(angle)) for angle in (tilt_rad, yaw_rad))
    tilt = np.array(((1.0, 0.0, 0.0), (0.0, cos, -sin), (0.0, sin, cos)))
    turn = np.array(((cos_yaw, sin_yaw, 0.0), (-sin_yaw, cos_yaw, 0.0), (0.0, 0.0, 1.0)))
    lens = Intrinsics(1920, 1080, MATRIX, DISTORTION)
    return Camera(lens, tilt @ np.diag((1.0, -1.0, -1.0)) @ turn, np.array((0.1, -0.2, 2.2)))


@pytest.mark.parametrize(("tilt_rad", "yaw_rad"), [(0.0, 0.0), (0.2, 2.5), (-0.3, -1.2)])
def test_a_place_is_where_the_view_and_its_box_say(tilt_rad, yaw_rad):
    camera = hang_camera(tilt_rad, yaw_rad)
    view = FloorView(camera, HEIGHT_M)
    for u, v in ((955, 545), (300, 250), (1500, 900)):
        pixel = np.array((u, v), dtype=float)
        ((x_m, y_m),) = camera.intersect(pixel[None], HEIGHT_M)
        picture = np.zeros((1080, 1920), np.uint8)
        picture[v - 6 : v + 7, u - 6 : u + 7] = 255
        seen = view.rectify(picture)
        assert max(seen.shape) == MAX_SIDE_PX
        center = np.argwhere(seen > 127).mean(axis=0)[::-1]
        left_m, low_m, right_m, high_m = view.box_m
        height_px, width_px = seen.shape
        share = (center + 0.5) / (width_px, height_px)
        shown = (left_m + share[0] * (right_m - left_m), high_m - share[1] * (high_m - low_m))
        assert shown == pytest.approx((x_m, y_m), abs=0.004)
        assert view.find_pixels(pixel[None])[0] == pytest.approx(center, abs=2.0)


def test_the_box_holds_all_that_the_camera_sees_of_the_plane():
    camera = hang_camera(0.1, 0.7)
    left_m, low_m, right_m, high_m = FloorView(camera, HEIGHT_M).box_m
    corners = np.array(((0.0, 0.0), (1919.0, 0.0), (0.0, 1079.0), (1919.0, 1079.0)))
    x_m, y_m = camera.intersect(corners, HEIGHT_M).T
    assert (left_m, right_m) == pytest.approx((x_m.min(), x_m.max()), abs=0.02)
    assert (low_m, high_m) == pytest.approx((y_m.min(), y_m.max()), abs=0.02)


def test_a_camera_that_sees_to_the_horizon_has_a_view_of_limited_size():
    left_m, low_m, right_m, high_m = FloorView(hang_camera(1.3, 0.0), HEIGHT_M).box_m
    assert max(right_m - left_m, high_m - low_m) < 14.0


def test_a_camera_that_looks_up_is_refused():
    with pytest.raises(SettingsError, match="does not look at the floor"):
        FloorView(hang_camera(np.pi, 0.0), HEIGHT_M)


def test_tags_are_outlined_where_the_view_shows_them():
    view = FloorView(hang_camera(0.2, 2.5), HEIGHT_M)
    square = np.array(((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)))
    tags = [TagCorners(3, square + (500.0, 400.0)), TagCorners(7, square + (1400.0, 700.0))]
    seen = view.draw(np.zeros((1080, 1920), np.uint8), tags, {7})
    for tag, color in zip(tags, ((0, 200, 0), (0, 0, 255))):
        for column, row in nonempty(np.rint(view.find_pixels(tag.corners)).astype(int)):
            assert tuple(seen[row, column]) == color


def test_the_box_ends_at_the_middle_of_the_last_pixel():
    camera = hang_camera(0.1, 0.7)
    camera = camera._replace(lens=camera.lens._replace(distortion=np.zeros(5)))
    left_m, low_m, right_m, high_m = FloorView(camera, HEIGHT_M).box_m
    corners = np.array(((0.0, 0.0), (1919.0, 0.0), (0.0, 1079.0), (1919.0, 1079.0)))
    x_m, y_m = camera.intersect(corners, HEIGHT_M).T
    assert (left_m, low_m, right_m, high_m) == pytest.approx((x_m.min(), y_m.min(), x_m.max(), y_m.max()), abs=1e-9)


def test_the_box_holds_edges_that_a_lens_bends_outwards():
    camera = hang_camera(0.0, 0.0)
    camera = camera._replace(lens=camera.lens._replace(distortion=np.array((0.15, 0.0, 0.0, 0.0, 0.0))))
    middles = np.array(((960.0, 0.0), (960.0, 1079.0), (0.0, 540.0), (1919.0, 540.0)))
    x_m, y_m = camera.intersect(middles, HEIGHT_M).T
    box_m = FloorView(camera, HEIGHT_M).box_m
    assert box_m == pytest.approx((x_m.min(), y_m.min(), x_m.max(), y_m.max()), abs=0.003)


def test_a_camera_sees_three_of_its_heights_to_each_side():
    low_m, high_m = np.array(FloorView(hang_camera(1.3, 0.0), HEIGHT_M).box_m).reshape(2, 2)
    reach_m = np.maximum(np.abs(low_m - (0.1, -0.2)), np.abs(high_m - (0.1, -0.2)))
    assert reach_m == pytest.approx((6.6, 6.6))


def test_a_camera_that_looks_far_away_is_refused():
    with pytest.raises(SettingsError, match="does not look at the floor below it"):
        FloorView(hang_camera(1.75, 0.0), HEIGHT_M)


def test_a_view_is_black_where_the_camera_saw_nothing():
    view = FloorView(hang_camera(0.5, 0.4), HEIGHT_M)
    seen = view.rectify(np.full((1080, 1920), 255, np.uint8))
    rows, columns = np.indices(seen.shape)[:, ::40, ::40].reshape(2, -1)
    left_m, _, _, high_m = view.box_m
    scale = MAX_SIDE_PX / max(view.box_m[2] - left_m, high_m - view.box_m[1])
    places_m = (left_m + (columns + 0.5) / scale, high_m - (rows + 0.5) / scale, np.full(len(rows), HEIGHT_M))
    pixels = view.camera.project(np.column_stack(places_m))
    for row, column, (u, v) in nonempty(zip(rows, columns, pixels)):
        if 10.0 < u < 1910.0 and 10.0 < v < 1070.0:
            assert seen[row, column] == 255, (row, column)
        elif not (-30.0 < u < 1950.0 and -30.0 < v < 1110.0):
            assert seen[row, column] == 0, (row, column)


def test_a_tag_is_drawn_with_its_front_and_number(monkeypatch):
    drawn = []
    for name in ("polylines", "line", "putText"):
        monkeypatch.setattr(floor_view.cv2, name, lambda image, *given, name=name: drawn.append((name, given)))
    view = FloorView(hang_camera(0.0, 0.0), HEIGHT_M)
    square = np.array(((880.0, 380.0), (920.0, 380.0), (920.0, 420.0), (880.0, 420.0)))
    nowhere = TagCorners(4, np.full((4, 2), np.nan))
    view.draw(np.zeros((1080, 1920), np.uint8), [nowhere, TagCorners(17, square)], set())
    (_, (outline, is_closed, *look)), (_, (start, end, *_)), (_, (text, place, _, size, *_)) = drawn
    corners = view.find_pixels(square)
    np.testing.assert_array_equal(outline[0], np.rint(corners))
    assert is_closed and look == [(0, 200, 0), 2]
    assert start == pytest.approx(corners.mean(axis=0), abs=0.51)
    assert end == pytest.approx(corners[:2].mean(axis=0), abs=0.51)
    assert (text, place, size) == ("17", (start[0] + 12, start[1] - 12), 0.7)
