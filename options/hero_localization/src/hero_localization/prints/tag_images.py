"""The cells of AprilTags as they are printed upright, from OpenCV's own dictionaries. Pure.

Upright is as in AprilTag's own images. OpenCV 4 has all tags of these families turned by 180 degrees, others may not:
one known tag tells how this version has them.
"""

from typing import Dict, NamedTuple

import numpy as np

from ..errors import LocalizationError

DEFAULT_SIZE_M = 0.040
"""Side of the black square of robots' tags, unless a file or an option names another."""
REFERENCE_SIZE_M = 0.1
"""Side of the black square of tags on the floor."""


class Family(NamedTuple):
    """A family of so many tags (size), by OpenCV's name; cells: along each side, with the black border."""

    dictionary: str
    cells: int
    size: int
    begins_white: bool
    """True if the upper left cell within the border of tag 0 is white; its lower right one is the opposite."""


FAMILIES: Dict[str, Family] = {
    "36h11": Family("DICT_APRILTAG_36h11", 8, 587, True),
    "16h5": Family("DICT_APRILTAG_16h5", 6, 30, False),
}


def draw_tag(family: str, tag_id: int) -> np.ndarray:
    """Return the cells of a tag with its black border, (C, C), 0 or 255; the white margin around it is left out.

    Raises: LocalizationError for an unknown id.
    """
    known = FAMILIES[family]
    if not 0 <= tag_id < known.size:
        raise LocalizationError("tag %d: family %s has 0 to %d" % (tag_id, family, known.size - 1))
    is_upright = bool(_draw(known, 0)[1, 1]) == known.begins_white
    cells = _draw(known, tag_id)
    return cells if is_upright else np.rot90(cells, 2).copy()


def _draw(family: Family, tag_id: int) -> np.ndarray:
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, family.dictionary))
    draw = getattr(cv2.aruco, "generateImageMarker", None) or cv2.aruco.drawMarker  # OpenCV 4.7 renamed it
    return draw(dictionary, tag_id, family.cells)
