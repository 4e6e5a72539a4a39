"""Whether reference tags, or the camera that sees them, moved since the arena was calibrated. Pure."""

from typing import Dict, Mapping

from hero_node.geometry import Pose, measure_distance

MOVED_M = 0.005
"""A camera turned by a tenth of a degree shifts everything by 4 mm."""


def find_moved_references(seen: Mapping[int, Pose], at_calibration: Mapping[int, Pose]) -> Dict[int, float]:
    """Return the reference tags that are seen more than 5 mm from where the calibration saw them, with the distance, m.

    All of them: the camera moved. One: that tag moved.
    """
    moved_m = {
        tag_id: measure_distance(at_calibration[tag_id], pose)
        for tag_id, pose in seen.items()
        if tag_id in at_calibration
    }
    return {tag_id: distance_m for tag_id, distance_m in moved_m.items() if not distance_m <= MOVED_M}
