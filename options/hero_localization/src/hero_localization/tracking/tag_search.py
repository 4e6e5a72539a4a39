"""Follows tags from frame to frame in small windows, and searches the whole image for others, a tile at a time. Pure.

A detector takes 15 to 90 ms for a whole image of 1920 by 1080, by its noise and texture, and 0.1 ms for a window around
one tag. So known tags are looked for where they are expected, in every frame, and the rest of the image is searched in
turn, in two seconds. Finer detectors look where the first one found nothing: all of them for a tag that was seen a
moment ago, then one after another at longer and longer intervals; many tags that are missed take turns, so that this
does not hold up the others. Where tags are small, one of them takes every other turn of the sweep. A tag that was seen
steadily and is lost is also searched around its place, at most one image's pixels per second.
"""

import itertools
import math
from collections import defaultdict
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Type, Union

import numpy as np

from .detectors import TagDetector
from .tag_pose import TagCorners
from .tag_template import TemplateDetector

FINE_BELOW_PX = 36.0
"""In an image at half its size, tags of less than this are missed with blur and gamma."""

PATIENCE_S = 0.15
BACKOFF, MAX_BACKOFF_S = 0.2, 0.6
"""A tag that is missed for longer than the first is looked for by one finer detector at a time, at intervals of this
share of the time for which it is missed: most are covered or gone."""

FINE_COSTS_MS = (0.15, 0.8, 0.6)
"""CPU of a window by each of the finer detectors, ms; of the last one where the heading is known."""
BLIND_COST = 5.0
"""Cost of the last one for any heading, by that."""

FINE_SHARE, MAX_FINE_MS = 0.4, 20.0
"""Share of a core, and most of an image, ms, that finer detectors take: then other tags' turn is in the next one."""

FINE_S = 2.0
"""Time for which coarser detectors skip a tag that only a finer one found."""

SWEEP_S = 2.0
"""Time in which the whole image is searched."""

NEARBY_S = 3.0
NEARBY_EXPECTED_S = 1.0
"""Time for which a lost tag is searched nearby; the second where odometry gives its place: moved by hand."""

NEARBY_SIDES_S, MAX_NEARBY_SIDES = 24.0, 12.0
"""Largest distance that a tag has moved, in its sides: 1 m/s by hand at first, 0.24 m/s by itself for 2 s."""

NEARBY_IMAGES_S, NEARBY_START_IMAGES = 0.9, 0.1
"""Pixels that are searched around lost tags in a second, and at once, by those of an image."""

STEADY_S = 1.0
"""A tag that was seen for less than this is not searched when it is lost, nor one that left the image."""
RIM_SIDES = 1.5

FINE_COST = 2.5
"""Cost of the fine detector, by that of the other one, for as many pixels."""

MAX_STEP_S = 0.2
"""A longer gap between frames counts as this long, or all tiles would be searched at once."""

KEPT_S = 1.0
"""A lost tag is searched near its last place for this long; where it is expected, for ever."""

TILE_PX = (480, 360)
OVERLAP_PX, OVERLAP_SHARE = 96, 0.06
"""Overlap of neighboring tiles, the second by the width of images above 1920 px: a tag on their border, with its white
margin, lies wholly in one of them, also a turned reference tag of 100 mm 2.2 m below the camera."""

WINDOW_SIDES = 0.9
"""Half a window's side, in sides of the tag: half its diagonal, and its white margin."""
SLACK_PX = 3.0
SLACK_SIDES_S = 6.0
MAX_SLACK_SIDES = 2.5
"""A window is larger by how far the tag may have come since it was seen, 0.24 m/s for one of 40 mm."""

GUESS_S = 0.008
"""First, one for this time is tried where the tag is if it moves on as before: most do, and it costs half as much."""
STILL = np.zeros(2)

NARROW_S = 0.08
"""After a longer gap, a window for this time is tried first: on a busy machine large ones would make gaps longer."""

AnyDetector = Union[TagDetector, TemplateDetector]


class _Track(NamedTuple):
    """A tag that was seen: last at stamp_s, and in all frames from first_s on; velocity: then, px/s."""

    tag_id: int
    center: np.ndarray
    velocity: np.ndarray
    side_px: float
    stamp_s: float
    first_s: float


class _Frame:
    """One image, and the tags that were found in it so far."""

    def __init__(self, gray: np.ndarray, stamp_s: float) -> None:
        self.stamp_s = stamp_s
        self.found: Dict[int, List[TagCorners]] = {}
        self._gray = gray

    def search(self, detector: AnyDetector, left: int, top: int, right: int, bottom: int) -> List[TagCorners]:
        """Search a window, and return its tags; those that were not found in another one already are added."""
        seen = detector.detect(self._gray[top:bottom, left:right], (left, top))
        for tag in seen:
            same = self.found.setdefault(tag.tag_id, [])
            if not any(float(np.linalg.norm(other.center - tag.center)) < other.side_px / 2.0 for other in same):
                same.append(tag)
        return seen

    def search_around(
        self, detector: AnyDetector, tag_id: int, center: np.ndarray, side_px: float, half_px: float
    ) -> bool:
        """Search a square for a tag, and return whether it is there."""
        if not np.isfinite(center).all():
            return False
        height, width = self._gray.shape
        left, top = (max(0, math.floor(place - half_px)) for place in center)
        right, bottom = (min(limit, math.ceil(place + half_px)) for place, limit in zip(center, (width, height)))
        if min(right - left, bottom - top) < side_px:
            return False
        return any(tag.tag_id == tag_id for tag in self.search(detector, left, top, right, bottom))


class TagSearch:
    """Finds tags in the frames of one camera."""

    def __init__(
        self,
        detector: TagDetector,
        width_px: int,
        height_px: int,
        fine_detectors: Sequence[Union[TagDetector, Type[TemplateDetector]]] = (),
        smallest_px: float = math.inf,
    ) -> None:
        """fine_detectors: find what others miss at more cost; smallest_px: side of the smallest tag expected."""
        self._detector = detector
        self._detectors = [detector, *fine_detectors]
        finer = [fine for fine in fine_detectors[:1] if not isinstance(fine, type)]
        self._sweeps = [*finer, detector] if smallest_px < FINE_BELOW_PX else [detector]
        self._tracks: List[_Track] = []
        self._lost: Dict[int, _Track] = {}
        self._size_px = np.array((width_px, height_px))
        self._whole = (0, 0, width_px, height_px)
        self._tiles = _list_tiles(width_px, height_px)
        self._next_tile = 0
        self._due = 0.0
        self._nearby_px = 0.0
        self._previous_s: Optional[float] = None
        self._fine_ms = MAX_FINE_MS
        self._looked_s: Dict[int, float] = defaultdict(lambda: -math.inf)
        """When finer detectors looked for a tag last."""
        self._seen: Dict[int, TagCorners] = {}
        """The tags when they were found last."""
        self._hard: Dict[int, Tuple[int, float]] = {}
        """The detector that found a tag which coarser ones missed, and when; by tag."""
        self._turns: Dict[int, Tuple[int, float]] = {}
        """The finer detector whose turn it is to look for a tag that is missed, and when; by tag."""

    def search(
        self, gray: np.ndarray, stamp_s: float, expected: Optional[Mapping[int, Tuple[float, float, float]]] = None
    ) -> List[TagCorners]:
        """Return the tags found in the next frame; an id that appears twice is returned twice.

        gray: (H, W), 8 bit.
        stamp_s: when it was taken.
        expected: u, v of the centers of tags and their side (px), by id, from what is known of their robots' motion;
            others are looked for where they were.
        """
        if self._previous_s is not None and stamp_s < self._previous_s - KEPT_S:
            # Time went back, as when a recording is replayed: stamps tell no more for how long a tag is lost.
            self._tracks, self._lost, self._hard = [], {}, {}
            self._looked_s.clear()
        step_s = 0.0 if self._previous_s is None else min(max(stamp_s - self._previous_s, 0.0), MAX_STEP_S)
        self._fine_ms = min(self._fine_ms + 1e3 * FINE_SHARE * step_s, MAX_FINE_MS)
        places = {tag_id: np.array(place[:2], dtype=float) for tag_id, place in (expected or {}).items()}
        sides_px = {tag_id: side_px for tag_id, (_, _, side_px) in (expected or {}).items()}
        frame = _Frame(gray, stamp_s)
        for track in sorted(self._tracks, key=lambda track: self._looked_s[track.tag_id]):
            elapsed_s = stamp_s - track.stamp_s
            # First where it was: what is known from elsewhere is newer than the frame.
            centers = [track.center, *([places[track.tag_id]] if track.tag_id in places else [])]
            windows_s = (NARROW_S, elapsed_s) if elapsed_s > NARROW_S else (elapsed_s,)
            windows = [(center, window_s) for window_s in windows_s for center in centers]
            if elapsed_s <= NARROW_S:
                windows.insert(0, (track.center + elapsed_s * track.velocity, min(GUESS_S, elapsed_s)))
            # A tag that had to wait for its turn is not missed meanwhile.
            missed_s = min(stamp_s, self._looked_s[track.tag_id]) - track.stamp_s
            self._look_for(frame, track.tag_id, track.side_px, windows, missed_s)
        tracked = {track.tag_id for track in self._tracks}
        for tag_id in sorted(places.keys() - tracked, key=self._looked_s.__getitem__):
            # Lost for long, or too small for the tiles: where it is expected, it costs no more than a window.
            self._look_for(frame, tag_id, sides_px[tag_id], [(places[tag_id], MAX_STEP_S)], math.inf)
        for detector, tile in self._take_tiles(step_s):
            frame.search(detector, *tile)
        self._search_nearby(frame, places)
        self._follow(frame)
        self._previous_s = stamp_s
        return list(itertools.chain(*frame.found.values()))

    def _look_for(
        self, frame: _Frame, tag_id: int, side_px: float, windows: Sequence[Tuple[np.ndarray, float]], missed_s: float
    ) -> None:
        """Search windows for a tag that was missed for this long: around places, seen so many seconds ago."""
        for index in self._choose_detectors(tag_id, frame.stamp_s, missed_s):
            made = self._detectors[index]
            for center, elapsed_s in windows[-1:] if isinstance(made, type) else windows:
                slack_sides = min(SLACK_SIDES_S * max(elapsed_s, 0.0), MAX_SLACK_SIDES)
                half_px = (WINDOW_SIDES + slack_sides) * side_px + SLACK_PX
                corners = self._seen[tag_id].corners if missed_s <= PATIENCE_S else None
                detector = made(tag_id, center, side_px, corners) if isinstance(made, type) else made
                if index > 0:
                    is_blind = isinstance(made, type) and corners is None
                    self._fine_ms -= FINE_COSTS_MS[index - 1] * (BLIND_COST if is_blind else 1.0)
                    self._looked_s[tag_id] = frame.stamp_s
                if frame.search_around(detector, tag_id, center, side_px, half_px):
                    first, found_s = self._hard.get(tag_id, (0, -math.inf))
                    if index != first or frame.stamp_s >= found_s + FINE_S:
                        self._hard[tag_id] = index, frame.stamp_s
                    self._turns.pop(tag_id, None)
                    return

    def _choose_detectors(self, tag_id: int, stamp_s: float, missed_s: float) -> List[int]:
        """Return the detectors that look for a tag in this frame, in their order."""
        last, found_s = self._hard.get(tag_id, (0, -math.inf))
        first, count = last if stamp_s < found_s + FINE_S else 0, len(self._detectors)
        if self._fine_ms < 0.0:
            return [] if first else [0]
        if missed_s <= PATIENCE_S:
            return list(dict.fromkeys((first, last, *range(count))))
        turn, due_s = self._turns.get(tag_id, (max(last, 1), -math.inf))
        if count == 1 or due_s - MAX_BACKOFF_S <= stamp_s < due_s:
            return [0]
        self._turns[tag_id] = turn % (count - 1) + 1, stamp_s + min(BACKOFF * missed_s, MAX_BACKOFF_S)
        return [0, turn]

    def _take_tiles(self, step_s: float) -> List[Tuple[TagDetector, Tuple[int, int, int, int]]]:
        """Return the tiles to be searched in this frame, and the detector for each."""
        if self._previous_s is None:
            return [(self._sweeps[0], self._whole)]
        image_px = float(self._size_px.prod())
        self._nearby_px = min(self._nearby_px + NEARBY_IMAGES_S * step_s * image_px, image_px)
        self._due += len(self._tiles) * step_s / SWEEP_S
        count = min(int(self._due), len(self._tiles))
        self._due -= int(self._due)
        first, total = self._next_tile, len(self._tiles) * len(self._sweeps)
        self._next_tile = first + count
        turns = [divmod((first + index) % total, len(self._tiles)) for index in range(count)]
        return [(self._sweeps[sweep], self._tiles[tile]) for sweep, tile in turns]

    def _search_nearby(self, frame: _Frame, places: Mapping[int, np.ndarray]) -> None:
        """Search around the places of lost tags, one after another, as far as there are pixels left for it."""
        image_px = float(self._size_px.prod())
        if not self._lost:
            self._nearby_px = min(self._nearby_px, NEARBY_START_IMAGES * image_px)
        is_found = False
        for tag_id, track in list(self._lost.items()):
            if not is_found and not frame.found.keys().isdisjoint(self._lost):
                # What covered one may have covered others.
                is_found, self._nearby_px = True, image_px
            lost_s = frame.stamp_s - track.stamp_s
            if lost_s <= 0.0 or lost_s > (NEARBY_EXPECTED_S if tag_id in places else NEARBY_S):
                del self._lost[tag_id]
                continue
            if tag_id in frame.found:
                continue
            half_px = (WINDOW_SIDES + min(NEARBY_SIDES_S * lost_s, MAX_NEARBY_SIDES)) * track.side_px
            detector = self._sweeps[0] if track.side_px < FINE_BELOW_PX else self._detector
            cost_px = 4.0 * half_px**2 * (1.0 if detector is self._detector else FINE_COST)
            if cost_px > self._nearby_px:
                return
            self._nearby_px -= cost_px
            self._lost[tag_id] = self._lost.pop(tag_id)  # the next one comes first next time
            frame.search_around(detector, tag_id, track.center, track.side_px, half_px)

    def _follow(self, frame: _Frame) -> None:
        old: Dict[int, List[_Track]] = {}
        for track in self._tracks:
            old.setdefault(track.tag_id, []).append(track)
        stamp_s, self._tracks = frame.stamp_s, []
        for tag in itertools.chain(*frame.found.values()):
            center, side_px, first_s, velocity = tag.center, tag.side_px, stamp_s, STILL
            self._seen[tag.tag_id] = tag
            same = old.get(tag.tag_id)
            if same:
                index = int(np.argmin([abs(track.center - center).sum() for track in same])) if same[1:] else 0
                nearest = same.pop(index)
                is_steady = nearest.stamp_s == self._previous_s or tag.tag_id in self._lost
                first_s = nearest.first_s if is_steady else stamp_s
                if stamp_s > nearest.stamp_s:
                    velocity = (center - nearest.center) / (stamp_s - nearest.stamp_s)
            self._tracks.append(_Track(tag.tag_id, center, velocity, side_px, stamp_s, first_s))
            self._lost.pop(tag.tag_id, None)
        for track in itertools.chain(*old.values()):
            if stamp_s - track.stamp_s > KEPT_S:
                continue
            self._tracks.append(track)
            rim_px = np.minimum(track.center, self._size_px - track.center).min()
            is_new = track.stamp_s == self._previous_s
            if is_new and track.stamp_s - track.first_s >= STEADY_S and rim_px > RIM_SIDES * track.side_px:
                self._lost[track.tag_id] = track


def _list_tiles(width_px: int, height_px: int) -> List[Tuple[int, int, int, int]]:
    """Return left, top, right and bottom of tiles that cover the image."""
    edges = [
        [round(size * index / math.ceil(size / tile)) for index in range(math.ceil(size / tile) + 1)]
        for size, tile in zip((width_px, height_px), TILE_PX)
    ]
    overlap_px = round(max(OVERLAP_PX, OVERLAP_SHARE * width_px)) if width_px > 1920 else OVERLAP_PX
    return [
        (left, top, min(right + overlap_px, width_px), min(bottom + overlap_px, height_px))
        for top, bottom in zip(edges[1], edges[1][1:])
        for left, right in zip(edges[0], edges[0][1:])
    ]
