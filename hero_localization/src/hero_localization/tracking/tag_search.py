"""Follows tags from frame to frame in small windows, and searches the whole picture for others, a tile at a time. Pure.

A detector takes 90 ms for a whole picture of 1920 by 1080 and 0.2 ms for a window around one tag. So known tags are
looked for where they are expected, in every frame, and the rest of the picture is searched in turn: in two seconds, or
in a fraction of one while a tag that was seen steadily is lost.
"""

import math
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from .detectors import TagDetector
from .tag_corners import TagCorners

__all__ = ["TagSearch"]

SWEEP_S = 2.0
HURRIED_SWEEP_S = 0.15
"""How long a search of the whole picture takes, and how long while a tag is lost."""

HURRY_S = 3.0
"""So long a lost tag is searched in a hurry."""

STEADY_S = 1.0
"""A tag that was seen for less than this is not searched in a hurry: at the rim, tags come and go."""

LONGEST_STEP_S = 0.2
"""A longer gap between frames counts as this long, or all tiles would be searched at once."""

KEPT_S = 1.0
"""A lost tag is looked for near the place where it was for so long; where it is expected, for ever."""

TILE_PX = (480, 360)
OVERLAP_PX = 96
"""Of neighboring tiles: a tag on their border, with its white margin, lies wholly in one of them."""

WINDOW_SIDES = 0.9
"""Half a window's side, in sides of the tag: half its diagonal, and its white margin."""
SLACK_PX = 3.0
SLACK_SIDES_S = 6.0
MOST_SLACK_SIDES = 2.5
"""A window is larger by how far the tag may have come since it was seen, 0.24 m/s for one of 40 mm: that costs less
than the window that a guess of its motion would need when it turns."""

NARROW_S = 0.08
"""After a longer gap, a window for this time is tried first: on a busy machine large ones would make gaps longer."""


class _Track(NamedTuple):
    """A tag that was seen: last at stamp_s, and in all frames from first_s on."""

    tag_id: int
    center: np.ndarray
    side_px: float
    stamp_s: float
    first_s: float


class TagSearch:
    """Finds tags in the frames of one camera."""

    def __init__(
        self, detector: TagDetector, width_px: int, height_px: int, overlap_px: int = OVERLAP_PX
    ) -> None:
        self._detector = detector
        self._tracks: List[_Track] = []
        self._tiles = _list_tiles(width_px, height_px, overlap_px)
        self._next_tile = 0
        self._due = 0.0
        self._hurry_until_s = -math.inf
        self._previous_s: Optional[float] = None
        self._sides_px: Dict[int, float] = {}

    def search(
        self, gray: np.ndarray, stamp_s: float, expected: Optional[Mapping[int, Tuple[float, float]]] = None
    ) -> List[TagCorners]:
        """Return the tags found in the next frame; an id that is there twice comes twice.

        Args:
            gray: (H, W), 8 bit.
            stamp_s: when it was taken.
            expected: pixels where the centers of tags should be, by id, from what is known of their robots' motion;
                others are looked for where they were.
        """
        if self._previous_s is not None and stamp_s < self._previous_s - KEPT_S:
            # Time went back, as when a recording is replayed: stamps tell no more for how long a tag is lost.
            self._tracks, self._hurry_until_s = [], -math.inf
        places: Dict[int, Sequence[float]] = dict(expected or {})
        found: List[TagCorners] = []
        for track in self._tracks:
            place, count, elapsed_s = places.pop(track.tag_id, None), len(found), stamp_s - track.stamp_s
            for window_s in (NARROW_S, elapsed_s) if elapsed_s > NARROW_S else (elapsed_s,):
                # First where it was: what is known from elsewhere is newer than the frame.
                self._look_at(gray, track.center, track.side_px, window_s, found)
                if place is not None and all(tag.tag_id != track.tag_id for tag in found):
                    self._look_at(gray, np.asarray(place, dtype=float), track.side_px, window_s, found)
                if len(found) > count:
                    break
        for tag_id, place in places.items():
            # Lost for long: where it is expected, it costs no more than a window.
            if tag_id in self._sides_px:
                center = np.asarray(place, dtype=float)
                self._look_at(gray, center, self._sides_px[tag_id], LONGEST_STEP_S, found)
        for left, top, right, bottom in self._take_tiles(stamp_s):
            _add_new(found, self._detector.detect(gray[top:bottom, left:right], (left, top)))
        self._follow(found, stamp_s)
        self._previous_s = stamp_s
        return found

    def _look_at(
        self, gray: np.ndarray, center: np.ndarray, side_px: float, elapsed_s: float, found: List[TagCorners]
    ) -> None:
        slack_sides = min(SLACK_SIDES_S * max(elapsed_s, 0.0), MOST_SLACK_SIDES)
        half_px = (WINDOW_SIDES + slack_sides) * side_px + SLACK_PX
        if not np.isfinite(center).all():
            return
        height, width = gray.shape
        left, top = (max(0, math.floor(place - half_px)) for place in center)
        right, bottom = (
            min(limit, math.ceil(place + half_px)) for place, limit in zip(center, (width, height))
        )
        if min(right - left, bottom - top) >= side_px:
            _add_new(found, self._detector.detect(gray[top:bottom, left:right], (left, top)))

    def _take_tiles(self, stamp_s: float) -> List[Tuple[int, int, int, int]]:
        """Return the tiles to be searched in this frame."""
        if self._previous_s is None:
            self._previous_s = stamp_s
            return self._tiles
        elapsed_s = min(max(stamp_s - self._previous_s, 0.0), LONGEST_STEP_S)
        is_hurried = stamp_s <= self._hurry_until_s
        self._due += len(self._tiles) * elapsed_s / (HURRIED_SWEEP_S if is_hurried else SWEEP_S)
        count = min(int(self._due), len(self._tiles))
        self._due -= int(self._due)
        first = self._next_tile
        self._next_tile = (first + count) % len(self._tiles)
        return [self._tiles[(first + index) % len(self._tiles)] for index in range(count)]

    def _follow(self, found: List[TagCorners], stamp_s: float) -> None:
        old = list(self._tracks)
        self._tracks = []
        for tag in found:
            center, side_px, first_s = tag.center, tag.side_px, stamp_s
            self._sides_px[tag.tag_id] = side_px
            same = [track for track in old if track.tag_id == tag.tag_id]
            if same:
                nearest = min(same, key=lambda track: float(abs(track.center - center).sum()))
                old = [track for track in old if track is not nearest]
                first_s = nearest.first_s if nearest.stamp_s == self._previous_s else stamp_s
            self._tracks.append(_Track(tag.tag_id, center, side_px, stamp_s, first_s))
        for track in old:
            if stamp_s - track.stamp_s > KEPT_S:
                continue
            self._tracks.append(track)
            if track.stamp_s - track.first_s >= STEADY_S:
                self._hurry_until_s = max(self._hurry_until_s, track.stamp_s + HURRY_S)


def _list_tiles(width_px: int, height_px: int, overlap_px: int) -> List[Tuple[int, int, int, int]]:
    """Return left, top, right and bottom of tiles that cover the picture."""
    edges = [
        [round(size * index / math.ceil(size / tile)) for index in range(math.ceil(size / tile) + 1)]
        for size, tile in zip((width_px, height_px), TILE_PX)
    ]
    return [
        (left, top, min(right + overlap_px, width_px), min(bottom + overlap_px, height_px))
        for top, bottom in zip(edges[1], edges[1][1:])
        for left, right in zip(edges[0], edges[0][1:])
    ]


def _add_new(found: List[TagCorners], seen: List[TagCorners]) -> None:
    """Add to found the tags that were not found in another window already."""
    for tag in seen:
        same = (other for other in found if other.tag_id == tag.tag_id)
        if not any(float(np.linalg.norm(other.center - tag.center)) < other.side_px / 2.0 for other in same):
            found.append(tag)
