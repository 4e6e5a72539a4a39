"""Both detectors: place, order of corners and heading of tags in rendered images."""

import math
import sys
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip("cv2")

import cv2

from hero_localization.errors import DetectorError
from hero_localization.prints.tag_images import draw_tag
from hero_localization.simulated_camera.renderer import CameraRenderer
from hero_localization.simulated_camera.view import CameraOptions, PrintedTag, tag_corners
from hero_localization.tracking import detectors, tag_template
from hero_localization.tracking.detectors import create_detector, create_fine_detectors, find_print_mistake
from hero_localization.tracking.tag_pose import TagCorners
from hero_localization.tracking.tag_template import TemplateDetector
from hero_sim.world.arena import build_rectangle
from hero_test.nonempty import maybe_empty, nonempty

OPTIONS = CameraOptions(width_px=640, height_px=480, center_px=(318.0, 242.0))
ARENA = build_rectangle(2.0, 2.0, 0)
HEADINGS = np.linspace(-math.pi, math.pi, 9)[:-1] + 0.02
POSES = np.column_stack((np.tile(np.linspace(-0.35, 0.4, 4), 2), np.repeat((-0.2, 0.18), 4), HEADINGS))


@pytest.fixture(params=["apriltag", "aruco"])
def backend(request):
    pytest.importorskip({"apriltag": "apriltag", "aruco": "cv2"}[request.param])
    return request.param


def render(family, options=OPTIONS):
    tags = [PrintedTag(index, family=family) for index in range(len(POSES))]
    renderer = CameraRenderer(options, ARENA, tags, seed=4)
    true = [renderer.camera.project(tag_corners(tag, POSES[[tag.tag_id]]))[0] for tag in tags]
    return renderer.render(POSES), true


def picture(tag_id, family="36h11", turns=0):
    cells = np.rot90(draw_tag(family, tag_id), -turns)  # clockwise
    return np.kron(np.pad(cells, 3, constant_values=255), np.ones((12, 12), np.uint8))


@pytest.mark.parametrize("family", ["36h11", "16h5"])
@pytest.mark.parametrize("decimate", [1.0, 2.0])
def test_corners_and_headings_are_those_of_the_prints(backend, family, decimate):
    image, true = render(family)
    found = {tag.tag_id: tag for tag in create_detector(backend, family, decimate).detect(image)}
    assert sorted(found) == list(range(len(POSES)))
    errors = np.array([found[tag_id].corners - corners for tag_id, corners in enumerate(true)])
    assert np.abs(errors).max() < 1.0, "a wrong order of the corners is 20 px off"
    assert np.sqrt((errors**2).mean()) < {"apriltag": 0.1, "aruco": 0.25}[backend]
    centers = np.array([found[tag_id].center - corners.mean(axis=0) for tag_id, corners in enumerate(true)])
    assert np.abs(centers.mean(axis=0)).max() < 0.05, "half a pixel is the trap"
    assert np.abs(centers).max() < 0.2


@pytest.mark.parametrize("turns", [0, 1, 2, 3])
@pytest.mark.parametrize("family", ["36h11", "16h5"])
def test_first_corner_is_the_prints_upper_left_however_it_lies(backend, family, turns):
    corners = create_detector(backend, family).detect(picture(5, family, turns))[0].corners
    low, high = 36.0 - 0.5, 36.0 + 12.0 * len(draw_tag(family, 5)) - 0.5
    square = np.array(((low, low), (high, low), (high, high), (low, high)))
    assert np.abs(corners - np.roll(square, -turns, axis=0)).max() < 1.0


def test_mirrored_prints_are_not_taken_for_tags(backend):
    assert create_detector(backend).detect(np.ascontiguousarray(picture(5)[:, ::-1])) == []


def test_corners_of_a_window_are_those_of_the_whole_picture(backend):
    image, true = render("36h11")
    left, top = np.floor(true[5].min(axis=0)).astype(int) - 20
    found = create_detector(backend).detect(image[top : top + 72, left : left + 72], (left, top))
    (tag,) = (tag for tag in found if tag.tag_id == 5)
    assert np.abs(tag.corners - true[5]).max() < 1.0


def test_tags_of_another_family_are_not_found(backend):
    assert create_detector(backend, "16h5").detect(picture(5)) == []
    assert create_detector(backend, "36h11").detect(picture(5, "16h5")) == []


def test_nothing_is_found_in_noise_or_in_an_empty_picture(backend):
    noise = np.random.RandomState(0).randint(0, 256, (480, 640)).astype(np.uint8)
    for family in ("36h11", "16h5"):
        detector = create_detector(backend, family)
        assert detector.detect(np.full((480, 640), 120, np.uint8)) == []
        assert detector.detect(noise) == []


def test_fine_detectors_find_blurred_tags_of_16_px_and_none_in_noise():
    pytest.importorskip("apriltag")
    picture_px = cv2.resize(picture(5), None, fx=1.0 / 6.0, fy=1.0 / 6.0, interpolation=cv2.INTER_AREA)
    blurred = cv2.GaussianBlur(picture_px, (0, 0), 1.0)
    noise = np.random.RandomState(0).randint(0, 256, (240, 320)).astype(np.uint8)
    assert create_detector("apriltag", decimate=1.0).detect(blurred) == []
    for detector in nonempty(create_fine_detectors("36h11")[:2]):
        (tag,) = detector.detect(blurred, (100, 50))
        assert tag.tag_id == 5 and np.abs(tag.center - (113.5, 63.5)).max() < 0.3
    for family in ("36h11", "16h5"):
        assert not any(detector.detect(noise) for detector in create_fine_detectors(family)[:2])


def photograph(tag_id, shade=1.0, edge_rad=0.0, blur_px=0.8, gamma=1.0, seed=0, side_px=26.0):
    """Return an image (H, W) of a tag, half of it in a shadow."""
    light = np.where(picture(tag_id) > 127, 0.85, 0.06)
    across = np.indices(light.shape) - light.shape[0] / 2.0
    light[across[0] * math.sin(edge_rad) + across[1] * math.cos(edge_rad) > 0.0] *= shade
    scale = side_px / (8 * 12)
    light = cv2.resize(np.pad(light, 60, constant_values=0.45), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    light = 255.0 * cv2.GaussianBlur(light, (0, 0), blur_px) ** (1.0 / gamma)
    noise = np.random.RandomState(seed).normal(0.0, 3.0, light.shape)
    return np.clip(np.rint(light + noise), 0, 255).astype(np.uint8)


def test_fine_detectors_find_blurred_tags_of_26_px():
    pytest.importorskip("apriltag")
    for index in range(24):
        image = photograph(index, edge_rad=0.3 * index, seed=index, blur_px=1.8)
        (tag,) = next(filter(None, (detector.detect(image) for detector in create_fine_detectors("36h11")[:2])))
        assert tag.tag_id == index and measure_offset(tag, image) < 0.7


def measure_offset(tag, image):
    return np.abs(tag.center - (np.array(image.shape) - 1.0) / 2.0).max()


def expect_tag(tag_id, image, side_px, corners=None, offset_px=(2.0, -1.5)):
    """Return a detector of a tag that is expected beside the middle of an image."""
    return TemplateDetector(tag_id, (np.array(image.shape[::-1]) - 1.0) / 2.0 + offset_px, side_px, corners)


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [1.0, 2.2])
@pytest.mark.parametrize(("shade", "share"), [(1.0, 1.0), (0.4, 0.95), (0.25, 0.9)])
@pytest.mark.parametrize("side_px", [17.0, 26.0, 60.0])
def test_tags_are_found_by_their_print_in_edges_of_shadows(side_px, shade, share, gamma):
    found = 0
    for index in range(12):
        image = np.rot90(photograph(index, shade, 0.5 * index, gamma=gamma, seed=index, side_px=side_px), index)
        tags = expect_tag(index, image, 1.1 * side_px).detect(image)
        found += bool(tags)
        for tag in maybe_empty(tags):
            (again,) = expect_tag(index, image, side_px, tag.corners).detect(image[2:, 3:], (3, 2))
            for seen in (tag, again):
                assert seen.tag_id == index and measure_offset(seen, image) < 0.3
                assert abs(seen.side_px / side_px - 1) < 0.04 and np.argmin(seen.corners.sum(axis=1)) == index % 4
            turned = np.roll(tag.corners, 1, axis=0)  # a known heading is 12 degrees off at most
            assert expect_tag(index, image, side_px, turned).detect(image) == []
    assert found >= share * 12


@pytest.mark.slow
@pytest.mark.parametrize("edge", [0, 5, 40, 107])
def test_the_edge_of_a_shadow_over_a_print_leaves_no_rest(edge):
    template = tag_template.TagTemplate("36h11", 3, 0.3)
    lit, shadow = 2.0 * template._even[:, 3], tag_template._shade(tag_template.CELL_CENTERS)[edge]
    contrast, rest, found = template._explain(np.array((lit, lit + 0.7 * shadow)))
    assert rest == pytest.approx([0.0, 0.0], abs=1e-6) and contrast[0] == pytest.approx(2.0) and found[1] == edge


@pytest.mark.slow
def test_a_print_is_found_neither_by_other_ids_nor_in_noise():
    image, random = photograph(3, 0.4, side_px=17.0), np.random.RandomState(0)
    assert expect_tag(3, image, 17.0).detect(image) != []
    assert not any(expect_tag(tag_id, image, 17.0).detect(image) for tag_id in range(4, 40))
    for _ in range(10):
        noise = np.clip(110.0 + cv2.GaussianBlur(random.normal(0.0, 150.0, (60, 60)), (0, 0), 1.3), 0, 255)
        assert expect_tag(3, noise, 17.0).detect(noise.astype(np.uint8)) == []
    assert expect_tag(587, image, 17.0).detect(image) == expect_tag(-1, image, 17.0).detect(image) == []
    covered = np.where(np.arange(image.shape[1]) < image.shape[1] / 2, image, 110).astype(np.uint8)
    assert expect_tag(3, covered, 17.0).detect(covered) == []


def draw_on_floor(cell_px, contrast=0.7):
    """Return an image (H, W) of tag 5 on a floor with noise, and the part of it that the tag takes."""
    cells = np.pad(draw_tag("36h11", 5), 1, constant_values=255)
    image, part = np.full((900, 1200), 110.0), slice(60, 60 + cell_px * len(cells))
    image[part, part] = np.kron(contrast * (cells - 127.0) + 110.0, np.ones((cell_px, cell_px)))
    noise = np.random.RandomState(1).normal(0.0, 3.0, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8), part


@pytest.mark.parametrize(("cell_px", "contrast"), [(3, 0.7), (15, 0.7), (60, 0.7), (2, 0.15), (3, 0.07), (5, 0.07)])
@pytest.mark.parametrize("decimate", [1.0, 2.0])
def test_corners_are_the_same_where_noise_of_the_ground_is_removed(cell_px, contrast, decimate, monkeypatch):
    pytest.importorskip("apriltag")
    image, _ = draw_on_floor(cell_px, contrast)
    (tag,) = create_detector("apriltag", decimate=decimate).detect(image)
    monkeypatch.setattr(detectors, "EVEN_FROM_PX", image.size)
    (same,) = create_detector("apriltag", decimate=decimate).detect(image)
    assert tag.tag_id == same.tag_id == 5 and np.array_equal(tag.corners, same.corners)


def test_noise_of_even_ground_alone_is_removed(monkeypatch):
    """apriltag skips what differs by less than 5 within 12 px: most of an image."""
    pytest.importorskip("apriltag")
    image, part = draw_on_floor(3)
    detector, given = create_detector("apriltag"), []
    monkeypatch.setattr(detector, "_detector", Mock(detect=lambda gray: given.append(gray) or []))
    for window in (image, image[:200, :200]):
        detector.detect(window)
    assert np.array_equal(given[0][part, part], image[part, part]) and np.array_equal(given[1], image[:200, :200])
    blocks = given[0].reshape(75, 12, 100, 12)
    assert np.mean(blocks.max(axis=(1, 3)) - blocks.min(axis=(1, 3)) < 5) > 0.95


def test_center_is_where_the_diagonals_cross():
    # Seen at a slant, the far half of a square is shorter than the near one.
    tag = TagCorners(0, np.array(((10.0, 0.0), (20.0, 0.0), (30.0, 30.0), (0.0, 30.0))))
    assert tag.center == pytest.approx((15.0, 7.5))
    assert tag.side_px == pytest.approx(math.sqrt((10.0 + 30.0) / 2.0 * 30.0)), "the area of a trapezium"


def test_default_detector_is_installed():
    assert [tag.tag_id for tag in create_detector().detect(picture(5))] == [5]


def test_a_library_that_is_broken_is_not_called_missing(tmp_path, monkeypatch):
    (tmp_path / "apriltag.py").write_text("raise OSError('libapriltag.so.3 is no library')")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "apriltag", raising=False)
    with pytest.raises(OSError, match="libapriltag"):
        create_detector("apriltag")


def test_missing_library_is_named_with_its_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "apriltag", None)
    with pytest.raises(DetectorError, match="apt install python3-apriltag"):
        create_detector("apriltag")


def test_tags_of_another_family_and_mirrored_images_are_named():
    image = np.full((200, 900), 255, np.uint8)
    for index in range(4):
        cells = np.kron(draw_tag("16h5", index), np.ones((16, 16), np.uint8))
        image[50:146, 60 + 200 * index : 156 + 200 * index] = cells
    assert "set family: 16h5" in find_print_mistake(image, "36h11")
    assert find_print_mistake(image, "16h5") == ""
    assert "mirrored" in find_print_mistake(image[:, ::-1], "16h5")
