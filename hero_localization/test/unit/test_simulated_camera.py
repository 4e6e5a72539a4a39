"""The simulated camera: where things appear in its images, and what spoils them."""

import itertools
import math
import sys

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2")

from hero_localization.errors import SettingsError  # noqa: E402 - without OpenCV there is no camera
from hero_localization.prints.tag_images import draw_tag  # noqa: E402 - without OpenCV there is no camera
from hero_localization.simulated_camera import camera_node  # noqa: E402
from hero_localization.simulated_camera.frame_times import list_frames  # noqa: E402
from hero_localization.simulated_camera.lab_setup import (  # noqa: E402
    hang_above,
    list_references,
    write_camera_file,
)
from hero_localization.simulated_camera.renderer import CameraRenderer  # noqa: E402
from hero_localization.simulated_camera.view import CameraOptions, PrintedTag, View, tag_corners  # noqa: E402
from hero_localization.tracking import settings as camera_file  # noqa: E402
from hero_sim.world.arena import build_default, build_rectangle  # noqa: E402
from hero_sim.world.arena_file import load_arena  # noqa: E402

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


@pytest.mark.parametrize(("family", "tag_id"), [("36h11", 587), ("16h5", 30), ("16h5", -1), ("25h9", 0)])
def test_tags_that_do_not_exist_are_refused(family, tag_id):
    with pytest.raises(ValueError, match=family):
        draw_tag(family, tag_id)


@pytest.mark.parametrize("family", ["36h11", "16h5"])
@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.9, -0.4, 2.0), (-0.7, 0.4, -1.0)])
def test_picture_shows_every_cell_of_a_robots_tag_at_its_place(family, pose):
    sharp = SMALL._replace(width_px=1920, height_px=1080, focal_px=(1390.0, 1390.0), center_px=(948.0, 551.0))
    tag = TAG._replace(family=family, x_m=0.006, y_m=-0.004, yaw_rad=0.4)
    image = render([pose], (tag,), sharp)
    cells = draw_tag(family, tag.tag_id) > 0
    assert ((read_cells(image, View(sharp), tag, pose) > 120) == cells).all()


def test_tags_height_moves_it_away_from_the_axis_of_the_camera():
    view = View(SMALL._replace(tilt_rad=(0.0, 0.0, 0.0), position_m=(0.0, 0.0, 2.2), distortion=(0.0,) * 5))
    high, low = (
        view.project(tag_corners(TAG._replace(height_m=z), np.array([(1.0, 0.0, 0.0)])))[0]
        for z in (0.076, 0)
    )
    shift = (high - low).mean(axis=0)
    assert shift[0] == pytest.approx(463.0 * (1.0 / (2.2 - 0.076) - 1.0 / 2.2), abs=0.01)
    assert abs(shift[1]) < 0.01


def test_distortion_bends_lines_at_the_rim_as_opencvs_model_does():
    view = View(SMALL)
    rays = view.list_rays(SMALL.width_px, SMALL.height_px)
    plane = np.dstack((rays, np.ones(rays.shape[:2]))) @ view.plane_homography(0.05).T
    points_m = np.dstack((plane[..., :2] / plane[..., 2:], np.full(rays.shape[:2], 0.05)))
    pixels = view.project(points_m[::40, ::40])
    u, v = np.meshgrid(np.arange(0, 640, 40), np.arange(0, 360, 40))
    assert np.abs(pixels - np.dstack((u, v))).max() < 0.01


def test_floor_tags_lie_on_the_floor_and_robots_hide_them():
    floor_tag = PrintedTag(7, 0.1, 0.0, 0.5, 0.2, 0.3)
    away, above = (
        render([(-0.8, -0.3, 0.0)], floor_tags=[floor_tag]),
        render([(0.5, 0.2, 0.0)], floor_tags=[floor_tag]),
    )
    cells = draw_tag("36h11", 7) > 0
    assert ((read_cells(away, View(SMALL), floor_tag, (0.0, 0.0, 0.0)) > 120) == cells).all()
    assert ((read_cells(above, View(SMALL), floor_tag, (0.0, 0.0, 0.0)) > 120) != cells).any()


def test_robot_without_a_tag_shows_only_its_body():
    assert shade_at(render([(0.2, 0.1, 0.0)], (None,)), View(SMALL), (0.2, 0.1, 0.076)) < 60


def test_walls_are_darker_than_the_floor():
    image = render(np.empty((0, 3)), ())
    assert shade_at(image, View(SMALL), (1.2, 0.0, 0.0)) < 90 < shade_at(image, View(SMALL), (1.0, 0.0, 0.0))


def test_moving_robot_smears_along_its_motion_only():
    still, smeared = (
        render([(0.0, 0.0, 0.0)], options=SMALL._replace(exposure_s=0.08), speeds=np.array([(speed, 0.0)]))
        for speed in (0.0, 0.2)
    )
    steepest = [
        [np.abs(np.diff(picture.astype(int), axis=axis)).max() for axis in (0, 1)]
        for picture in (still, smeared)
    ]
    (still_down, still_across), (smeared_down, smeared_across) = steepest
    assert smeared_across < 0.8 * still_across
    assert smeared_down > 0.85 * still_down


def test_blurred_motion_is_centered_on_the_pose_given():
    poses, options = [(0.1, 0.1, 0.7)], SMALL._replace(exposure_s=0.08)
    weights = []
    for speed in (0.0, 0.2):
        seen = render(poses, options=options, speeds=np.array([(speed, 0.0)])).astype(float)
        empty = render(np.empty((0, 3)), (), options).astype(float)
        # The body itself is not smeared: what the top adds to it is compared.
        difference = (seen - empty)[120:210, 280:390].clip(0.0)
        rows, columns = np.indices(difference.shape)
        weights.append(np.array(((rows * difference).sum(), (columns * difference).sum())) / difference.sum())
    assert np.abs(weights[0] - weights[1]).max() < 0.35


def test_light_falls_off_by_the_share_given():
    image = render(np.empty((0, 3)), (), SMALL._replace(light_gradient=0.5))
    assert image[-10:, -10:].mean() / image[:10, :10].mean() == pytest.approx(0.5, abs=0.05)


def test_noise_has_the_deviation_given_and_differs_between_frames():
    renderer = CameraRenderer(SMALL._replace(noise=4.0), ARENA, [TAG])
    first, second = (renderer.render(np.array([(0.0, 0.0, 0.0)])).astype(float) for _ in range(2))
    assert (first - second).std() == pytest.approx(4.0 * math.sqrt(2.0), rel=0.05)


def test_hand_covers_what_lies_below_it():
    pose = np.array([(0.1, 0.1, 0.0)])
    center = (0.1, 0.1, 0.076)
    assert shade_at(render(pose, hand_m=(0.1, 0.1)), View(SMALL), center) == pytest.approx(185, abs=2)
    assert (render(pose, hand_m=(-0.6, 0.1)) != render(pose)).any()


def test_same_seed_gives_the_same_bytes_and_another_seed_others():
    options = SMALL._replace(noise=3.0)
    first, again, other = (render([(0.3, 0.2, 1.0)], options=options, seed=seed) for seed in (1, 1, 2))
    assert (first == again).all() and (first != other).any()


def test_robots_out_of_the_picture_leave_it_as_it_is():
    empty = render(np.empty((0, 3)), ())
    assert (render([(5.0, 0.0, 0.0)]) == empty).all()


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


def test_wrong_ids_are_reported_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["simulated_camera", "--first-id", "200"])
    with pytest.raises(SystemExit) as end:
        camera_node.main()
    assert end.value.code == 1
    assert capsys.readouterr().err == "simulated_camera: tags from 100 on are reference tags: take lower ids\n"


@pytest.mark.parametrize(
    "arena", [load_arena("empty"), load_arena("maze"), build_default(20), build_rectangle(0.5, 3.0, 1)]
)
def test_camera_hangs_so_high_that_no_reference_tag_is_cut_off(arena):
    references = list_references(arena, "36h11")
    camera = hang_above(CameraOptions(), arena, references, 0.04)
    corners = View(camera).project(np.vstack([tag_corners(tag, np.zeros((1, 3)))[0] for tag in references]))
    assert (corners > 10.0).all() and (corners < np.array((1910.0, 1070.0))).all()
    assert camera.position_m[2] < 5.0


def test_camera_above_a_small_arena_hangs_at_its_usual_height():
    arena = build_default(4)
    camera = hang_above(CameraOptions(), arena, list_references(arena, "36h11"), 0.04)
    assert camera.position_m == CameraOptions().position_m


def test_arena_that_is_too_large_for_the_camera_is_refused():
    arena = build_rectangle(8.0, 6.0, 1)
    with pytest.raises(SettingsError, match="8.0 x 6.0 m, tags of 40 mm measure less than 12 px: take"):
        hang_above(CameraOptions(), arena, list_references(arena, "36h11"), 0.04)


def test_written_camera_file_holds_the_view_and_the_tags(tmp_path):
    references = list_references(ARENA, "36h11")
    path = str(tmp_path / "camera.yaml")
    write_camera_file(path, View(SMALL), SMALL, [TAG._replace(x_m=np.float64(0.002))], references)
    settings = camera_file.load(path)
    points_m = np.array([(0.3, 0.2, 0.076), (-1.0, 0.5, 0.0)])
    assert np.abs(settings.camera.project(points_m) - View(SMALL).project(points_m)).max() < 1e-6
    assert settings.layout.mounts[3].x_m == 0.002 and settings.layout.default_mount.size_m == 0.048
    assert sorted(settings.seen_references) == sorted(settings.layout.references) == [100, 101, 102, 103]
