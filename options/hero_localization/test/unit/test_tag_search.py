"""The search for tags over the frames of a drive: followed in windows, found anywhere, lost and found again."""

import math
import sys
from typing import NamedTuple, Optional

import numpy as np
import pytest

from hero_localization.tracking.tag_pose import TagCorners
from hero_localization.tracking.tag_search import TagSearch, _list_tiles

FRAME_S = 1.0 / 30.0
WIDTH_PX, HEIGHT_PX = 1920, 1080
FRAME = np.broadcast_to(np.uint8(0), (HEIGHT_PX, WIDTH_PX))
SIDE_PX = 26.0
FAST_PX_S = 140.0
"""0.2 m/s, 2.2 m below the camera."""


class SeenTags:
    """Finds those of the tags given that lie in the window with their margin."""

    def __init__(self):
        self.searched_px, self.blind = 0, set()
        self.place([])

    def place(self, tags):
        square = SIDE_PX / 2.0 * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)))
        self.tags = [TagCorners(tag_id, np.array(center) + square) for tag_id, center in tags]
        corners = np.array([tag.corners for tag in self.tags]).reshape(-1, 4, 2)
        self.low, self.high = corners.min(axis=1), corners.max(axis=1)

    def detect(self, gray, origin=(0, 0)):
        height, width = gray.shape
        self.searched_px += height * width
        low, high = np.array(origin) + SIDE_PX / 6.0, np.array(origin) + (width, height) - SIDE_PX / 6.0
        inside = (self.low >= low) & (self.high <= high)
        seen = [self.tags[index] for index in np.flatnonzero(inside.all(axis=1))]
        return [tag for tag in seen if tag.tag_id not in self.blind]


class Watch:
    """A search, and the number of the frame."""

    def __init__(self, with_fine=False, smallest_px=20.0):
        self.detector, self.fine, self.finest, self.index = SeenTags(), SeenTags(), SeenTags(), -1
        fine = [self.fine, self.finest] if with_fine else []
        self.search = TagSearch(self.detector, WIDTH_PX, HEIGHT_PX, fine, smallest_px)

    def see(self, tags, expected=None, frames=1):
        detectors = (self.detector, self.fine, self.finest)
        for detector in detectors:
            detector.place(tags)
        for _ in range(frames):
            self.index += 1
            for detector in detectors:
                detector.searched_px = 0
            sized = {tag_id: (*place, SIDE_PX) for tag_id, place in (expected or {}).items()}
            found = self.search.search(FRAME, self.index * FRAME_S, sized)
        return sorted(tag.tag_id for tag in found)

    def count_searched_px(self):
        """Return how many pixels are searched in two seconds without a tag."""
        searched_px = 0
        for _ in range(60):
            self.see([])
            searched_px += self.detector.searched_px
        return searched_px


def everywhere():
    x, y = np.meshgrid(np.linspace(25.0, WIDTH_PX - 25.0, 25), np.linspace(25.0, HEIGHT_PX - 25.0, 16))
    return list(enumerate(np.column_stack((x.ravel(), y.ravel()))))


@pytest.mark.slow
def test_tags_anywhere_are_found_within_the_first_frames():
    watch = Watch()
    assert watch.see(everywhere(), frames=7) == list(range(400))


def test_new_tag_is_found_within_two_seconds():
    watch = Watch()
    watch.see([(1, (300.0, 300.0))], frames=60)
    seen = [2 in watch.see([(1, (300.0, 300.0)), (2, (1500.0, 950.0))]) for _ in range(61)]
    assert seen[-1]


@pytest.mark.slow
def test_known_tags_cost_windows_only():
    watch = Watch()
    tags = everywhere()[::8]
    watch.see(tags, frames=30)
    searched_px = []
    for _ in range(60):
        assert watch.see(tags) == [tag_id for tag_id, _ in tags]
        searched_px.append(watch.detector.searched_px)
    # 50 windows of 64 px, and the sweep: once in 60 frames, its tiles overlap.
    assert np.mean(searched_px) < 50 * 66**2 + 1.7 * WIDTH_PX * HEIGHT_PX / 60.0


@pytest.mark.slow
def test_standing_tags_cost_little_more_when_most_frames_are_missing():
    watch = Watch()
    tags = everywhere()[::8]
    watch.see(tags, frames=30)
    for _ in range(4):
        watch.index += 11
        assert watch.see(tags) == [tag_id for tag_id, _ in tags]
        # Two of the twelve tiles are due after so long.
        assert watch.detector.searched_px < 50 * 80**2 + 2 * 1.7 * WIDTH_PX * HEIGHT_PX / 12.0


@pytest.mark.parametrize("every", [1, 2, 3])
def test_tag_that_starts_stops_and_turns_at_full_speed_is_never_lost(every):
    """With every frame, and with frames missing."""
    watch, center = Watch(), np.array((900.0, 500.0))
    watch.see([(1, center)], frames=10)
    random, velocity = np.random.RandomState(2), np.zeros(2)
    for step in range(400):
        if step % 12 == 0:
            angle = random.uniform(0.0, 2.0 * np.pi)
            velocity = FAST_PX_S * random.randint(2) * np.array((np.cos(angle), np.sin(angle)))
        watch.index += every - 1
        center = np.clip(center + velocity * every * FRAME_S, 60.0, 1000.0)
        assert watch.see([(1, center)]) == [1], step


def test_hidden_tag_is_found_near_its_place_in_the_first_frame():
    watch = Watch()
    watch.see([(1, (800.0, 500.0))], frames=40)
    watch.see([], frames=20)
    assert watch.see([(1, (830.0, 500.0))]) == [1]


def test_tag_lost_for_long_is_found_at_once_where_it_is_expected():
    watch = Watch()
    watch.see([(1, (800.0, 500.0))], frames=40)
    watch.see([], frames=300)
    assert watch.see([(1, (1410.0, 720.0))], expected={1: (1400.0, 700.0)}) == [1]


def test_tag_that_drove_on_unseen_is_found_within_300_ms():
    """After two seconds below a hand, and with nobody who knows where it is."""
    watch = Watch()
    watch.see([(1, (900.0, 500.0))], frames=40)
    watch.see([], frames=60)
    seen = [watch.see([(1, (1130.0, 360.0))]) for _ in range(round(0.3 / FRAME_S))]
    assert seen[-1] == [1]


def test_a_tag_moved_by_hand_is_seen_within_100_ms():
    watch = Watch()
    watch.see([(1, (900.0, 500.0))], frames=40)
    seen = [watch.see([(1, (900.0 + 23.0 * index, 500.0))]) for index in range(1, 16)]
    assert [1] in seen[:3] and seen.count([1]) > 5


def test_tags_that_one_hand_covered_are_found_together():
    watch, tags = Watch(), [(index, (500.0 + 100.0 * index, 500.0)) for index in range(8)]
    watch.see(tags, frames=40)
    watch.see([], frames=60)
    moved = [(index, (500.0 + 100.0 * index, 700.0)) for index in range(8)]
    seen = [watch.see(moved) for _ in range(round(0.3 / FRAME_S))]
    assert seen[-1] == list(range(8))


@pytest.mark.slow
@pytest.mark.parametrize("is_leaving", [False, True])
def test_lost_tags_cost_a_third_more_at_most(is_leaving):
    """One after another, one per second: covered for half a second, or driven out of the image."""
    tags = everywhere()[::8]
    usual, losing = Watch(), Watch()
    usual_px = losing_px = 0
    for index in range(90):
        rim, inner = tags[index // 30 % 3][0], tags[20 + index // 30][0]
        hidden = rim if is_leaving else inner
        usual.see(tags)
        losing.see([tag for tag in tags if index % 30 < 15 or tag[0] != hidden])
        if index >= 30:
            usual_px += usual.detector.searched_px
            losing_px += losing.detector.searched_px
    assert losing_px < 1.3 * usual_px


def test_small_tags_that_the_detector_misses_are_found_by_the_fine_one():
    watch = Watch(with_fine=True)
    tags = everywhere()[:100:4]
    watch.detector.blind = {tag_id for tag_id, _ in tags[::2]}
    watch.see(tags, frames=10)
    for _ in range(70):
        assert watch.see(tags) == [tag_id for tag_id, _ in tags]
    # 13 windows, and every other turn of the tiles.
    assert watch.fine.searched_px < 14 * 80**2 + 2 * 1.7 * WIDTH_PX * HEIGHT_PX / 12.0


@pytest.mark.parametrize("side_px", [18.0, 26.0, 50.0])
def test_a_tag_that_is_missed_is_found_by_a_finer_detector_at_once(side_px, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "SIDE_PX", side_px)
    watch, tags = Watch(with_fine=True, smallest_px=40.0), [(1, (800.0, 500.0))]
    watch.see(tags, frames=30)
    watch.detector.blind = watch.fine.blind = {1}
    assert all(watch.see(tags) == [1] for _ in range(70))


def note_prints(made):
    """Return a detector by a tag's print that finds nothing, and notes in made what it was asked for."""

    class Prints(NamedTuple):
        tag_id: int
        center: np.ndarray
        side_px: float
        corners: Optional[np.ndarray]

        def detect(self, gray, origin=(0, 0)):
            made.append(self)
            return []

    return Prints


@pytest.mark.slow
def test_a_tag_is_looked_for_by_its_print_with_the_heading_that_it_had():
    made, tags, expected = [], [(1, (800.0, 500.0))], {1: (801.0, 502.0, SIDE_PX)}
    detector = SeenTags()
    search = TagSearch(detector, WIDTH_PX, HEIGHT_PX, [SeenTags(), note_prints(made)], 20.0)
    detector.place(tags)
    search.search(FRAME, 0.0, expected)
    (corners,) = [tag.corners for tag in search.search(FRAME, FRAME_S, expected)]
    assert not made
    detector.blind = {1}
    search.search(FRAME, 2.0 * FRAME_S, expected)
    (print_,) = made
    assert print_.corners is corners and print_.tag_id == 1 and tuple(print_.center) == (801.0, 502.0)
    made.clear()
    for index in range(3, 40):
        search.search(FRAME, index * FRAME_S, expected)
    assert made[0].corners is corners and made[-1].corners is None and made[-1].side_px == SIDE_PX


@pytest.mark.slow
def test_a_tag_that_is_gone_is_looked_for_by_one_finer_detector_at_times():
    watch, tags = Watch(with_fine=True), everywhere()[:100:4]
    expected = dict(tags)
    watch.see(tags, expected, frames=60)
    watch.see([], expected, frames=60)
    turns = searched_px = 0
    for _ in range(60):
        watch.see([], expected)
        turns += bool(watch.fine.searched_px) + bool(watch.finest.searched_px)
        searched_px += watch.finest.searched_px
    window_px = (2.0 * (0.9 + 1.2) * SIDE_PX + 7.0) ** 2
    assert turns > 3 and searched_px < 60 * len(tags) * window_px / 10.0


@pytest.mark.slow
def test_many_tags_that_are_missed_take_turns_within_a_bounded_time():
    """Each costs 0.8 ms by the third detector; 0.4 of a core is 13 ms of an image."""
    watch, tags = Watch(with_fine=True), everywhere()[:400:8]
    watch.see(tags, frames=60)
    watch.detector.blind = watch.fine.blind = {tag_id for tag_id, _ in tags}
    seen = [watch.see(tags) for _ in range(40)]
    assert all(9 <= len(found) <= 20 for found in seen), list(map(len, seen))
    assert set().union(*seen[-8:]) == set(watch.detector.blind)
    watch.detector.blind = set()
    assert [len(watch.see(tags)) for _ in range(70)][-1] == len(tags)


@pytest.mark.slow
def test_a_tag_is_looked_for_by_its_print_in_the_size_that_is_expected():
    made = []
    search = TagSearch(SeenTags(), WIDTH_PX, HEIGHT_PX, [SeenTags(), note_prints(made)], 20.0)
    for index in range(60):
        search.search(FRAME, index * FRAME_S, {1: (801.0, 502.0, 31.0)})
    assert {(print_.side_px, print_.corners) for print_ in made} == {(31.0, None)}


def test_prints_in_any_heading_cost_five_times_as_much():
    """3 ms by the third finer detector: 7 within the 20 ms of an image, 4 or 5 within 0.4 of a core."""
    made, expected = [], {tag_id: (*place, SIDE_PX) for tag_id, place in everywhere()[:400:8]}
    fine = [SeenTags(), SeenTags(), note_prints(made)]
    search = TagSearch(SeenTags(), WIDTH_PX, HEIGHT_PX, fine, 20.0)
    counts = []
    for index in range(60):
        search.search(FRAME, index * FRAME_S, expected)
        counts.append(len(made) - sum(counts))
    first, *others = filter(None, counts)
    assert first == 7 and set(others[:-1]) == {4, 5} and sum(counts) == len(expected)


def test_a_tag_too_small_for_the_tiles_is_found_where_it_is_expected():
    watch = Watch(with_fine=True, smallest_px=16.0)
    watch.detector.blind = watch.fine.blind = {3}
    tags = [(3, (800.0, 600.0))]
    assert watch.see(tags, frames=150) == []
    assert [3] in [watch.see(tags, expected={3: (802.0, 599.0)}) for _ in range(30)]


def test_large_tags_need_no_fine_detector():
    watch = Watch(with_fine=True, smallest_px=40.0)
    watch.see(everywhere()[:100:4], frames=80)
    assert watch.fine.searched_px == 0


def test_flickering_tag_is_not_searched_around_its_place():
    watch = Watch()
    watch.see([], frames=60)
    searched_px = 0
    for index in range(120):
        watch.see([(1, (1900.0, 900.0))] if index % 3 else [])
        searched_px += watch.detector.searched_px
    assert searched_px < 2.5 * 1.7 * WIDTH_PX * HEIGHT_PX


def test_id_seen_at_two_places_comes_twice_and_both_are_followed():
    watch = Watch()
    for index in range(60):
        found = watch.see([(7, (400.0 + 4.0 * index, 400.0)), (7, (1200.0, 700.0))])
        if index > 10:
            assert found == [7, 7]


def test_neighbors_in_one_window_come_once():
    watch = Watch()
    assert watch.see([(1, (600.0, 400.0)), (2, (632.0, 400.0))], frames=20) == [1, 2]


def test_a_lost_tag_is_forgotten_after_time_has_gone_back():
    watch = Watch()
    watch.see([(1, (600.0, 400.0))], frames=300)
    watch.see([], frames=10)
    watch.index = 0
    assert watch.count_searched_px() < 1.7 * WIDTH_PX * HEIGHT_PX


def test_expected_places_out_of_the_picture_do_no_harm():
    watch = Watch()
    watch.see([(1, (600.0, 400.0))], frames=20)
    places = {1: (-500.0, 4000.0), 2: (float("nan"), 0.0), 3: (600.0, 400.0)}
    assert watch.see([], expected=places) == []


def test_frames_with_old_or_equal_stamps_are_searched_in_windows_too():
    watch = Watch()
    watch.see([(1, (600.0, 400.0))], frames=20)
    watch.index -= 2
    assert watch.see([(1, (602.0, 400.0))]) == [1]
    watch.index -= 1
    assert watch.see([(1, (602.0, 400.0))]) == [1]


def make_logged_search(center, monkeypatch):
    """Return a search that follows one tag, and the windows (left, top, width, height) that it looks into."""
    detector, windows = SeenTags(), []
    detector.place([(1, center)])
    search = TagSearch(detector, WIDTH_PX, HEIGHT_PX)
    assert [tag.tag_id for tag in search.search(FRAME, 0.0)] == [1]

    def detect(gray, origin=(0, 0)):
        windows.append((*origin, gray.shape[1], gray.shape[0]))
        return SeenTags.detect(detector, gray, origin)

    monkeypatch.setattr(detector, "detect", detect)
    return search, detector, windows


def window_round(center, half_px):
    """Return the window of so many pixels around a center, within the image."""
    (left, top), (right, bottom) = (
        [max(0, math.floor(place - half_px)) for place in center],
        [min(end, math.ceil(place + half_px)) for place, end in zip(center, (WIDTH_PX, HEIGHT_PX))],
    )
    return left, top, right - left, bottom - top


@pytest.mark.parametrize("center", [(900.3, 500.6), (20.0, 500.0), (900.0, 1060.0), (1900.0, 20.0)])
def test_windows_grow_with_the_time_since_a_tag_was_seen(center, monkeypatch):
    guess = window_round(center, (0.9 + 6.0 * 0.008) * SIDE_PX + 3.0)
    for elapsed_s in (0.01, 0.03, 0.06):
        search, detector, windows = make_logged_search(center, monkeypatch)
        search.search(FRAME, elapsed_s)
        assert windows == [guess], elapsed_s
        detector.place([])
        search.search(FRAME, 2.0 * elapsed_s)
        wide = window_round(center, (0.9 + 6.0 * elapsed_s) * SIDE_PX + 3.0)
        assert windows[:3] == [guess, guess, wide], elapsed_s
    search, detector, windows = make_logged_search(center, monkeypatch)
    stamp_s = 0.0
    # After a longer gap a narrow window comes first, and one of the whole gap where that shows nothing.
    search.search(FRAME, stamp_s + 0.09)
    narrow = window_round(center, (0.9 + 6.0 * 0.08) * SIDE_PX + 3.0)
    assert windows[0] == narrow and window_round(center, (0.9 + 6.0 * 0.09) * SIDE_PX + 3.0) not in windows
    detector.place([])
    for gap_s, sides in ((0.2, 0.9 + 1.2), (0.5, 0.9 + 2.5)):
        windows.clear()
        search.search(FRAME, stamp_s + 0.09 + gap_s)
        assert windows[0] == narrow and window_round(center, sides * SIDE_PX + 3.0) in windows, gap_s


def test_a_moving_tag_is_looked_for_where_it_is_if_it_moves_on(monkeypatch):
    search, detector, windows = make_logged_search((900.0, 500.0), monkeypatch)
    for step in (1, 2, 3):
        windows.clear()
        center = (900.0 + 10.0 * step, 500.0 - 4.0 * step)
        detector.place([(1, center)])
        assert [tag.tag_id for tag in search.search(FRAME, 0.03 * step)] == [1]
    assert windows == [window_round(center, (0.9 + 6.0 * 0.008) * SIDE_PX + 3.0)], "as wide as for one that stands"


def test_tiles_cover_the_image_with_room_for_a_tag_on_each_border():
    tiles = _list_tiles(1920, 1080)
    assert tiles[0] == (0, 0, 576, 456) and tiles[-1] == (1440, 720, 1920, 1080) and len(tiles) == 12
    assert [tile[0] for tile in tiles[:4]] == [0, 480, 960, 1440], "row by row"
    assert _list_tiles(640, 480) == [
        (0, 0, 416, 336), (320, 0, 640, 336), (0, 240, 416, 480), (320, 240, 640, 480),
    ]  # fmt: skip
    assert _list_tiles(320, 240) == [(0, 0, 320, 240)]


def test_a_turned_reference_tag_lies_wholly_in_a_tile_of_a_4k_image():
    side_px = 126.0 * 1.25 * math.sqrt(2.0)  # 100 mm from 2.2 m, with its white margin
    low, high = np.array(_list_tiles(3840, 2160))[:, :2], np.array(_list_tiles(3840, 2160))[:, 2:]
    for start in np.random.RandomState(0).uniform((0, 0), (3840 - side_px, 2160 - side_px), (2000, 2)):
        assert ((low <= start) & (start + side_px <= high)).all(axis=1).any(), start


def test_the_first_image_is_searched_as_a_whole():
    watch = Watch()
    watch.detector.place([])
    watch.see([])
    assert watch.detector.searched_px == WIDTH_PX * HEIGHT_PX


@pytest.mark.parametrize(("step_s", "sweep_s"), [(0.05, 2.0), (0.1, 2.0), (0.2, 2.0), (0.4, 4.0)])
def test_the_tiles_take_turns_within_two_seconds(step_s, sweep_s, monkeypatch):
    search, _, windows = make_logged_search((900.0, 500.0), monkeypatch)
    tiles = [(left, top, right - left, bottom - top) for left, top, right, bottom in _list_tiles(1920, 1080)]
    # A gap of more than 0.2 s counts as that.
    for frame in range(1, round(sweep_s / step_s) + 2):
        search.search(FRAME, frame * step_s)
    searched = [window for window in windows if window in tiles]
    assert searched[:12] == tiles and len(searched) <= 14


def test_a_place_out_of_the_image_does_not_end_the_search():
    watch = Watch()
    watch.see([(1, (800.0, 500.0))], frames=10)
    watch.index += 5
    assert watch.see([(1, (834.0, 500.0))], expected={1: (-300.0, 500.0)}) == [1]
