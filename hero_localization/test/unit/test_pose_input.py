"""Poses of motion capture systems that are set up wrongly."""

import math
import re

import pytest
from geometry_msgs.msg import Point, Pose, Quaternion

from hero_localization.nodes.inputs import find_pose_mistake

UPRIGHT = Quaternion(0.0, 0.0, math.sin(0.4), math.cos(0.4))


@pytest.mark.parametrize(
    ("pose", "mistake"),
    [
        (Pose(Point(1.2, -0.4, 0.08), UPRIGHT), ""),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(0.0, 0.0, 0.0, 0.0)), ""),
        (Pose(Point(1.2, -0.4, 0.08), Quaternion(2.0 * math.sin(0.35), 0.0, 0.0, 2.0 * math.cos(0.35))), ""),
        (Pose(Point(1213.0, -400.0, 80.0), UPRIGHT), "has a position of 1213 m: .* mm"),
        (Pose(Point(1.2, 0.08, 0.4), Quaternion(0.0, math.sin(0.6), 0.0, math.cos(0.6))), "lies on its side: .* z"),
    ],
)
def test_poses_in_millimeters_or_with_y_up_are_named(pose, mistake):
    found = find_pose_mistake(pose)
    assert re.search(mistake, found) and bool(mistake) == bool(found)
