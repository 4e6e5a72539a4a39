"""Sources that disagree, and which poses end that: their own, or those by which the estimate is another one."""

from unittest.mock import create_autospec

import numpy as np
import pytest

from hero_localization.filter.pose_filter import Outcome, PoseFilter
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.pose_sources import KEPT_S, PoseSources
from hero_node import Pose

COVARIANCE = np.diag((1e-6, 1e-6, 1e-6))
CAMERA, MOCAP = "/track/measured_poses (/track)", "/hero_0/measured_pose (/vrpn)"


@pytest.fixture(name="sources")
def make_sources():
    pose_filter = create_autospec(PoseFilter, instance=True, support=5)
    pose_filter.expect.return_value = Pose(1.0, 2.0, 0.0)
    return PoseSources(pose_filter)


def see(sources, stamp_s, outcome, source=CAMERA, x_m=1.0):
    return sources.note(StampedPose(stamp_s, Pose(x_m, 2.0, 0.0), COVARIANCE, source), outcome)


def disagree(sources):
    """Let the camera see the robot where the other source does not."""
    see(sources, 10.0, Outcome.USED)
    for stamp_s in (10.1, 10.2, 10.3):
        see(sources, stamp_s, Outcome.OUTLIER, x_m=1.5)
    assert sources.find_disagreement() == pytest.approx((0.5, 0.0, 0.0))


def test_poses_of_another_source_that_are_used_end_no_disagreement(sources):
    disagree(sources)
    assert see(sources, 10.35, Outcome.USED, MOCAP) is None, "for a moment only"
    see(sources, 10.4, Outcome.USED, MOCAP)
    assert sources.find_disagreement() is not None
    conflict = sources.find_conflict()
    assert conflict.key == f"{MOCAP} {CAMERA}" and "500 mm and 0 degrees off those from " + MOCAP in conflict.text


@pytest.mark.parametrize("outcome", [Outcome.MOVED, Outcome.FIRST])
def test_an_estimate_that_is_another_one_ends_all_disagreements(sources, outcome):
    disagree(sources)
    see(sources, 10.4, outcome, MOCAP, x_m=1.5)
    assert sources.find_disagreement() is None and sources.find_conflict() is None


def test_a_pose_that_is_used_ends_the_disagreement_of_its_source(sources):
    disagree(sources)
    see(sources, 10.4, Outcome.USED)
    assert sources.find_disagreement() is None


def test_a_source_that_has_ended_does_not_count_any_more(sources):
    disagree(sources)
    see(sources, 10.3 + KEPT_S - 0.01, Outcome.USED, MOCAP)
    assert sources.find_disagreement() is not None
    see(sources, 10.3 + KEPT_S + 0.01, Outcome.USED, MOCAP)
    assert sources.find_disagreement() is None


def test_the_conflict_that_a_hand_ends_is_told_of_once_more(sources):
    disagree(sources)
    see(sources, 10.4, Outcome.USED, MOCAP)
    conflict = sources.find_conflict()
    assert see(sources, 10.5, Outcome.MOVED, MOCAP) == conflict and sources.find_conflict() is None
