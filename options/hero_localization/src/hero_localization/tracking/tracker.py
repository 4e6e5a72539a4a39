"""Turns the images of one camera into poses in `map`, and what is wrong with camera and tags. Pure."""

import math
from collections import deque
from typing import Deque, Dict, List, Mapping, NamedTuple, Optional, Sequence, Set, Tuple

import numpy as np

from hero_node import Pose, measure_distance, transform_pose

from ..camera.camera_model import Camera
from .camera_shift import CameraShift
from .settings import Settings
from .tag_pose import Sightings, TagCorners, find_smallest_side, locate

RATE_FRAMES = 30

KEPT_S = 2.0
"""A problem of a tag is named for this long after it was last seen."""

MOVED_M = 0.005
"""A camera turned by a tenth of a degree shifts everything by 4 mm."""

MOVED_S, TAG_MOVED_S = 0.5, 2.0
"""A camera that shakes is no camera that moved; nor did a tag, where all show a small shift of the camera by then."""

MIN_REFERENCES = 2
"""Reference tags in one image that are needed to tell whether the camera moved."""

EXPECTED_FRAMES, MAX_MISSED_SHARE = 60, 0.2
"""A tag that is missed in a larger share of this many images in which it is expected is named."""

MISSING_S = 5.0
"""A hand that covers a reference tag goes away sooner."""

MIN_USED_SHARE = 0.8
"""Share of the images; tags that are searched less often move further between two searches."""

MIN_SIDE_PX = 14.0
"""Length of a tag's side; one cell of 36h11 is an eighth of it."""

MARGIN_PX = 40.0
"""A tag that is expected nearer to the border than this need not be seen."""

SHIFTED_M, WRONG_M = 0.001, 0.002
"""A camera that moved by more since its calibration is named, though poses are corrected; so is a tag that did."""

DARK, BRIGHT = 35.0, 225.0
"""Limits of the mean shade, of 255."""

MAX_NOISE = 12.0
"""Standard deviation of pixels, of 255: with 20, a tag in fifty is missed in each image."""

BLUR_PX, BLUR_CELLS = 0.35, 0.35
"""Most blur (standard deviation), in pixels and in cells of a tag, as the sum of both: a sharp image has two thirds."""

CROSS = np.array(((-1.0, 0.0), (0.0, 1.0), (1.0, 0.0), (0.0, -1.0)))
"""Ends of a cross through the middles of a square's sides, by half a side."""

PERIOD_IMAGES, MAX_TAGS, MIN_TAGS = 30, 7, 3
CELLS = 8


class Problem(NamedTuple):
    """A problem of the camera, or of "tag 17", that users should solve; is_error: without that, poses are not right."""

    name: str
    text: str
    is_error: bool


class Tracker:
    """One camera.

    camera: lens and place, which follows small shifts that the reference tags show.
    found: the tags in the last image.
    sightings: what they stand for.
    smallest_px: side of the smallest robot's tag that lies wholly in the image.
    quality: light, noise and blur of its images.
    is_moved: whether most reference tags were not at their places when they were seen last: no pose is right.
    """

    def __init__(self, settings: Settings, camera: Camera) -> None:
        """camera: lens and place."""
        self.found: Sequence[TagCorners] = ()
        self.sightings: Optional[Sightings] = None
        self._settings = settings
        self.camera = camera
        self.smallest_px = find_smallest_side(camera, settings.layout.size_m, settings.layout.height_m)
        self._images: Deque[Tuple[float, int]] = deque(maxlen=RATE_FRAMES)
        self.quality = ImageQuality()
        self._shift = CameraShift(camera, settings.seen_references)
        self._tag_problems: Dict[int, Tuple[float, str]] = {}
        self.is_moved = False
        self._expected: Dict[int, Deque[bool]] = {}
        self._moved_since_s: Dict[int, float] = {}
        self._reference_seen_s: Dict[int, float] = {}

    def take(
        self,
        tags: Sequence[TagCorners],
        stamp_s: float,
        number: int,
        expected: Optional[Mapping[int, Tuple[float, float, float]]] = None,
    ) -> Sightings:
        """Return what the tags of the next image stand for.

        stamp_s: as the image bears it; number: counts the camera's images, with those that were left out; expected:
        as project() tells.
        """
        self._note_expected({tag.tag_id for tag in tags}, expected or {})
        self._images.append((stamp_s, number))
        self.found = tags
        calibration_sd_m = math.hypot(self._settings.arena_sd_m, self._shift.rest_m)
        self.sightings = sightings = locate(self.camera, tags, self._settings.layout, calibration_sd_m)
        self._note_problems(sightings, stamp_s)
        if not self.is_moved:
            self._shift.add(tags, stamp_s)
            self.camera = self._shift.camera
        return sightings

    def taken_s(self, stamp_s: float) -> float:
        """Return when an image was taken: its stamp, less the delay that the robots' calibration found; at least 0."""
        return max(0.0, stamp_s - self._settings.delay_s)

    def project(self, robots: Mapping[int, Pose]) -> Dict[int, Tuple[float, float, float]]:
        """Return u and v of the centers of the tags of robots at these poses in map, and their side, px, by tag."""
        layout = self._settings.layout
        tags = layout.find_tags(robots)
        if not tags:
            return {}
        places = [transform_pose(robots[robot], layout.find_mount(tag_id)) for robot, tag_id in tags.items()]
        points_m = np.full((len(places), 4, 3), layout.height_m)
        points_m[:, :, :2] = np.array(places)[:, None, :2] + layout.size_m / 2.0 * CROSS
        ends = self.camera.project(points_m)
        one, other = ends[:, 0] - ends[:, 2], ends[:, 1] - ends[:, 3]  # diagonals, as long as a side
        sides_px = np.sqrt(np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]))
        found = np.column_stack((ends.mean(axis=1), sides_px)).tolist()
        return {tag_id: (u, v, side) for tag_id, (u, v, side) in zip(tags.values(), found) if math.isfinite(u + v)}

    def _note_expected(self, seen: Set[int], expected: Mapping[int, Tuple[float, float, float]]) -> None:
        right_px, low_px = self.camera.lens.width_px - MARGIN_PX, self.camera.lens.height_px - MARGIN_PX
        for tag_id, (u, v, _) in expected.items():
            if MARGIN_PX < u < right_px and MARGIN_PX < v < low_px:
                self._expected.setdefault(tag_id, deque(maxlen=EXPECTED_FRAMES)).append(tag_id in seen)
            else:
                self._expected.pop(tag_id, None)

    def _note_problems(self, sightings: Sightings, stamp_s: float) -> None:
        note = self._tag_problems
        for tag_id in sightings.unknown:
            note[tag_id] = (stamp_s, "is assigned to no robot, object or reference: name it in the camera file")
        for tag_id in sightings.doubled:
            note[tag_id] = (stamp_s, "appears more than once in the image and is ignored: remove one")
        for tag_id, share in sightings.misshapen.items():
            text = "measures %.0f %% of its size: print it at 100 %%, set tag_size_m, or list it in references"
            note[tag_id] = (stamp_s, text % (100.0 * share))
        seen = {tag_id: sighting.pose for tag_id, sighting in sightings.references.items()}
        moved = find_moved_references(seen, self._settings.seen_references)
        known = seen.keys() & self._settings.seen_references.keys()
        if len(known) >= MIN_REFERENCES:
            self.is_moved = 2 * len(moved) > len(known)
        for tag_id in known:
            since_s = self._moved_since_s.get(tag_id, math.inf)
            self._moved_since_s[tag_id] = min(since_s, stamp_s) if tag_id in moved else math.inf
        for tag_id in self._settings.seen_references:
            # Time goes back when a recording is played again.
            is_new = not self._reference_seen_s.get(tag_id, math.inf) <= stamp_s
            if is_new or tag_id in seen or tag_id in sightings.doubled:
                self._reference_seen_s[tag_id] = stamp_s

    @property
    def rates_hz(self) -> Tuple[float, float]:
        """Images per second that were used, and those that the camera sent."""
        if len(self._images) < 2 or self._images[-1][0] <= self._images[0][0]:
            return 0.0, 0.0
        (first_s, first), (last_s, last) = self._images[0], self._images[-1]
        used = len(self._images) - 1
        return used / (last_s - first_s), max(used, last - first) / (last_s - first_s)

    def describe_rate(self) -> str:
        """Return how many images per second are used, and of how many if some are not."""
        used_hz, sent_hz = self.rates_hz
        return "%.1f%s images per second" % (used_hz, "" if used_hz == sent_hz else " of %.1f" % sent_hz)

    def list_problems(self) -> List[Problem]:
        """Return what is wrong with light, camera and tags."""
        newest_s = self._images[-1][0] if self._images else -math.inf
        problems: List[Problem] = []

        def add(text: str, tag_id: Optional[int] = None, is_error: bool = False) -> None:
            problems.append(Problem("camera" if tag_id is None else "tag %d" % tag_id, text, is_error))

        used_hz, sent_hz = self.rates_hz
        if used_hz < MIN_USED_SHARE * sent_hz and len(self._images) == RATE_FRAMES:
            add(f"{self.describe_rate()} are used: this computer is busy, or too slow for more")
        sides_px = [tag.side_px for tag in self.found if self._settings.layout.find_robot(tag.tag_id) is not None]
        smallest_px = min(sides_px, default=self.smallest_px)
        for text, is_error in self.quality.list_problems(smallest_px):
            add(text, is_error=is_error)
        if self._shift.shift_m > SHIFTED_M:
            text = f"the camera has moved by {1e3 * self._shift.shift_m:.0f} mm at the field's rim, which is corrected"
            add(text + ": calibrate the arena again soon")
        if smallest_px < MIN_SIDE_PX:
            text = "tags measure only %.0f px, less than %.0f: mount the camera lower, or print larger tags"
            add(text % (smallest_px, MIN_SIDE_PX))
        missed = [
            str(tag_id)
            for tag_id, seen in sorted(self._expected.items())
            if len(seen) == EXPECTED_FRAMES and seen.count(False) > MAX_MISSED_SHARE * EXPECTED_FRAMES
        ]
        if missed:
            text = "tags %s are often missed where their robots are: occluded, too dark, too small, or removed?"
            add(text % ", ".join(missed))
        wrong_id, off_m = self._shift.wrong or (-1, 0.0)
        if WRONG_M < off_m <= MOVED_M:
            text = "this reference tag moved by %.0f mm, and does not count: put it back, or calibrate the arena again"
            add(text % (1e3 * off_m), wrong_id)
        moved_s = MOVED_S if self.is_moved else TAG_MOVED_S
        moved = [tag_id for tag_id, since_s in self._moved_since_s.items() if since_s <= newest_s - moved_s]
        if moved and self.is_moved:
            add("reference tags are not where they were: the camera moved; calibrate the arena again", is_error=True)
        for tag_id in [] if self.is_moved else moved:
            add("this reference tag moved: put it back, or calibrate the arena again", tag_id)
        missing = sorted(tag_id for tag_id, at_s in self._reference_seen_s.items() if at_s < newest_s - MISSING_S)
        if len(missing) * 2 > len(self._reference_seen_s):
            text = "%d of %d reference tags are not seen: is there light enough, and did the camera move?"
            add(text % (len(missing), len(self._reference_seen_s)))
        else:
            for tag_id in missing:
                add("this reference tag is not seen: is it occluded, removed, or too dark?", tag_id)
        for tag_id, (stamp_s, text) in sorted(self._tag_problems.items()):
            if abs(newest_s - stamp_s) <= KEPT_S:  # time goes back when a recording is played again
                add(text, tag_id)
        return problems


def find_moved_references(seen: Mapping[int, Pose], at_calibration: Mapping[int, Pose]) -> Set[int]:
    """Return the reference tags that are not seen where the calibration saw them; all of them: the camera moved."""
    known = seen.keys() & at_calibration.keys()
    return {tag_id for tag_id in known if not measure_distance(at_calibration[tag_id], seen[tag_id]) <= MOVED_M}


class ImageQuality:
    """Faults of the images of one camera."""

    def __init__(self) -> None:
        self._shade = self._noise = self._blur_px = math.nan
        self._images = 0

    def measure(self, gray: np.ndarray, tags: Sequence[TagCorners]) -> None:
        """Look at an image (H, W), 8 bit; tags: those in the one before."""
        self._images += 1
        if self._images % PERIOD_IMAGES == 1:
            self._shade = float(gray[::16, ::16].mean())
            self._noise = float(np.median(np.abs(np.diff(gray[::16].astype(np.int16), axis=1)))) / 0.954
            blurs_px = [_measure_blur(gray, tag.center, tag.side_px) for tag in tags[:MAX_TAGS]]
            self._blur_px = float(np.median(blurs_px)) if len(blurs_px) >= MIN_TAGS else math.nan

    def list_problems(self, smallest_px: float) -> List[Tuple[str, bool]]:
        """Return problems as text, and whether tags are surely missed; smallest_px: side of the smallest tag."""
        problems = []
        if self._shade < DARK or self._shade > BRIGHT:
            kind, remedy = ("dark", "more") if self._shade < DARK else ("bright", "less")
            text = f"images are too {kind} (mean {self._shade:.0f} of 255): give {remedy} light or exposure"
            problems.append((text, True))
        if self._noise > MAX_NOISE:
            text = "it is too dark, images are noisy (%.0f of 255): give more light, and the camera less gain"
            problems.append((text % self._noise, False))
        if self._blur_px > BLUR_PX + BLUR_CELLS * smallest_px / CELLS:
            problems.append((f"images are blurred by {self._blur_px:.1f} px: set the focus, clean the lens", False))
        return problems


def _measure_blur(gray: np.ndarray, center: np.ndarray, side_px: float) -> float:
    """Return the blur (standard deviation, px) of the steepest edges of a tag."""
    half_px = max(4, round(side_px / 2.0))
    u, v = (max(half_px, int(place)) for place in center)
    window = gray[v - half_px : v + half_px, u - half_px : u + half_px].astype(float)
    if min(window.shape) < 3:
        return math.nan
    steepest = float(np.percentile(np.hypot(*np.gradient(window)), 98))
    low, high = np.percentile(window, (3, 97))
    return float(high - low) / (math.sqrt(math.tau) * max(steepest, 1e-3))
