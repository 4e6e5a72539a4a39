"""The camera pose from reference tags: right ones, misplaced ones, too few; and a camera that was moved."""

import math
import re

import numpy as np
import pytest

cv2 = pytest.importorskip("cv2")

from hero_localization.calibration.arena_calibration import (  # noqa: E402
    _Image,
    _judge,
    average_tags,
    calibrate_arena,
    measure_residuals,
)
from hero_localization.calibration.print_fit import _Print, refine_corners  # noqa: E402
from hero_localization.camera.camera_model import Camera, Intrinsics  # noqa: E402
from hero_localization.errors import CalibrationError  # noqa: E402
from hero_localization.prints.tag_images import draw_tag  # noqa: E402
from hero_localization.tracking.detectors import create_detector  # noqa: E402
from hero_localization.tracking.tag_pose import TagCorners  # noqa: E402
from hero_localization.tracking.tracker import find_moved_references  # noqa: E402
from hero_node import Pose, transform_pose  # noqa: E402

LENS = Intrinsics(
    1920,
    1080,
    np.array(((1390.0, 0.0, 955.0), (0.0, 1385.0, 545.0), (0.0, 0.0, 1.0))),
    np.array((-0.1, 0.02, 0.001, 0.0, 0.0)),
)
PLACES = {
    100: (-1.2, -0.65),
    101: (1.2, -0.65),
    102: (1.2, 0.65),
    103: (-1.2, 0.65),
    104: (0.0, -0.6),
    105: (0.1, 0.6),
}
REFERENCES = {tag_id: Pose(*place, 0.0) for tag_id, place in PLACES.items()}


def hang(tilt_rad=(0.05, -0.03, 0.1), position_m=(0.04, -0.02, 2.2)):
    rotation = cv2.Rodrigues(np.array(tilt_rad))[0] @ np.diag((1.0, -1.0, -1.0))
    return Camera(LENS, rotation, np.array(position_m))


CAMERA = hang()


def see(tag_id, pose, size_m=0.1, camera=CAMERA, random=None):
    half = size_m / 2.0
    square = ((half, half), (half, -half), (-half, -half), (-half, half))
    corners = [transform_pose(pose, Pose(x, y, 0.0)) for x, y in square]
    pixels = camera.project(np.array([(corner.x_m, corner.y_m, 0.0) for corner in corners]))
    return TagCorners(tag_id, pixels + (0.0 if random is None else random.normal(0.0, 0.06, (4, 2))))


def see_all(shifts_m=None, camera=CAMERA, yaw_rad=0.0, ids=tuple(PLACES)):
    random = np.random.RandomState(3)
    tags = []
    for tag_id in ids:
        dx_m, dy_m = (shifts_m or {}).get(tag_id, (0.0, 0.0))
        place = Pose(PLACES[tag_id][0] + dx_m, PLACES[tag_id][1] + dy_m, yaw_rad)
        tags.append(see(tag_id, place, camera=camera, random=random))
    return tags


def place_error_m(camera):
    """Return the worst error over the field of places at a robot's height."""
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 9), np.linspace(-0.6, 0.6, 5))
    points_m = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, 0.076)))
    found_m = camera.intersect(CAMERA.project(points_m), 0.076)
    return np.linalg.norm(found_m - points_m[:, :2], axis=1).max()


@pytest.mark.parametrize("seed", [9, 15, 21, 33, 36])
def test_four_tags_may_lie_turned_each_in_its_own_way(seed):
    random = np.random.RandomState(seed)
    ids = sorted(random.choice(tuple(PLACES), 4, replace=False).tolist())
    yaws_rad, tilt_rad = random.uniform(-math.pi, math.pi, 4).tolist(), random.uniform(-0.1, 0.1, 2)
    lens = LENS._replace(distortion=np.array((-0.32, 0.11, 0.0, 0.0, 0.0)))
    camera = hang((*tilt_rad, 0.1))._replace(lens=lens)
    tags = [see(tag_id, Pose(*PLACES[tag_id], yaw_rad), camera=camera) for tag_id, yaw_rad in zip(ids, yaws_rad)]
    found = calibrate_arena(lens, tags, {tag_id: REFERENCES[tag_id] for tag_id in ids})
    assert found.camera.position_m == pytest.approx(camera.position_m, abs=1e-3)


@pytest.mark.parametrize("cell_px", [3.5, 6.0])
@pytest.mark.parametrize("gamma", [0.6, 1.0, 2.2])
def test_prints_have_their_size_where_the_camera_brightens_or_darkens(cell_px, gamma):
    fine = np.kron(np.pad(draw_tag("36h11", 101), 4, constant_values=255), np.ones((24, 24), np.uint8))
    scale = cell_px / 24.0
    light = cv2.resize(fine / 255.0 * 0.8 + 0.06, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    gray = np.rint(255.0 * cv2.GaussianBlur(light, (0, 0), 0.8) ** (1.0 / gamma)).astype(np.uint8)
    (tag,) = create_detector(decimate=1.0).detect(gray)
    (refined,) = refine_corners(gray, [tag], "36h11")
    if gamma == 2.2:
        assert tag.side_px < 0.993 * 8.0 * cell_px, "refused as out of scale"
    assert refined.side_px == pytest.approx(8.0 * cell_px, rel=0.003 if cell_px < 4.0 else 8e-4)
    assert refined.center == pytest.approx(tag.center)
    shares = (refined.corners - refined.center) / (tag.corners - tag.center)
    assert shares.min() > 0.0 and np.ptp(shares) < 1e-6, "each where it was, only further out or in"


@pytest.mark.parametrize("count", [4, 6])
def test_camera_is_found_from_reference_tags(count):
    found = calibrate_arena(LENS, see_all(ids=tuple(PLACES)[:count]), {k: REFERENCES[k] for k in tuple(PLACES)[:count]})
    assert found.left_out == [] and [problem for problem in found.problems if "add two" not in problem] == []
    assert set(found.residuals_m) == set(tuple(PLACES)[:count])
    assert found.rms_m < 0.0005
    assert place_error_m(found.camera) < 0.001


def test_yaw_of_reference_tags_need_not_be_measured():
    found = calibrate_arena(LENS, see_all(yaw_rad=0.3), REFERENCES)
    assert found.problems == [] and place_error_m(found.camera) < 0.001


def test_places_measured_with_a_tape_do():
    random = np.random.RandomState(1)
    shifts_m = {tag_id: tuple(random.normal(0.0, 0.001, 2)) for tag_id in PLACES}
    found = calibrate_arena(LENS, see_all(shifts_m), REFERENCES)
    assert found.problems == []
    assert 0.0002 < found.rms_m < 0.002 and place_error_m(found.camera) < 0.004


def test_misplaced_tag_is_named_and_left_out():
    found = calibrate_arena(LENS, see_all({102: (0.03, -0.01)}), REFERENCES)
    assert found.left_out == [102]
    assert found.residuals_m[102] == pytest.approx(math.hypot(0.03, 0.01), abs=0.003)
    assert len(found.problems) == 1 and "tag 102" in found.problems[0] and "mm from its place" in found.problems[0]
    assert place_error_m(found.camera) < 0.002


@pytest.mark.parametrize("tag_id", PLACES)
def test_one_tag_5_mm_from_its_place_is_named_among_six(tag_id):
    random = np.random.RandomState(tag_id)
    shifts_m = {other: tuple(random.normal(0.0, 0.0005, 2)) for other in PLACES}
    shifts_m[tag_id] = (0.003, -0.004)
    found = calibrate_arena(LENS, see_all(shifts_m), REFERENCES)
    assert found.left_out == [tag_id]
    assert found.problems[0].startswith("tag %d was left out" % tag_id)


@pytest.mark.parametrize("seed", range(12))
def test_a_wrong_place_of_five_is_named_alone_or_among_others(seed):
    random = np.random.RandomState(seed)
    ids = sorted(PLACES)[:5]
    bad = int(random.choice(ids))
    places = {tag_id: REFERENCES[tag_id] for tag_id in ids}
    taped = {tag_id: Pose(*(random.normal(pose[:2], 0.0007)), 0.0) for tag_id, pose in places.items()}
    x_m, y_m, _ = taped[bad]
    angle_rad = random.uniform(0.0, math.tau)
    taped[bad] = Pose(x_m + 0.008 * math.cos(angle_rad), y_m + 0.008 * math.sin(angle_rad), 0.0)
    found = calibrate_arena(LENS, see_all(ids=ids), taped)
    assert found.problems and re.search(r"\b%d\b" % bad, found.problems[0]), found.problems
    assert found.left_out in ([], [bad])
    if not found.left_out:
        assert 5.0 < float(re.search(r"is about (\d+) mm from its place", found.problems[0]).group(1)) < 14.0


@pytest.mark.parametrize("scale", [0.98, 0.992, 1.009, 1.02])
def test_places_by_a_tape_that_is_wrong_are_refused_by_the_tags_size(scale):
    wrong = {tag_id: Pose(scale * pose.x_m, scale * pose.y_m, 0.0) for tag_id, pose in REFERENCES.items()}
    with pytest.raises(CalibrationError, match=r"measure %.1f %% of their size.*reference_size_m" % (100.0 * scale)):
        calibrate_arena(LENS, see_all(), wrong)


@pytest.mark.parametrize("count", [4, 6])
def test_y_the_wrong_way_is_named(count):
    ids = tuple(PLACES)[:count]
    wrong = {tag_id: Pose(PLACES[tag_id][0], -PLACES[tag_id][1], 0.0) for tag_id in ids}
    with pytest.raises(CalibrationError, match="y the wrong way"):
        calibrate_arena(LENS, see_all(ids=ids), wrong)


@pytest.mark.parametrize("count", [4, 6])
@pytest.mark.parametrize("pair", [(100, 101), (100, 102), (101, 102)])
def test_swapped_reference_tags_are_named(count, pair):
    ids, (one, other) = tuple(PLACES)[:count], pair
    wrong = {tag_id: REFERENCES[tag_id] for tag_id in ids}
    wrong[one], wrong[other] = wrong[other], wrong[one]
    with pytest.raises(CalibrationError, match="tags %d and %d swapped" % pair):
        calibrate_arena(LENS, see_all(ids=ids), wrong)


@pytest.mark.slow
def test_places_that_no_mistake_explains_are_refused_or_told():
    random = np.random.RandomState(0)
    for _ in range(5):
        wrong = {tag_id: Pose(*random.uniform(-1.0, 1.0, 2), 0.0) for tag_id in PLACES}
        try:
            assert calibrate_arena(LENS, see_all(), wrong).problems
        except CalibrationError as error:
            assert "reference tags" in str(error)


def test_misplaced_one_of_four_shows_in_the_residuals():
    ids = (100, 101, 102, 103)
    found = calibrate_arena(LENS, see_all({102: (0.05, 0.0)}, ids=ids), {k: REFERENCES[k] for k in ids})
    assert found.problems and found.rms_m > 0.003


def test_lens_that_was_calibrated_wrongly_shows_in_the_residuals():
    wrong = LENS._replace(distortion=np.array((0.1, 0.0, 0.0, 0.0, 0.0)))
    assert any("lens" in problem for problem in calibrate_arena(wrong, see_all(), REFERENCES).problems)


def test_reference_tags_that_are_not_seen_are_named():
    found = calibrate_arena(LENS, see_all(ids=(100, 101, 102, 103, 104)), REFERENCES)
    assert found.problems == ["not seen: reference tags 105"]


def test_too_few_reference_tags_are_refused():
    with pytest.raises(CalibrationError, match="sees 3 of 6 reference tags, not 103, 104, 105"):
        calibrate_arena(LENS, [*see_all(ids=(100, 101, 102)), see(7, Pose(0.0, 0.0, 0.0))], REFERENCES)


def test_average_leaves_out_tags_that_are_seen_rarely_or_twice():
    random = np.random.RandomState(0)
    frames = [[see(1, Pose(0.2, 0.1, 0.0), random=random)] for _ in range(10)]
    frames[0].append(see(2, Pose(0.5, 0.1, 0.0)))
    for frame in frames:
        frame.extend((see(3, Pose(0.5, 0.1, 0.0)), see(3, Pose(0.7, 0.1, 0.0))))
    (averaged,) = average_tags(frames)
    assert averaged.tag_id == 1
    assert np.abs(averaged.corners - see(1, Pose(0.2, 0.1, 0.0)).corners).max() < 0.08


def see_poses(camera, seen_by):
    """Return where reference tags are seen if the one camera's calibration is used for the other."""
    residuals = {}
    for tag in see_all(camera=seen_by):
        center_m = camera.intersect(tag.corners, 0.0).mean(axis=0)
        residuals[tag.tag_id] = Pose(float(center_m[0]), float(center_m[1]), 0.0)
    return residuals


def test_camera_that_was_moved_shows_at_all_reference_tags():
    at_calibration = see_poses(CAMERA, CAMERA)
    assert find_moved_references(see_poses(CAMERA, CAMERA), at_calibration) == set()
    turned = hang(tilt_rad=(0.05, -0.03 + 0.004, 0.1))
    assert find_moved_references(see_poses(CAMERA, turned), at_calibration) == set(PLACES)


def test_reference_tag_that_was_moved_is_told_from_a_camera_that_was():
    at_calibration = see_poses(CAMERA, CAMERA)
    seen = {**at_calibration, 101: at_calibration[101]._replace(x_m=at_calibration[101].x_m + 0.02)}
    assert find_moved_references(seen, at_calibration) == {101}
    seen[101] = seen[101]._replace(x_m=math.nan)
    assert find_moved_references(seen, at_calibration) == {101}, "a pose that is no number is no match"


def test_residuals_of_a_camera_are_those_of_the_places():
    residuals_m = measure_residuals(CAMERA, see_all({100: (0.01, 0.0)}), REFERENCES)
    assert residuals_m[100] == pytest.approx(0.01, abs=0.0005)
    assert max(residual for tag_id, residual in residuals_m.items() if tag_id != 100) < 0.0005


def test_residuals_are_judged_at_their_limits():
    ids = dict.fromkeys((1, 2, 3, 4), 0.0)
    assert _judge({**ids, 2: 0.0059}, [], []) == [], "2.95 mm rms"
    too_far, rms = "tag 2 is seen 6 mm from its place; measure that again", "residual 3.1 mm rms is above 3 mm: "
    problems = _judge({**ids, 2: 0.0061}, [], [])
    assert problems[0] == too_far and problems[1].startswith(rms) and len(problems) == 2
    assert [problem[: len(rms)] for problem in _judge(dict.fromkeys(ids, 0.0031), [], [])] == [rms]
    assert _judge(dict.fromkeys(ids, 0.0029), [], []) == []
    left_out = "tag 2 was left out: it is seen 40 mm from its place; measure that again"
    assert _judge({**ids, 2: 0.04}, [2], [7, 9]) == [left_out, "not seen: reference tags 7, 9"]


def test_a_tag_in_half_of_the_frames_is_seen_at_its_median():
    tag = see(1, Pose(0.2, 0.1, 0.0))
    frames = [[tag._replace(corners=tag.corners + shift)] for shift in (0.0, 1.0, 50.0)]
    (averaged,) = average_tags([*frames, [], [], []])
    np.testing.assert_allclose(averaged.corners, tag.corners + 1.0)
    assert average_tags([*frames, [], [], [], []]) == []


def test_an_arena_has_room_for_its_tags_and_is_no_row():
    for half_m, is_enough in ((0.16, True), (0.14, False)):
        places = {index: Pose(x_m, y_m, 0.0) for index, (x_m, y_m) in enumerate(
            ((-0.5, -half_m), (0.5, -half_m), (-0.5, half_m), (0.5, half_m)))}  # fmt: skip
        seen = [see(tag_id, pose) for tag_id, pose in places.items()]
        # Of four tags, twice the distance from the middle: 0.32 and 0.28 m.
        if is_enough:
            (problem,) = calibrate_arena(LENS, seen, places).problems
            assert problem.startswith("four reference tags cannot be checked")
        else:
            with pytest.raises(CalibrationError, match="in a row"):
                calibrate_arena(LENS, seen, places)


@pytest.mark.slow
@pytest.mark.parametrize(("share", "is_right"), [(0.9935, True), (0.9925, False), (1.0065, True), (1.0075, False)])
def test_tags_may_measure_seven_thousandths_more_or_less(share, is_right):
    exact = [see(tag_id, pose) for tag_id, pose in REFERENCES.items()]
    if is_right:
        assert calibrate_arena(LENS, exact, REFERENCES, 0.1 / share).left_out == []
    else:
        with pytest.raises(CalibrationError, match="of their size"):
            calibrate_arena(LENS, exact, REFERENCES, 0.1 / share)


@pytest.mark.parametrize("height_m", [0.19, 0.21, 19.5, 20.5])
def test_a_camera_hangs_between_20_cm_and_20_m(height_m):
    camera = hang(tilt_rad=(0.05, -0.03, 0.1), position_m=(0.04, -0.02, height_m))
    size = height_m / 2.2
    known = {tag_id: Pose(size * x_m, size * y_m, 0.0) for tag_id, (x_m, y_m) in PLACES.items()}
    seen = [see(tag_id, pose, 0.1 * size, camera) for tag_id, pose in known.items()]
    if height_m < 1.0:  # closer than tags may lie
        assert (_Image(LENS, seen, known, 0.1 * size).fit() is not None) == (height_m > 0.2)
    elif height_m < 20.0:
        assert calibrate_arena(LENS, seen, known, 0.1 * size).camera.position_m[2] == pytest.approx(height_m, rel=1e-3)
    else:
        with pytest.raises(CalibrationError, match="no camera above the floor"):
            calibrate_arena(LENS, seen, known, 0.1 * size)


def test_references_a_field_of_30_m_apart_are_in_meters():
    for side_m, is_far in ((29.9, False), (30.1, True)):
        places = {index: Pose(x_m, y_m, 0.0) for index, (x_m, y_m) in enumerate(
            ((0.0, 0.0), (1.0, side_m), (0.0, side_m), (1.0, 0.0)))}  # fmt: skip
        seen = [TagCorners(tag_id, np.zeros((4, 2))) for tag_id in places]
        with pytest.raises(CalibrationError) as error:
            calibrate_arena(LENS, seen, places)
        assert ("30.1 m apart: write their places in m" in str(error.value)) == is_far


@pytest.mark.slow
def test_a_place_is_wrong_four_millimeters_off_if_the_others_agree():
    exact = [see(tag_id, pose) for tag_id, pose in REFERENCES.items()]
    for off_m, is_wrong in ((0.0037, False), (0.0043, True)):
        taped = {**REFERENCES, 103: Pose(PLACES[103][0], PLACES[103][1] + off_m, 0.0)}
        assert calibrate_arena(LENS, exact, taped).left_out == ([103] if is_wrong else []), off_m


def tape(random, sd_m, wrong=None, scale=1.0):
    """Return places as measured with a tape of this error, one of them 5 mm wrong."""
    places = {tag_id: Pose(*(scale * np.array(xy) + random.normal(0.0, sd_m, 2)), 0.0) for tag_id, xy in PLACES.items()}
    if wrong is not None:
        places[wrong] = places[wrong]._replace(x_m=places[wrong].x_m + 0.005)
    return places


@pytest.mark.slow
def test_a_tape_of_2_mm_leaves_no_tag_out_that_is_right():
    found = [calibrate_arena(LENS, see_all(), tape(np.random.RandomState(seed), 0.002)) for seed in range(8)]
    assert sum(bool(result.left_out) for result in found) <= 1
    assert np.median([result.sd_m for result in found]) > 0.001


@pytest.mark.slow
@pytest.mark.parametrize("sd_m", [0.0007, 0.002])
def test_standard_deviation_is_that_of_places_in_the_field(sd_m):
    true_m2, told_m2 = [], []
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(-0.5, 0.5, 3))
    points_m = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, 0.076)))
    for seed in range(10):
        found = calibrate_arena(LENS, see_all(), tape(np.random.RandomState(seed), sd_m))
        off_m = found.camera.intersect(CAMERA.project(points_m), 0.076) - points_m[:, :2]
        true_m2.append((off_m**2).mean())
        told_m2.append(found.sd_m**2)
    assert 0.75 < math.sqrt(np.mean(true_m2) / np.mean(told_m2)) < 1.33


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.995, 1.005])
def test_a_scale_that_is_half_a_percent_off_is_named(scale):
    for seed in range(5):
        found = calibrate_arena(LENS, see_all(), tape(np.random.RandomState(seed), 0.0007, scale=scale))
        assert any("of their size" in problem for problem in found.problems)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.991, 1.009])
def test_another_lens_is_not_taken_for_a_wrong_tag(share):
    lens = LENS._replace(matrix=np.diag((share, share, 1.0)) @ LENS.matrix)
    for seed in range(5):
        found = calibrate_arena(
            lens, see_all(camera=hang((0.1, -0.05, 0.1))), tape(np.random.RandomState(seed), 0.0007)
        )
        assert found.left_out == [] and not any("tag 1" in problem for problem in found.problems)


def look_at_print(tag, size_px, cells):
    """Return a print in a square of the image."""
    return _Print(cells, tag, np.array((10, 20)), size_px)


def test_a_print_is_compared_with_some_white_around_it():
    cells = draw_tag("36h11", 5)
    square = 64.0 * np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
    tag = TagCorners(5, square + (10.0 + 18.0, 20.0 + 18.0))
    model = look_at_print(tag, 101, cells)
    rows, columns = np.nonzero(model.seen)
    # 64 px with 0.7 of 8 px on each side.
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (13, 87, 13, 87) and model.seen.sum() == 75**2
    for scale in (1.0, 1.05):
        shades = np.zeros((101, 101))
        shades[model.seen] = model.render(np.array((scale, 0.3, 20.0, 220.0, 1.0)))
        for row in range(8):
            for column in range(8):
                at = np.array((column + 0.5, row + 0.5)) * 8.0 + 18.0
                u, v = np.rint(50.0 + scale * (at - 50.0)).astype(int)
                assert shades[v, u] == pytest.approx(220.0 if cells[row, column] else 20.0, abs=1.0)
        edge = 50.0 + scale * 32.0
        assert shades[50, int(edge) + 3] == pytest.approx(220.0, abs=1.0), "white margin"
    blurred = [model.render(np.array((1.0, blur_px, 20.0, 220.0, 1.0))) for blur_px in (1.0, 3.0)]
    assert blurred[1].std() < 0.9 * blurred[0].std() < 0.9 * 100.0
    bright = model.render(np.array((1.0, 1.0, 20.0, 220.0, 2.2)))
    assert bright.mean() > blurred[0].mean() + 3.0 and bright.min() > 19.9 and bright.max() < 220.1


@pytest.mark.slow
def test_a_tag_at_the_rim_of_the_image_stays_as_it_is():
    fine = np.kron(np.pad(draw_tag("36h11", 101), 4, constant_values=255), np.ones((4, 4), np.uint8))
    gray = np.rint(255.0 * cv2.GaussianBlur(fine / 255.0 * 0.8 + 0.06, (0, 0), 0.8) ** (1.0 / 2.2)).astype(np.uint8)
    square = 32.0 * np.array(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))) + 15.5
    half_px = math.ceil(0.85 * 32.0)
    tag = TagCorners(101, square)
    room_px = 32 - half_px
    for left, top, right, bottom, is_whole in (
        (0, 0, 0, 0, True), (1, 0, 0, 0, True), (room_px + 1, 0, 0, 0, False), (0, room_px + 1, 0, 0, False),
        (0, 0, room_px, 0, False), (0, 0, 0, room_px, False), (0, 0, room_px - 1, 0, True),
    ):  # fmt: skip
        window = gray[top : 64 - bottom, left : 64 - right]
        moved = tag._replace(corners=square - (left, top))
        (refined,) = refine_corners(window, [moved], "36h11")
        assert (refined.corners != moved.corners).any() == is_whole, (left, top, right, bottom)
