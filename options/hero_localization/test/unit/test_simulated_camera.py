"""The simulated camera: where things appear in its images, and what spoils them."""

import itertools
import math

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2")

from hero_localization.errors import LocalizationError, SettingsError  # noqa: E402 - without OpenCV there is no camera
from hero_localization.prints.tag_images import draw_tag  # noqa: E402 - without OpenCV there is no camera
from hero_localization.simulated_camera.renderer import CameraRenderer  # noqa: E402
from hero_localization.simulated_camera.view import (  # noqa: E402  # noqa: E402
    CameraOptions,
    PrintedTag,
    describe_references,
    find_part,
    hang_above,
    list_frames,
    list_rays,
    list_references,
    list_seen,
    plane_homography,
    tag_corners,
    write_camera_file,
)
from hero_localization.tracking import settings as camera_file  # noqa: E402
from hero_sim.world import build_default, load_arena  # noqa: E402
from hero_sim.world.arena import build_rectangle  # noqa: E402
from hero_test.nonempty import nonempty  # noqa: E402

SMALL = CameraOptions(
    width_px=640,
    height_px=360,
    focal_px=(463.0, 463.0),
    center_px=(316.0, 184.0),
    blur_px=0.5,
    noise=0.0,
    light_gradient=0.0,
)
ARENA = build_rectangle(2.4, 1.3, 0)
TAG = PrintedTag(3, size_m=0.048)


def render(poses, tags=(TAG,), options=SMALL, seed=0, floor_tags=(), **given):
    return CameraRenderer(options, ARENA, tags, floor_tags, seed).render(np.array(poses), **given)


def shade_at(image, view, point_m):
    u, v = np.rint(view.project(np.array(point_m))).astype(int)
    return int(image[v, u])


def read_cells(image, view, tag, pose):
    """Return the cells of a tag as the image shows them."""
    upper_left, upper_right, _, lower_left = tag_corners(tag, np.array([pose]))[0]
    count = len(draw_tag(tag.family, tag.tag_id))
    shares = (np.arange(count) + 0.5) / count
    return np.array(
        [
            [
                shade_at(
                    image,
                    view,
                    upper_left + right * (upper_right - upper_left) + down * (lower_left - upper_left),
                )
                for right in shares
            ]
            for down in shares
        ]
    )


def test_tags_are_upright_as_in_apriltags_own_pictures():
    """Tag 0 of 36h11: the data cells' first row; OpenCV 4 draws it turned by 180 degrees."""
    assert (draw_tag("36h11", 0)[1, 1:-1] > 0).tolist() == [True, True, False, True, False, True]
    assert (draw_tag("16h5", 0)[1, 1:-1] > 0).tolist() == [False, False, True, False]


@pytest.mark.parametrize(("family", "tag_id"), [("36h11", 587), ("16h5", 30), ("16h5", -1)])
def test_tags_that_do_not_exist_are_refused(family, tag_id):
    with pytest.raises(LocalizationError, match=family):
        draw_tag(family, tag_id)


@pytest.mark.slow
def test_picture_shows_every_cell_of_robots_tags_at_their_places():
    sharp = SMALL._replace(width_px=1920, height_px=1080, focal_px=(1390.0, 1390.0), center_px=(948.0, 551.0))
    poses = [(0.0, 0.0, 0.0), (0.9, -0.4, 2.0), (-0.7, 0.4, -1.0), (0.1, 0.1, 0.0), (0.8, -0.3, 2.0), (-0.6, 0.3, -1.0)]
    mounted = TAG._replace(x_m=0.006, y_m=-0.004, yaw_rad=0.4)
    tags = [mounted._replace(family=family, tag_id=tag_id) for family in ("36h11", "16h5") for tag_id in (3, 4, 5)]
    image = render(poses, tags, sharp)
    for tag, pose in zip(tags, poses):
        cells = draw_tag(tag.family, tag.tag_id) > 0
        assert ((read_cells(image, sharp.geometry, tag, pose) > 120) == cells).all(), (tag, pose)


def test_tags_height_moves_it_away_from_the_axis_of_the_camera():
    view = SMALL._replace(tilt_rad=(0.0, 0.0, 0.0), position_m=(0.0, 0.0, 2.2), distortion=(0.0,) * 5).geometry
    high, low = (
        view.project(tag_corners(TAG._replace(height_m=z), np.array([(1.0, 0.0, 0.0)])))[0] for z in (0.076, 0)
    )
    shift = (high - low).mean(axis=0)
    assert shift[0] == pytest.approx(463.0 * (1.0 / (2.2 - 0.076) - 1.0 / 2.2), abs=0.01)
    assert abs(shift[1]) < 0.01


def test_distortion_bends_lines_at_the_rim_as_opencvs_model_does():
    view = SMALL.geometry
    rays = list_rays(view.lens)
    plane = np.dstack((rays, np.ones(rays.shape[:2]))) @ plane_homography(view, 0.05).T
    points_m = np.dstack((plane[..., :2] / plane[..., 2:], np.full(rays.shape[:2], 0.05)))
    pixels = view.project(points_m[::40, ::40])
    u, v = np.meshgrid(np.arange(0, 640, 40), np.arange(0, 360, 40))
    assert np.abs(pixels - np.dstack((u, v))).max() < 0.01


@pytest.mark.slow
def test_floor_tags_lie_on_the_floor_and_robots_hide_them():
    floor_tag = PrintedTag(7, 0.1, 0.0, 0.5, 0.2, 0.3)
    away, above = (
        render([(-0.8, -0.3, 0.0)], floor_tags=[floor_tag]),
        render([(0.5, 0.2, 0.0)], floor_tags=[floor_tag]),
    )
    cells = draw_tag("36h11", 7) > 0
    assert ((read_cells(away, SMALL.geometry, floor_tag, (0.0, 0.0, 0.0)) > 120) == cells).all()
    assert ((read_cells(above, SMALL.geometry, floor_tag, (0.0, 0.0, 0.0)) > 120) != cells).any()


def test_moving_robot_smears_along_its_motion_only():
    still, smeared = (
        render([(0.0, 0.0, 0.0)], options=SMALL._replace(exposure_s=0.08), speeds=np.array([(speed, 0.0)]))
        for speed in (0.0, 0.2)
    )
    steepest = [
        [np.abs(np.diff(picture.astype(int), axis=axis)).max() for axis in (0, 1)] for picture in (still, smeared)
    ]
    (still_down, still_across), (smeared_down, smeared_across) = steepest
    assert smeared_across < 0.8 * still_across
    assert smeared_down > 0.85 * still_down


def test_noise_has_the_deviation_given_and_differs_between_frames():
    renderer = CameraRenderer(SMALL._replace(noise=4.0), ARENA, [TAG])
    first, second = (renderer.render(np.array([(0.0, 0.0, 0.0)])).astype(float) for _ in range(2))
    assert (first - second).std() == pytest.approx(4.0 * math.sqrt(2.0), rel=0.05)


@pytest.mark.slow
def test_hand_covers_what_lies_below_it():
    pose = np.array([(0.1, 0.1, 0.0)])
    center = (0.1, 0.1, 0.076)
    assert shade_at(render(pose, hand_m=(0.1, 0.1)), SMALL.geometry, center) == pytest.approx(185, abs=2)
    assert (render(pose, hand_m=(-0.6, 0.1)) != render(pose)).any()


@pytest.mark.slow
def test_same_seed_gives_the_same_bytes_and_another_seed_others():
    options = SMALL._replace(noise=3.0)
    first, again, other = (render([(0.3, 0.2, 1.0)], options=options, seed=seed) for seed in (1, 1, 2))
    assert (first == again).all() and (first != other).any()


@pytest.mark.slow
def test_robots_out_of_the_picture_leave_it_as_it_is():
    empty = render(np.empty((0, 3)), ())
    for pose in ((5.0, 0.0, 0.0), (-5.0, 0.0, 0.0), (0.0, 5.0, 0.0), (0.0, -5.0, 0.0)):
        assert (render([pose]) == empty).all(), pose


def test_frames_arrive_late_in_order_and_some_never():
    options = CameraOptions(rate_hz=20.0, delay_s=0.06, delay_jitter_s=0.08, dropped_share=0.1)
    frames = list(itertools.islice(list_frames(options, 5.0, seed=3), 900))
    stamps_s, arrivals_s = np.array(frames).T
    assert stamps_s[0] >= 5.0
    assert 900.0 / ((stamps_s[-1] - 5.0) * 20.0 + 1.0) == pytest.approx(0.9, abs=0.03)
    assert (np.diff(arrivals_s) >= 0.0).all()
    delays_s = arrivals_s - stamps_s
    assert delays_s.min() >= 0.06 and delays_s.max() <= 0.14 + 1e-9
    assert frames == list(itertools.islice(list_frames(options, 5.0, seed=3), 900))


@pytest.mark.parametrize(
    "arena", [load_arena("empty"), load_arena("maze"), build_default(20), build_rectangle(0.5, 3.0, 1)]
)
def test_camera_hangs_so_high_that_no_reference_tag_is_cut_off(arena):
    references = list_references(arena)
    camera = hang_above(CameraOptions(), arena, references, 0.04)
    corners = camera.geometry.project(np.vstack([tag_corners(tag, np.zeros((1, 3)))[0] for tag in references]))
    assert (corners > 10.0).all() and (corners < np.array((1910.0, 1070.0))).all()
    assert camera.position_m[2] < 5.0


def test_camera_above_a_small_arena_hangs_at_its_usual_height():
    arena = build_default(4)
    camera = hang_above(CameraOptions(), arena, list_references(arena), 0.04)
    assert camera.position_m == CameraOptions().position_m


def test_arena_that_is_too_large_for_the_camera_is_refused():
    arena = build_rectangle(8.0, 6.0, 1)
    with pytest.raises(SettingsError, match="8.0 x 6.0 m, tags of 40 mm measure less than 12 px: take"):
        hang_above(CameraOptions(), arena, list_references(arena), 0.04)


def test_written_camera_file_holds_the_view_and_the_tags(tmp_path):
    references = list_references(ARENA)
    path = str(tmp_path / "camera.yaml")
    write_camera_file(path, SMALL.geometry, [TAG._replace(x_m=np.float64(0.002))], references)
    settings = camera_file.load(path)
    points_m = np.array([(0.3, 0.2, 0.076), (-1.0, 0.5, 0.0)])
    assert np.abs(settings.camera.project(points_m) - SMALL.geometry.project(points_m)).max() < 1e-6
    assert settings.layout.mounts[3].x_m == 0.002 and settings.layout.size_m == 0.048
    assert sorted(settings.seen_references) == sorted(settings.layout.references) == list(range(100, 106))


STRAIGHT = SMALL._replace(
    tilt_rad=(0.0, 0.0, 0.0), position_m=(0.0, 0.0, 2.2), distortion=(0.0,) * 5, center_px=(320.0, 180.0), blur_px=0.0
)
"""Looks straight down without distortion: 463 px by the depth in m."""


def find_spot(spots):
    """Return center and area of pixels by their weights (H, W), px."""
    rows, columns = np.indices(spots.shape)
    return np.array(((columns * spots).sum(), (rows * spots).sum())) / spots.sum(), float(spots.sum())


def test_everything_has_its_own_shade_and_solids_their_height():
    circle, post = (-0.6, 0.3, 0.15), np.array([(0.5, -0.5), (0.8, -0.5), (0.8, -0.2), (0.5, -0.2)])
    arena = ARENA._replace(circles_m=np.array([circle]), polygons_m=(post,))
    renderer, view = CameraRenderer(STRAIGHT, arena, (None,), [PrintedTag(7, 0.12, 0.0, 0.1, 0.4)]), STRAIGHT.geometry
    image = renderer.render(np.array([(-0.3, -0.3, 0.0)]))

    def shade(*point_m):
        return shade_at(image, view, point_m)

    assert shade(-0.6, 0.3, 0.05) == shade(0.65, -0.35, 0.05) == 60, "obstacles"
    assert shade(-0.3, -0.3, 0.076) == 45, "a robot without a tag"
    assert shade(0.1 - 0.053, 0.4, 0.0) == 25 and shade(0.1, 0.4 + 0.06 + 0.022, 0.0) == 225, "print and sheet"
    assert abs(np.median(image) - 150.0) < 3.0, "floor"
    # Tops are seen further from the axis than the floor under them, by 2.3 %.
    for x_m, edge_m in ((0.8, 463.0 * 0.8 / 2.15), (-0.75, -463.0 * 0.75 / 2.15)):
        row = image[180 + round(463.0 * 0.35 / 2.15)] if x_m > 0.0 else image[180 - round(463.0 * 0.3 / 2.15)]
        inner, outer = (round(320 + edge_m + sign * 2.5) for sign in (-1, 1))
        assert {int(row[inner]), int(row[outer])} >= {60} and max(row[inner], row[outer]) > 130, x_m
    wall = image[180, 560:640] < 110
    assert 320 + 463.0 * 1.2 / 2.2 - 1 < 560 + np.flatnonzero(wall)[0] < 320 + 463.0 * 1.2 / 2.2 + 2
    assert wall.sum() == pytest.approx(463.0 * 1.2 * (1.0 / 2.15 - 1.0 / 2.2), abs=2.5)


@pytest.mark.slow
def test_a_robots_top_is_a_disc_round_its_center_wherever_its_tag_sits():
    for tag, pose in (
        (TAG._replace(x_m=0.008, y_m=-0.006, yaw_rad=0.5), (0.3, -0.2, 1.0)),
        (TAG._replace(size_m=0.03, x_m=-0.009, y_m=0.004, yaw_rad=-2.0), (-0.5, 0.4, -2.5)),
    ):
        sharp = STRAIGHT._replace(width_px=960, height_px=540, focal_px=(694.5, 694.5), center_px=(480.0, 270.0))
        with_top, body = (render([pose], (one,), sharp).astype(float) for one in (tag, None))
        # All of the top differs from the body but the black of the print; a filled hull has no holes.
        top = np.zeros(body.shape, np.uint8)
        points = np.argwhere(np.abs(with_top - body) > 60.0)[:, ::-1].astype(np.int32)
        cv2.fillConvexPoly(top, cv2.convexHull(points), 1)
        center_px, area_px = find_spot(top)
        expected_px = sharp.geometry.project(np.array((pose[0], pose[1], tag.height_m)))
        assert center_px == pytest.approx(expected_px, abs=0.6)
        radius_px = 0.036835 * 694.5 / (2.2 - tag.height_m)
        assert area_px == pytest.approx(math.pi * radius_px**2, rel=0.12)


def test_light_falls_off_mostly_to_the_right_and_on_robots_too():
    image = render(np.empty((0, 3)), (), STRAIGHT._replace(light_gradient=0.4)).astype(float)
    bright = image[:12, :12].mean()
    assert image[:12, -12:].mean() / bright == pytest.approx(1.0 - 0.4 * 0.7, abs=0.03)
    assert image[-12:, :12].mean() / bright == pytest.approx(1.0 - 0.4 * 0.3, abs=0.03)
    options = STRAIGHT._replace(light_gradient=0.8)
    left, right = (render([(x_m, 0.0, 0.0)], (TAG,), options).astype(float) for x_m in (-1.0, 1.0))
    tops = [image[180, 310 + offset : 330 + offset].max() for image, offset in ((left, -218), (right, 218))]
    share = [1.0 - 0.8 * (0.7 * (320 + offset) / 640 + 0.15) for offset in (-218, 218)]
    assert tops[1] / tops[0] == pytest.approx(share[1] / share[0], abs=0.04)


@pytest.mark.slow
def test_blur_widens_edges_of_walls_and_prints():
    steepest = []
    for blur_px in (0.0, 1.0, 2.0):
        image = render([(0.0, 0.0, 0.0)], options=STRAIGHT._replace(blur_px=blur_px)).astype(int)
        steps = np.abs(np.diff(image, axis=1))
        steepest.append((steps[180, 560:600].max(), steps[150:210, 290:350].max()))
    for sharp, soft in nonempty(zip(steepest, steepest[1:])):
        assert soft[0] < 0.75 * sharp[0] and soft[1] < 0.9 * sharp[1]


def test_the_poses_of_an_exposure_lie_on_the_arc_round_its_middle():
    renderer = CameraRenderer(STRAIGHT._replace(exposure_s=0.05), ARENA, (TAG,))
    pose = np.array((0.3, 0.2, 0.5))
    assert renderer._list_moments(pose, 0.0, 0.0).tolist() == [pose.tolist()]
    moments = renderer._list_moments(pose, 0.2, 1.0)
    pixel_m, moved_m = 2.2 / 463.0, (0.2 + 0.03) * 0.05
    assert len(moments) == 1 + math.ceil(2.0 * moved_m / pixel_m - 0.1) == 6
    times_s = (np.arange(6) - 2.5) / 6.0 * 0.05
    assert moments[:, 2] == pytest.approx(0.5 + times_s)
    for (x_m, y_m, _), time_s in zip(moments, times_s):
        chord_m, angle_rad = 0.2 * time_s, 0.5 + time_s / 2.0
        assert (x_m, y_m) == pytest.approx((0.3 + chord_m * math.cos(angle_rad), 0.2 + chord_m * math.sin(angle_rad)))
    assert len(renderer._list_moments(pose, -2.0, 0.0)) == 8, "no more, however fast"
    assert len(renderer._list_moments(pose, 0.0, -6.0)) == 1 + math.ceil(2.0 * 0.03 * 6.0 * 0.05 / pixel_m - 0.1)


def test_noise_is_centered_and_never_repeats_in_place():
    renderer = CameraRenderer(STRAIGHT._replace(noise=3.0), ARENA, ())
    still = render(np.empty((0, 3)), (), STRAIGHT).astype(float)
    noise = [renderer.render(np.empty((0, 3))).astype(float) - still for _ in range(6)]
    assert max(abs(field.mean()) for field in noise) < 0.2
    for index, field in enumerate(noise):
        assert field.std() == pytest.approx(3.0, rel=0.05)
        assert all((field != other).mean() > 0.5 for other in noise[:index])


def test_reference_tags_lie_beside_the_arena_and_are_described_by_place():
    arena = build_rectangle(2.0, 1.0, 1)
    arena = arena._replace(bounds_m=np.array([-0.5, 0.25, 1.5, 1.25]))
    tags = list_references(arena)
    assert [(tag.tag_id, tag.x_m, tag.y_m) for tag in tags] == [
        (100, -0.62, 0.35), (101, -0.62, 0.75), (102, -0.62, 1.15),
        (103, 1.62, 0.35), (104, 1.62, 0.75), (105, 1.62, 1.15),
    ]  # fmt: skip
    assert {(tag.size_m, tag.height_m, tag.yaw_rad) for tag in tags} == {(0.1, 0.0, 0.0)}
    assert describe_references(tags[:2]) == "references: {100: [-0.620, 0.350, 0], 101: [-0.620, 0.750, 0]}"


def test_two_cameras_overlap_and_see_five_references_each():
    arena = build_rectangle(3.0, 1.2, 1)
    tags = list_references(arena, 2)
    assert [(tag.tag_id, tag.x_m, tag.y_m) for tag in tags[6:]] == [(106, 0.0, -0.72), (107, 0.0, 0.72)]
    for number, ids, bounds_m in (
        (1, [100, 101, 102, 106, 107], (-1.5, -0.6, 0.2, 0.6)), (2, [103, 104, 105, 106, 107], (-0.2, -0.6, 1.5, 0.6)),
    ):  # fmt: skip
        part = find_part(arena, number, 2)
        assert part.bounds_m == pytest.approx(bounds_m)
        camera = hang_above(CameraOptions(), part, tags, 0.04)
        assert camera.position_m[2] == 2.2, "as high as above a small arena"
        assert [tag.tag_id for tag in list_seen(camera.geometry, tags)] == ids


def test_one_camera_sees_the_whole_arena_and_all_references():
    arena = build_rectangle(2.0, 1.0, 1)
    assert find_part(arena, 1, 1).bounds_m == pytest.approx(arena.bounds_m)
    tags = list_references(arena)
    assert list_seen(hang_above(CameraOptions(), arena, tags, 0.04).geometry, tags) == tags


def test_camera_hangs_over_the_middle_of_the_arena_as_high_as_it_must():
    arena = build_rectangle(4.0, 2.0, 1)._replace(bounds_m=np.array([1.0, 2.0, 5.0, 4.0]))
    references = list_references(arena)
    camera = hang_above(CameraOptions(), arena, references, 0.04)
    assert camera.position_m[:2] == pytest.approx((0.03 + 3.0, -0.02 + 3.0))
    lower = camera._replace(position_m=(*camera.position_m[:2], camera.position_m[2] - 0.05)).geometry
    sheets = [tag._replace(size_m=0.13) for tag in references]
    corners = np.vstack([tag_corners(tag, np.zeros((1, 3)))[0] for tag in sheets])
    for view, is_seen in ((camera.geometry, True), (lower, False)):
        pixels = view.project(corners)
        assert ((pixels >= 0.0) & (pixels <= (1919.0, 1079.0))).all() == is_seen


def in_tag(tag, x_m, y_m):
    """Return a place on the robot as seen from its tag: to the right and down in the upright print, m."""
    off_m = complex(x_m - tag.x_m, y_m - tag.y_m) * np.exp(-1j * tag.yaw_rad)
    return -off_m.imag, -off_m.real


def expect_shade(tag, cells, is_round, x_m, y_m):
    """Return the shade of a place on a plate, None beyond it."""
    right_m, down_m = in_tag(tag, x_m, y_m)
    cell_m = tag.size_m / len(cells)
    reach_m = max(abs(right_m), abs(down_m))
    if math.hypot(x_m, y_m) > 0.036835 if is_round else reach_m > tag.size_m / 2.0 + 2.0 * cell_m:
        return None
    if reach_m > tag.size_m / 2.0 + cell_m:
        return 205.0 if is_round else 225.0
    if reach_m > tag.size_m / 2.0:
        return 225.0
    row, column = (math.floor(place_m / cell_m + len(cells) / 2.0) for place_m in (down_m, right_m))
    return 225.0 if cells[row, column] else 25.0


@pytest.mark.parametrize("is_round", [True, False])
@pytest.mark.parametrize(("family", "size_m"), [("36h11", 0.03), ("16h5", 0.024)])
def test_a_plate_shows_print_margin_and_rim_each_at_its_place(is_round, family, size_m):
    tag = PrintedTag(3, size_m, 0.0, 0.005, -0.004, 0.7, family)
    near = STRAIGHT._replace(focal_px=(9000.0, 9000.0))
    plate = CameraRenderer(near, ARENA, ())._print_plate(tag, is_round)
    cells, count = draw_tag(family, 3), {}
    for x_m, y_m in np.random.RandomState(1).uniform(-0.048, 0.048, (1500, 2)):
        around = {
            expect_shade(tag, cells, is_round, x_m + dx_m, y_m + dy_m)
            for dx_m in (-0.0009, 0.0, 0.0009)
            for dy_m in (-0.0009, 0.0, 0.0009)
        }
        if len(around) > 1:
            continue  # at an edge
        (expected,) = around
        column, row, _ = np.rint(plate.to_texel @ (x_m, y_m, 1.0)).astype(int)
        inside = 0 <= row < len(plate.texture) and 0 <= column < len(plate.texture)
        shade, cover = plate.texture[row, column] if inside else (0.0, 0.0)
        assert (shade, cover) == pytest.approx((expected or 0.0, float(expected is not None)), abs=0.01), (x_m, y_m)
        count[expected] = count.get(expected, 0) + 1
    assert min(count.values()) > 15 and set(count) >= {None, 25.0, 225.0}
    far_m = 0.036835 + math.hypot(0.005, 0.004) if is_round else size_m / 2.0 + 2.0 * size_m / len(cells)
    assert plate.reach_m == pytest.approx(far_m + 0.004)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_camera_hangs_as_low_as_the_last_pixel_allows(axis):
    arena = build_rectangle(*((4.0, 1.0), (1.0, 3.0))[axis], 1)
    references = list_references(arena)
    camera = hang_above(CameraOptions(), arena, references, 0.04)
    sheets = [tag._replace(size_m=0.13) for tag in references]
    x_m, y_m = arena.bounds_m.reshape(2, 2).T
    tops_m = [(x, y, 0.076) for x in x_m for y in y_m]
    corners_m = np.vstack([tops_m, *(tag_corners(tag, np.zeros((1, 3)))[0] for tag in sheets)])
    last_px = float(camera.geometry.project(corners_m)[:, axis].max())
    name = ("width_px", "height_px")[axis]
    for size_px, is_enough in ((math.ceil(last_px) + 1, True), (math.ceil(last_px), False)):
        other = hang_above(CameraOptions()._replace(**{name: size_px}), arena, references, 0.04)
        assert (other.position_m == camera.position_m) == is_enough


def test_a_camera_file_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(SettingsError, match="camera.yaml cannot be read or written: "):
        write_camera_file(str(tmp_path / "file" / "camera.yaml"), SMALL.geometry, [TAG], [])


def test_light_falls_on_walls_and_hands_too():
    image = render(np.empty((0, 3)), (), STRAIGHT._replace(light_gradient=0.8), hand_m=(0.9, 0.0))
    for x_m, height_m, shade in ((-1.2, 0.025, 70.0), (1.2, 0.025, 70.0), (0.9, 0.25, 185.0)):
        u, v = STRAIGHT.geometry.project(np.array((x_m, 0.0, height_m)))  # of the middle
        light = 1.0 - 0.8 * (0.7 * u / 639.0 + 0.3 * v / 359.0)
        assert shade_at(image, STRAIGHT.geometry, (x_m, 0.02, height_m)) == pytest.approx(shade * light, abs=4.0), x_m


def test_plates_are_blurred_by_the_lens_however_little():
    textures = [
        CameraRenderer(STRAIGHT._replace(blur_px=blur_px), ARENA, ())._print_plate(TAG).texture[..., 0]
        for blur_px in (0.0, 0.5, 1.0)
    ]
    steps = [np.abs(np.diff(texture, axis=0)).max() for texture in textures]
    assert steps[0] > 1.02 * steps[1] > 1.1 * steps[2]
