"""What one camera's images show, where tags are expected, and what people are told of camera and tags."""

import numpy as np
import pytest

from hero_localization.camera.camera_model import Camera, Intrinsics
from hero_localization.tracking.settings import Settings
from hero_localization.tracking.tag_pose import TagCorners, TagLayout
from hero_localization.tracking.tracker import Problem, Tracker
from hero_node import Pose
from hero_test.nonempty import nonempty

MATRIX = (1390.0, 0.0, 960.0, 0.0, 1390.0, 540.0, 0.0, 0.0, 1.0)
CAMERA = Camera(
    Intrinsics.from_camera_info(1920, 1080, MATRIX, "plumb_bob", ()),
    np.diag((1.0, -1.0, -1.0)),
    np.array((0.0, 0.0, 2.2)),
)
REFERENCES = {100 + index: Pose(0.3 * index, 0.4, 0.0) for index in range(3)}
LAYOUT = TagLayout(tag_robots={5: 1}, mounts={5: Pose(0.01, 0.0, 0.0)}, objects={9: "box"}, references=REFERENCES)
SQUARE = 0.5 * np.array(((-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)))


def make_tracker(**changes):
    return Tracker(Settings(layout=LAYOUT, camera=CAMERA, seen_references=REFERENCES)._replace(**changes), CAMERA)


def see(tag_id, x_m, y_m, size_m=0.04, height_m=0.076):
    corners_m = np.column_stack((SQUARE * size_m + (x_m, y_m), np.full(4, height_m)))
    return TagCorners(tag_id, CAMERA.project(corners_m))


def see_references(moved_m, ids=REFERENCES):
    places = {tag_id: REFERENCES[tag_id] for tag_id in ids}
    return [see(tag_id, place.x_m + moved_m, place.y_m, 0.1, 0.0) for tag_id, place in places.items()]


def test_tags_are_expected_where_their_robots_are():
    places = make_tracker().project({0: Pose(0.2, 0.1, 1.0), 1: Pose(0.3, 0.0, 0.0), 9: Pose(0.0, 0.0, 0.0)})
    assert set(places) == {0, 5}, "tag 9 is an object's"
    for tag in nonempty([see(0, 0.2, 0.1), see(5, 0.31, 0.0)]):
        assert places[tag.tag_id] == pytest.approx((*tag.center, tag.side_px), rel=1e-3)
    assert make_tracker().project({}) == {}


def test_a_tag_that_counts_for_nothing_is_named_for_a_while():
    tracker = make_tracker()
    tracker.take([see(1, 0.0, 0.0), see(3, 0.2, 0.0), see(3, 0.4, 0.0), see(4, 0.0, 0.3, size_m=0.03)], 10.0, 0)
    names = {problem.name: problem.text for problem in tracker.list_problems()}
    assert "is assigned to no robot" in names["tag 1"] and "more than once" in names["tag 3"]
    assert "measures 75 % of its size" in names["tag 4"]
    tracker.take([], 11.9, 1)
    assert len(tracker.list_problems()) == 3
    tracker.take([], 12.1, 2)
    assert tracker.list_problems() == []


def test_problems_of_a_recording_end_when_it_is_played_again():
    tracker = make_tracker()
    tracker.take([see(1, 0.0, 0.0)], 100.0, 0)
    tracker.take([], 1.0, 0)
    assert tracker.list_problems() == [] and tracker.rates_hz == (0.0, 0.0)


def test_a_moved_camera_is_told_from_a_moved_reference_tag():
    tracker = make_tracker()
    for frame in range(20):
        tracker.take(see_references(0.01), 0.1 * frame, frame)
    assert [problem.name for problem in tracker.list_problems()] == ["camera"]
    for frame in range(20, 40):
        tracker.take(see_references(0.01, [101]) + see_references(0.0, [100, 102]), 0.1 * frame, frame)
    assert [problem.name for problem in tracker.list_problems()] == ["tag 101"]


@pytest.mark.parametrize(("shade", "word"), [(10, "dark"), (250, "bright"), (128, None)])
def test_dark_and_bright_pictures_are_named(shade, word):
    tracker = make_tracker()
    tracker.quality.measure(np.full((48, 64), shade, np.uint8), [])
    assert [word in problem.text for problem in tracker.list_problems()] == ([True] if word else [])


def test_small_tags_are_named():
    text = "tags measure only 8 px, less than 14: mount the camera lower, or print larger tags"
    tracker = make_tracker()
    tracker.take([see(0, 0.0, 0.0, size_m=0.012)], 1.0, 0)
    assert Problem("camera", text, False) in tracker.list_problems()
    tracker = make_tracker(layout=TagLayout(size_m=0.012))
    assert Problem("camera", text, False) in tracker.list_problems(), "before any is found"


def test_tags_that_are_often_missed_where_they_are_expected_are_named():
    tracker, robots = make_tracker(), {0: Pose(0.0, 0.0, 0.0), 2: Pose(0.3, 0.0, 0.0), 3: Pose(0.0, 5.0, 0.0)}
    for frame in range(60):
        tags = [see(0, 0.0, 0.0), *([see(2, 0.3, 0.0)] if frame % 3 else [])]
        tracker.take([*tags, *see_references(0.0)], frame / 30.0, frame, tracker.project(robots))
    (problem,) = tracker.list_problems()
    assert problem.text.startswith("tags 2 are often missed where their robots are")


def test_poses_of_a_knocked_camera_are_not_trusted_from_the_first_image_on():
    tracker = make_tracker()
    tracker.take(see_references(0.0), 0.0, 0)
    assert not tracker.is_moved
    tracker.take(see_references(0.01), 0.03, 1)
    assert tracker.is_moved and tracker.list_problems() == []
    tracker.take([], 0.07, 2)
    assert tracker.is_moved, "a hand over the reference tags proves nothing"
    tracker.take(see_references(0.01), 0.6, 3)
    (problem,) = tracker.list_problems()
    assert "the camera moved" in problem.text and problem.is_error
    tracker.take(see_references(0.0), 0.63, 4)
    assert not tracker.is_moved and tracker.list_problems() == []


def test_pictures_are_taken_before_their_stamps_but_not_before_time_began():
    tracker = make_tracker(delay_s=0.07)
    assert tracker.taken_s(10.0) == pytest.approx(9.93)
    assert tracker.taken_s(0.05) == 0.0


def test_pictures_that_are_left_out_are_told_as_a_rate():
    tracker = make_tracker()
    for number in range(0, 90, 3):
        tracker.take(see_references(0.0), number / 30.0, number)
    text = "10.0 of 30.0 images per second are used: this computer is busy, or too slow for more"
    assert tracker.list_problems() == [Problem("camera", text, False)]
    for number in range(90, 120):
        tracker.take(see_references(0.0), number / 30.0, number)
    assert tracker.list_problems() == [] and tracker.describe_rate() == "30.0 images per second"


@pytest.mark.parametrize(
    ("seen", "name", "text"),
    [
        ([100], "camera", "2 of 3 reference tags are not seen: is there light enough, and did the camera move?"),
        ([100, 101], "tag 102", "this reference tag is not seen: is it occluded, removed, or too dark?"),
    ],
)
def test_reference_tags_that_are_not_seen_for_long_are_named(seen, name, text):
    tracker = make_tracker()
    for stamp_s in range(6):
        tracker.take(see_references(0.0, seen), float(stamp_s), stamp_s)
        assert tracker.list_problems() == []
    tracker.take(see_references(0.0, seen), 6.0, 6)
    assert tracker.list_problems() == [Problem(name, text, False)]
    tracker.take(see_references(0.0), 6.1, 7)
    assert tracker.list_problems() == []


@pytest.mark.parametrize(("shade", "count"), [(34, 1), (35, 0), (36, 0), (225, 0), (226, 1)])
def test_images_may_be_as_dark_and_bright_as_the_limits(shade, count):
    tracker = make_tracker()
    tracker.quality.measure(np.full((48, 64), shade, np.uint8), [])
    assert len(tracker.list_problems()) == count


@pytest.mark.slow
def test_what_is_missed_moved_or_missing_counts_from_its_limit_on():
    for missed, count in ((12, 0), (13, 1)):
        tracker = make_tracker()
        for frame in range(60):
            tags = [] if frame < missed else [see(0, 0.0, 0.0)]
            tracker.take([*tags, *see_references(0.0)], frame / 30.0, frame, tracker.project({0: Pose(0.0, 0.0, 0.0)}))
        assert len(tracker.list_problems()) == count, missed
    for last_s, count in ((1.95, 0), (2.05, 1)):
        tracker = make_tracker()
        for stamp_s in (0.0, 0.2, last_s):
            tracker.take(see_references(0.01, [101]) + see_references(0.0, [100, 102]), stamp_s, 0)
        assert len(tracker.list_problems()) == count, last_s
    for last_s, count in ((4.9, 0), (5.1, 1)):
        tracker = make_tracker()
        tracker.take(see_references(0.0), 0.0, 0)
        tracker.take(see_references(0.0, [100, 102]), last_s, 1)
        assert len(tracker.list_problems()) == count, last_s


@pytest.mark.slow
def test_a_tag_expected_near_the_border_need_not_be_seen():
    for place, count in (((41.0, 500.0), 1), ((40.0, 500.0), 0), ((1880.0, 500.0), 0), ((1879.0, 41.0), 1),
                         ((1881.0, 41.0), 0), ((900.0, 1039.0), 1), ((900.0, 1041.0), 0),
                         ((900.0, 39.0), 0)):  # fmt: skip
        tracker = make_tracker()
        for frame in range(60):
            tracker.take(see_references(0.0), frame / 30.0, frame, {7: (*place, 26.0)})
        assert len(tracker.list_problems()) == count, place


@pytest.mark.slow
def test_a_tag_that_left_the_image_is_expected_anew_when_it_is_back():
    tracker = make_tracker()
    for frame in range(120):
        place = (10.0, 10.0) if frame == 40 else (900.0, 500.0)
        tracker.take(see_references(0.0), frame / 30.0, frame, {7: (*place, 26.0)})
        assert len(tracker.list_problems()) == (frame >= 100), frame


def test_a_busy_computer_is_named_when_a_fifth_of_the_images_is_left_out():
    for every, count in ((4, 1), (8, 0)):
        tracker = make_tracker()
        numbers = [number for number in range(100) if number % every][:30]
        for number in numbers:
            tracker.take(see_references(0.0), number / 30.0, number)
        assert len(tracker.list_problems()) == count, every
        used_hz, sent_hz = tracker.rates_hz
        assert used_hz == pytest.approx(29 * 30.0 / (numbers[-1] - numbers[0])) and sent_hz == pytest.approx(30.0)
