"""Tags in gray images: two detectors behind one interface, with the same corners, the same order, the same heading.

Corners are in OpenCV's pixels (the center of the first pixel is (0, 0)), in the order upper left, upper right, lower
right, lower left of the tag as AprilTag's own images show it upright. What the libraries do differently:
python3-apriltag puts pixel centers at half integers and begins at the lower left; OpenCV 4 has all AprilTags turned by
180 degrees, and rounds edges inwards by half a pixel unless it refines them.
"""

from importlib.util import find_spec
from typing import Dict, List, NamedTuple, Optional, Tuple, Type, Union

import cv2
import numpy as np

from ..errors import DetectorError
from ..prints.tag_images import FAMILIES, draw_tag
from .tag_pose import TagCorners
from .tag_template import TemplateDetector

_MIN_MARGIN = {"36h11": 10.0, "16h5": 30.0}
"""Minimum contrast of black and white, of 255: false detections of 16h5 in noise and floor textures stay below."""

MAX_ENLARGED_PX = 200
"""Side of the largest window that is enlarged: tags in larger ones have pixels enough."""


class Look(NamedTuple):
    """A preparation of images for what else is missed: enlarged by a factor, then sharpened.

    sharpening, radius_px: amount and radius of an unsharp mask: cells of 2 px are as wide as the blur of a webcam.
    """

    enlarged: int
    sharpening: float
    radius_px: float

    def apply(self, gray: np.ndarray, scale: int) -> np.ndarray:
        """Return an image (H, W) so prepared, scale times as large."""
        if scale > 1:
            gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        blurred = cv2.GaussianBlur(gray, (0, 0), scale * self.radius_px)
        return cv2.addWeighted(gray, 1.0 + self.sharpening, blurred, -self.sharpening, 0.0)


FINE_LOOKS = (Look(1, 1.0, 1.0), Look(2, 3.0, 1.5))

EVEN_CONTRAST, EVEN_FROM_PX = 8, 200 * 200
"""Most that means of 4 x 4 px differ by on even ground, of 255; pixels of the smallest image that has much of it: in
windows around tags of 50 px, to look for it costs as much as it saves."""

MIN_MISTAKEN_TAGS = 3
"""Fewer may be noise."""


class AprilTagDetector:
    """python3-apriltag, AprilTag 3's own detector: the more accurate one.

    It holds the GIL and takes SIGINT over while it detects: programs with other threads run it in its own process.
    """

    def __init__(self, family: str, decimate: float, look: Optional[Look] = None) -> None:
        """look: how to prepare images; None: take them as they are."""
        try:
            from apriltag import apriltag
        except ImportError:
            text = "the detector apriltag is not installed: apt install python3-apriltag, or take the detector aruco"
            raise DetectorError(text) from None
        # Corrected bits bring false tags in, of which 16h5 has many already.
        self._detector = apriltag("tag" + family, threads=1, maxhamming=0 if family == "16h5" else 1, decimate=decimate)
        self._least_margin = _MIN_MARGIN[family]
        self._look = look

    def detect(self, gray: np.ndarray, origin: Tuple[int, int] = (0, 0)) -> List[TagCorners]:
        """Return the tags in gray (H, W), 8 bit: an image, or the window of one that begins at origin (column, row)."""
        shift, scale = np.array(origin) - 0.5, 1
        if gray.size > EVEN_FROM_PX:
            gray = _remove_noise(gray)
        if self._look is not None:
            scale = self._look.enlarged if max(gray.shape) <= MAX_ENLARGED_PX else 1
            gray = self._look.apply(gray, scale)
        return [
            TagCorners(int(found["id"]), np.asarray(found["lb-rb-rt-lt"], dtype=float)[::-1] / scale + shift)
            for found in self._detector.detect(np.ascontiguousarray(gray))
            if found["margin"] >= self._least_margin
        ]


def _remove_noise(gray: np.ndarray) -> np.ndarray:
    """Return an image without the noise of its even ground, on which apriltag spends most of its time."""
    around = np.ones((7, 7), np.uint8)
    means = cv2.resize(gray, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    darkest = cv2.erode(means, around)  # which varies less than the mean
    even = (cv2.dilate(means, around) - darkest <= EVEN_CONTRAST).astype(np.uint8)
    even, darkest = (cv2.resize(part, gray.shape[::-1], interpolation=cv2.INTER_NEAREST) for part in (even, darkest))
    return np.where(even, darkest, gray)


class ArucoDetector:
    """OpenCV's aruco, which always searches the whole image: decimate is not used."""

    def __init__(self, family: str, decimate: float) -> None:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family].dictionary))
        is_new = hasattr(cv2.aruco, "ArucoDetector")  # since OpenCV 4.7
        options = cv2.aruco.DetectorParameters() if is_new else cv2.aruco.DetectorParameters_create()
        options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        options.cornerRefinementWinSize = 3
        if is_new:
            options.relativeCornerRefinmentWinSize = 1.0  # in cells: less leaves no window at small tags
        options.adaptiveThreshWinSizeMin, options.adaptiveThreshWinSizeMax = 5, 25
        options.perspectiveRemovePixelPerCell = 8  # the default, 4, misreads cells of less than 3 pixels
        options.errorCorrectionRate = 0.0 if family == "16h5" else 0.6
        if is_new:
            self._detect = cv2.aruco.ArucoDetector(dictionary, options).detectMarkers
        else:
            self._detect = lambda gray: cv2.aruco.detectMarkers(gray, dictionary, parameters=options)
        self._roll = 0
        self._roll = self._find_roll(family)

    def _find_roll(self, family: str) -> int:
        """Return by how many corners this version's order has to be moved on, found by a tag of known heading."""
        cells = draw_tag(family, 0)
        image = np.kron(np.pad(cells, 3, constant_values=255), np.ones((10, 10), np.uint8))
        corners = self.detect(image)[0].corners
        return -int(np.argmin(corners.sum(axis=1)))

    def detect(self, gray: np.ndarray, origin: Tuple[int, int] = (0, 0)) -> List[TagCorners]:
        """Return the tags as AprilTagDetector.detect() does."""
        found, ids, _ = self._detect(np.ascontiguousarray(gray))
        if ids is None:
            return []
        return [
            TagCorners(int(tag_id), np.roll(np.asarray(corners[0], dtype=float), self._roll, axis=0) + origin)
            for corners, tag_id in zip(found, ids.ravel())
        ]


TagDetector = Union[AprilTagDetector, ArucoDetector]
BACKENDS: Dict[str, Type[TagDetector]] = {"apriltag": AprilTagDetector, "aruco": ArucoDetector}

DEFAULT_BACKEND = "apriltag" if find_spec("apriltag") else "aruco"
"""Debian 11 has no python3-apriltag that works."""


def create_detector(backend: str = DEFAULT_BACKEND, family: str = "36h11", decimate: float = 2.0) -> TagDetector:
    """Return one of BACKENDS for one of FAMILIES.

    decimate: apriltag looks for squares in an image this many times smaller; corners are refined in the whole one.

    Raises: DetectorError if it is not installed.
    """
    return BACKENDS[backend](family, decimate)


def create_fine_detectors(family: str) -> List[Union[TagDetector, Type[TemplateDetector]]]:
    """Return detectors that find what others miss, at more and more cost: small tags, blur, edges of shadows."""
    if family != "36h11":  # enlarged noise looks like tags of 16h5, whose cells are larger anyway
        return [AprilTagDetector(family, 1.0, FINE_LOOKS[0])]
    return [*(AprilTagDetector(family, 1.0, look) for look in FINE_LOOKS), TemplateDetector]


def find_print_mistake(gray: np.ndarray, family: str) -> str:
    """Return what is wrong if an image (H, W) shows tags of another family, or mirrored; empty if nothing is found."""
    for other in FAMILIES:
        if other != family and len(ArucoDetector(other, 1.0).detect(gray)) >= MIN_MISTAKEN_TAGS:
            return f"the image shows tags of {other}: set family: {other} in the camera file"
    if len(ArucoDetector(family, 1.0).detect(gray[:, ::-1])) >= MIN_MISTAKEN_TAGS:
        return "the image is mirrored: switch that off in the camera or its driver"
    return ""
