"""What robots sense of objects, against hand-computed places."""

import math

import numpy as np
import pytest

from hero_client.values.object_sensing import (
    NO_OBJECTS,
    NOTHING,
    OBJECT,
    ROBOT,
    Objects,
    PlacedObjects,
    Sight,
    sense_objects,
    sense_sight,
)  # fmt: skip
from hero_node.robot_constants import BODY_RADIUS_M


def sense(robots, objects, sensor=None, radius_m=0.05):
    things = PlacedObjects(np.array([objects], dtype=float).reshape(1, -1, 3), np.full(len(objects), radius_m))
    return sense_sight(np.array([robots], dtype=float), things, sensor or Sight()).tolist()


def test_a_beam_tells_what_it_touches_first():
    assert len({NOTHING, OBJECT, ROBOT}) == 3
    assert sense([(0, 0, 0)], []) == [NOTHING]
    assert sense([(0, 0, 0)], [(1, 0.049, 0)]) == [OBJECT]
    assert sense([(0, 0, 0)], [(1, 0.051, 0), (1, -0.051, 0), (-1, 0, 0)]) == [NOTHING]
    assert sense([(0, 0, 0), (2, 0, 0)], [(1, 0, 0)]) == [OBJECT, NOTHING]
    assert sense([(0, 0, 0)], [(BODY_RADIUS_M - 0.01, 0, 0)]) == [OBJECT], "it lies over the sensor"
    assert sense([(0, 0, 0)], [(BODY_RADIUS_M - 0.051, 0, 0)]) == [NOTHING], "it ends behind the sensor"
    for objects in ([(1, 0, 0)], []):
        assert sense([(0, 0, 0), (0.5, 0, 0)], objects)[0] == ROBOT


def test_a_beam_ends_at_its_range_from_the_rim():
    gap_m = 1.0 - BODY_RADIUS_M - 0.05
    assert sense([(0, 0, 0)], [(1, 0, 0)], Sight(gap_m + 0.001)) == [OBJECT]
    assert sense([(0, 0, 0)], [(1, 0, 0)], Sight(gap_m - 0.001)) == [NOTHING]
    gap_m = 0.5 - 2.0 * BODY_RADIUS_M
    assert sense([(0, 0, 0), (0.5, 0, 0)], [(1, 0, 0)], Sight(gap_m + 0.001))[0] == ROBOT
    assert sense([(0, 0, 0), (0.5, 0, 0)], [(1, 0, 0)], Sight(gap_m - 0.001))[0] == NOTHING


def test_robots_without_a_pose_see_nothing_and_are_not_seen():
    assert sense([(0, 0, 0), (math.nan,) * 3], [(1, 0, 0)]) == [OBJECT, NOTHING]
    assert sense_sight(np.zeros((3, 2, 3)), NO_OBJECTS, Sight(0.0)).shape == (6,)


def test_objects_are_sensed_in_the_body_frame():
    things = PlacedObjects(np.array([[(1.0, 2.0, math.pi), (5.0, 1.0, 0.0)]]), np.array([0.1, 0.2]))
    poses = np.array([[(1.0, 1.0, math.pi / 2.0), (5.0, 0.0, 0.0)]])
    seen = sense_objects(poses, things, Objects(range_m=2.0))
    assert seen.seen.tolist() == [[True, False], [False, True]] and seen.left_m[1, 1] == 1.0
    np.testing.assert_allclose((seen.forward_m[0, 0], seen.left_m[0, 0]), (1.0, 0.0), atol=1e-12)
    assert seen.heading_rad[0, 0] == pytest.approx(math.pi / 2.0)
    assert seen.radii_m.tolist() == [0.1, 0.2]
