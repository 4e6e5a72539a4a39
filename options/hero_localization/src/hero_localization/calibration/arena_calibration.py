"""The camera pose (extrinsics) from reference tags of known place. Pure."""

import itertools
import math
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from hero_node import Pose, measure_distance

from ..camera.camera_model import Camera, Intrinsics, solve_camera
from ..errors import CalibrationError
from ..prints.tag_images import REFERENCE_SIZE_M
from ..tracking.tag_pose import TagCorners, fit_squares, list_corners

MIN_TAGS = 4
MIN_EXTENT_M = 0.3
"""Tags in a row leave the camera free to swing about it."""

GOOD_RESIDUAL_M = 0.003
WORST_RESIDUAL_M = 0.006
"""Places that were measured with a tape are good to 2 mm."""

WRONG_PLACE_M = 0.004
WRONG_GAIN, LEFT_OUT_GAIN = 4.0, 10.0
"""A tag is wrong that lies this far from where all others put it if without it the squared residuals sink, per degree
of freedom, by this many times what remains (F statistic); it is left out from the second on. With a tape of 2 mm, a tag
that is right reaches the second in one of ten arenas."""

MIN_RESIDUAL_M = 0.0005
"""Residual, in x and y each, that tapes leave at least: fewer tags than that many would claim less by chance."""

AMBIGUOUS_M2 = 2e-6
"""Two tags may both be the wrong one if, without either, the others' squared residuals sum up to less than this apart:
with places right to 0.7 mm in x and y, another tag than the wrong one of five would be named in a tenth of cases."""

SUSPICIOUS_RMS_M = 0.02
"""No tape is so wrong at all tags."""

GOOD_SCALE_ERROR, MAX_SCALE_ERROR = 0.003, 0.007
"""A tag of 65 px is measured to 0.1 %, whatever the gamma."""
HEIGHTS_M = (0.2, 20.0)
MAX_FIELD_M = 30.0

_YAW_ROUNDS = 4
_SEEN_SHARE = 0.5
"""A tag must be found in at least this share of the frames."""


class ArenaCalibration(NamedTuple):
    """The calibrated camera, and what speaks against using it.

    residuals_m: how far each reference tag is seen from the place it was given, by id.
    left_out: ids of tags that were left out, as they contradict all others.
    """

    camera: Camera
    residuals_m: Dict[int, float]
    left_out: List[int]
    problems: List[str]

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals of the tags used."""
        return _compute_rms(self.residuals_m, self.left_out)

    @property
    def sd_m(self) -> float:
        """Standard deviation of places in the field, in x and y each, by the errors of the tags' places."""
        count = len(self.residuals_m) - len(self.left_out)  # of which the camera's six numbers leave 2 * count - 6 free
        return self.rms_m * math.sqrt(1.5 / (count - 3.0))


def average_tags(frames: Sequence[Sequence[TagCorners]]) -> List[TagCorners]:
    """Return the median corners of the tags that most frames show exactly once."""
    seen: Dict[int, List[np.ndarray]] = {}
    for tags in frames:
        ids = [tag.tag_id for tag in tags]
        for tag in tags:
            if ids.count(tag.tag_id) == 1:
                seen.setdefault(tag.tag_id, []).append(tag.corners)
    return [
        TagCorners(tag_id, np.median(corners, axis=0))
        for tag_id, corners in sorted(seen.items())
        if len(corners) >= _SEEN_SHARE * len(frames)
    ]


def calibrate_arena(
    lens: Intrinsics, tags: Sequence[TagCorners], references: Mapping[int, Pose], size_m: float = REFERENCE_SIZE_M
) -> ArenaCalibration:
    """Return the camera pose from the image of the reference tags, of size_m; other tags are ignored.

    Only the places of the tags' centers count; their yaw is found with the camera.

    Raises: CalibrationError if fewer than four reference tags are seen, all lie in a row, or the places cannot be
        right; if one mistake explains them (y the wrong way, swapped tags, scale, units), it is named.
    """
    image = _Image(lens, [tag for tag in tags if tag.tag_id in references], references, size_m)
    seen = image.tags
    missing = sorted(set(references) - {tag.tag_id for tag in seen})
    if len(seen) < MIN_TAGS:
        text = "the camera sees %d of %d reference tags, not %s: it takes %d; are they in the image, whole, and lit?"
        raise CalibrationError(text % (len(seen), len(references), ", ".join(map(str, missing)) or "more", MIN_TAGS))
    _check_extent(seen, references)
    fit = image.fit()
    if fit is None or fit[1] > SUSPICIOUS_RMS_M:
        _refuse_mistakes(image)
    if fit is None:
        raise CalibrationError(
            "no camera above the floor sees the reference tags like this: check the ids and places in the camera file"
        )
    (camera, rms_m), left_out = fit, []  # type: Tuple[Camera, float], List[int]
    suspects, off_m, camera_without = _find_wrong_tag(image, rms_m)
    if camera_without is not None:
        camera, left_out = camera_without, suspects
    residuals_m = measure_residuals(camera, seen, references)
    problems = _judge(residuals_m, left_out, missing)
    if suspects and not left_out:
        text = "tag %s is about %.0f mm from its place: measure them again"
        problems.insert(0, text % (" or ".join(map(str, suspects)), 1e3 * off_m))
    if _compute_rms(residuals_m, left_out) < WORST_RESIDUAL_M:  # or it is no matter of scale
        problems += _check_sizes(camera, [tag for tag in seen if tag.tag_id not in left_out], size_m)
    if len(seen) == MIN_TAGS:
        problems.append("four reference tags cannot be checked: one that is 5 mm off goes unnoticed; add two")
    return ArenaCalibration(camera, residuals_m, left_out, problems)


class _Image(NamedTuple):
    """The reference tags in an image, and what is known of them and of the lens."""

    lens: Intrinsics
    tags: Sequence[TagCorners]
    references: Mapping[int, Pose]
    size_m: float

    def fit(self) -> Optional[Tuple[Camera, float]]:
        """Return the camera above the floor that sees the tags best like this, and the residuals' rms, m; else None."""
        known = [self.references[tag.tag_id] for tag in self.tags]
        # The yaws are not known: centers first.
        points_m = np.array([(*pose[:2], 0.0) for pose in known])
        pixels = np.array([tag.center for tag in self.tags])
        for _ in range(_YAW_ROUNDS):
            camera = solve_camera(self.lens, pixels, points_m)
            if camera is None:
                return None
            yaws_rad = [fit.pose.yaw_rad for fit in fit_squares(camera, self.tags, 0.0)]
            turned = [pose._replace(yaw_rad=yaw_rad) for pose, yaw_rad in zip(known, yaws_rad)]
            points_m = np.vstack([list_corners(pose, self.size_m, 0.0) for pose in turned])
            pixels = np.vstack([tag.corners for tag in self.tags])
        assert camera is not None
        if not HEIGHTS_M[0] <= camera.position_m[2] <= HEIGHTS_M[1]:
            return None
        return camera, _compute_rms(measure_residuals(camera, self.tags, self.references), ())


def _refuse_mistakes(image: _Image) -> None:
    """Try mistakes that users make with places. Raises: CalibrationError that names those that explain all."""
    references = image.references
    mirrored = {tag_id: Pose(pose.x_m, -pose.y_m, 0.0) for tag_id, pose in references.items()}
    tried = [("y the wrong way (seen from above, y points left of x)", mirrored)]
    for one, other in itertools.combinations(sorted(tag.tag_id for tag in image.tags), 2):
        swapped = {**references, one: references[other], other: references[one]}
        tried.append(("tags %d and %d swapped" % (one, other), swapped))
    causes = []
    for cause, places in tried:
        fit = image._replace(references=places).fit()
        if fit is not None and fit[1] < WORST_RESIDUAL_M:
            causes.append(cause)
    if causes:
        raise CalibrationError(f"the places of the reference tags have {', or '.join(causes)}: correct them")


def _find_wrong_tag(image: _Image, rms_m: float) -> Tuple[List[int], float, Optional[Camera]]:
    """Return the tags of which one contradicts all others, how far (m) the likeliest is off, the camera without it.

    No tags: none is wrong, or there is none to spare. No camera: chance may explain it, or another tag.
    """
    count, cameras, sums_m2 = len(image.tags), {}, {}  # type: int, Dict[int, Camera], Dict[int, float]
    for tag in image.tags if count > MIN_TAGS else ():
        fit = image._replace(tags=[other for other in image.tags if other is not tag]).fit()
        if fit is not None:
            cameras[tag.tag_id], sums_m2[tag.tag_id] = fit[0], (count - 1) * fit[1] ** 2
    if not cameras:
        return [], 0.0, None
    suspects = sorted(sums_m2, key=sums_m2.__getitem__)
    camera, rest_m2 = cameras[suspects[0]], sums_m2[suspects[0]]
    off_m = measure_residuals(camera, image.tags, image.references)[suspects[0]]
    gain = (count * rms_m**2 - rest_m2) / 2.0 / max(rest_m2 / (2.0 * count - 8.0), MIN_RESIDUAL_M**2)
    if not (off_m > WRONG_PLACE_M and gain > WRONG_GAIN):
        return [], 0.0, None
    suspects = [tag_id for tag_id in suspects if sums_m2[tag_id] <= rest_m2 + AMBIGUOUS_M2]
    return suspects, off_m, camera if len(suspects) == 1 and gain > LEFT_OUT_GAIN else None


def _check_sizes(camera: Camera, tags: Sequence[TagCorners], size_m: float) -> List[str]:
    """Compare the tags' measured size with the printed one; return what is wrong. Raises: CalibrationError."""
    share = float(np.median([fit.size_m / size_m for fit in fit_squares(camera, tags, 0.0)]))
    text = "reference tags measure %.1f %% of their size: measure the places again, is the tape right? and the side of"
    text = text % (100.0 * share) + " a black square (reference_size_m)"
    if not abs(share - 1.0) <= MAX_SCALE_ERROR:
        raise CalibrationError(text)
    return [] if abs(share - 1.0) <= GOOD_SCALE_ERROR else [text]


def _judge(residuals_m: Mapping[int, float], left_out: Sequence[int], missing: Sequence[int]) -> List[str]:
    problems = [
        "tag %d was left out: it is seen %.0f mm from its place; measure that again"
        % (tag_id, 1e3 * residuals_m[tag_id])
        for tag_id in left_out
    ]
    for tag_id, residual_m in sorted(residuals_m.items()):
        if tag_id not in left_out and residual_m > WORST_RESIDUAL_M:
            problems.append("tag %d is seen %.0f mm from its place; measure that again" % (tag_id, 1e3 * residual_m))
    if missing:
        problems.append(f"not seen: reference tags {', '.join(map(str, missing))}")
    rms_m = _compute_rms(residuals_m, left_out)
    if rms_m > GOOD_RESIDUAL_M:
        text = "residual %.1f mm rms is above %.0f mm: check all places, the tags' size, and the lens calibration"
        problems.append(text % (1e3 * rms_m, 1e3 * GOOD_RESIDUAL_M))
    return problems


def _compute_rms(residuals_m: Mapping[int, float], left_out: Sequence[int]) -> float:
    used_m = [residual_m for tag_id, residual_m in residuals_m.items() if tag_id not in left_out]
    return math.sqrt(sum(residual_m**2 for residual_m in used_m) / len(used_m))


def _check_extent(seen: Sequence[TagCorners], references: Mapping[int, Pose]) -> None:
    places_m = np.array([references[tag.tag_id][:2] for tag in seen])
    extent_m = float(np.ptp(places_m, axis=0).max())
    if extent_m > MAX_FIELD_M:
        raise CalibrationError(f"the reference tags lie {extent_m:g} m apart: write their places in m, not in mm or cm")
    spread_m = np.linalg.svd(places_m - places_m.mean(axis=0), compute_uv=False)
    if spread_m[1] < MIN_EXTENT_M:
        raise CalibrationError("all reference tags lie in a row: spread them over the field, best into its corners")


def measure_residuals(camera: Camera, seen: Sequence[TagCorners], references: Mapping[int, Pose]) -> Dict[int, float]:
    """Return how far (m) from its place each reference tag is seen, by id."""
    fits = fit_squares(camera, [tag for tag in seen if tag.tag_id in references], 0.0)
    return {fit.tag_id: measure_distance(fit.pose, references[fit.tag_id]) for fit in fits}
