"""The filter of one robot: accuracy, late and wrong poses, robots moved by hand or restarted."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from hero_client.values import interpolate_pose
from hero_localization.filter.pose_filter import Outcome, PoseFilter
from hero_localization.filter.pose_hypothesis import REPLAYED_S, StampedPose
from hero_node import Pose, find_frame, invert_pose, transform_pose, wrap_angle
from hero_test.nonempty import maybe_empty, nonempty

ODOMETRY_S = 0.034
CAMERA_S = 1.0 / 30.0
DELAY_S = 0.12
NOISE_M, NOISE_RAD = 0.001, 0.006
COVARIANCE = np.diag((NOISE_M**2, NOISE_M**2, NOISE_RAD**2))
ZERO = Pose(0.0, 0.0, 0.0)
ORIGIN = Pose(0.4, -0.3, 2.0)
"""Of the robot's odometry in map."""


class Sample(NamedTuple):
    stamp_s: float
    true: Pose
    odometry: Pose


class Drive:
    """A robot that drives curves; its odometry misses a share of the way of each wheel, and loses some more by slip."""

    def __init__(self, seed, linear_m_s=0.2, loss=0.016):
        self.random = np.random.RandomState(seed)
        self.samples = [Sample(0.0, ORIGIN, Pose(0.0, 0.0, 0.0))]
        self.linear_m_s, self.loss = linear_m_s, loss
        self.wheel = self.random.normal(1.0, 0.003, 2)

    def run(self, duration_s):
        end_s = self.samples[-1].stamp_s + duration_s
        while self.samples[-1].stamp_s < end_s:
            stamp_s, true, odometry = self.samples[-1]
            angular_rad_s = 2.0 * math.sin(stamp_s / 1.7)
            step = Pose(self.linear_m_s * ODOMETRY_S, 0.0, angular_rad_s * ODOMETRY_S)
            shares = self.wheel * (1.0 + np.abs(self.random.normal(0.0, self.loss, 2)))
            counted = Pose(step.x_m * shares.mean(), 0.0, step.yaw_rad + (shares[1] - shares[0]) * step.x_m / 0.067)
            moved = (transform_pose(true, step), transform_pose(odometry, counted))
            self.samples.append(Sample(stamp_s + ODOMETRY_S, *moved))
        return self

    def push(self, duration_s):
        """Drive against a wall: the wheels turn, the robot stays."""
        end_s = self.samples[-1].stamp_s + duration_s
        step = Pose(self.linear_m_s * ODOMETRY_S, 0.0, 0.0)
        while self.samples[-1].stamp_s < end_s:
            stamp_s, true, odometry = self.samples[-1]
            self.samples.append(Sample(stamp_s + ODOMETRY_S, true, transform_pose(odometry, step)))
        return self

    def true_pose(self, stamp_s):
        index = min(int(stamp_s / ODOMETRY_S), len(self.samples) - 2)
        start, end = self.samples[index : index + 2]
        share = (stamp_s - start.stamp_s) / ODOMETRY_S
        return interpolate_pose(start.true, end.true, share)

    def measure(self, stamp_s):
        x_m, y_m, yaw_rad = self.true_pose(stamp_s)
        noise_m, noise_rad = self.random.normal(0.0, NOISE_M, 2), self.random.normal(0.0, NOISE_RAD)
        pose = Pose(x_m + noise_m[0], y_m + noise_m[1], wrap_angle(yaw_rad + noise_rad))
        return StampedPose(stamp_s, pose, COVARIANCE)


def follow(drive, pose_filter, is_seen=lambda stamp_s: True, delay_s=DELAY_S, stamp_error_s=0.0):
    """Feed the filter with the whole drive; return errors of x, y, yaw at each odometry after the first second."""
    errors, next_s = [], 0.0
    for stamp_s, true, odometry in drive.samples:
        pose_filter.add_odometry(stamp_s, odometry)
        while next_s + delay_s <= stamp_s:
            if is_seen(next_s):
                measured = drive.measure(next_s)
                pose_filter.add_measurement(measured._replace(stamp_s=next_s + stamp_error_s))
            next_s += CAMERA_S
        found = pose_filter.estimate()
        if found is not None and stamp_s > 1.0:
            yaw_rad = wrap_angle(found.pose.yaw_rad - true.yaw_rad)
            errors.append((found.pose.x_m - true.x_m, found.pose.y_m - true.y_m, yaw_rad))
    return np.array(errors)


def rms(errors):
    return math.sqrt(float((errors[:, :2] ** 2).sum(axis=1).mean()))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_driving_robot_is_known_to_two_millimeters_at_any_time(seed):
    errors = follow(Drive(seed).run(30.0), PoseFilter())
    assert rms(errors) < 0.002
    assert math.sqrt(float((errors[:, 2] ** 2).mean())) < 0.02


@pytest.mark.slow
def test_a_pose_counts_at_the_time_at_which_it_was_measured():
    stamped_at_arrival = follow(Drive(1).run(20.0), PoseFilter(), delay_s=DELAY_S, stamp_error_s=DELAY_S)
    stamped_at_capture = follow(Drive(1).run(20.0), PoseFilter(), delay_s=DELAY_S)
    assert rms(stamped_at_arrival) > 0.01 > 5.0 * rms(stamped_at_capture)


@pytest.mark.parametrize("age_s", [0.0, 0.008, 0.02, 0.04, 0.1, 0.2])
def test_poses_of_any_age_are_used_and_right_to_a_millimeter(age_s):
    """As of a motion capture system at 100 Hz; odometry arrives 10 ms after its stamp."""
    drive, pose_filter, errors = Drive(1, loss=0.0).run(8.0), PoseFilter(), []
    events = [(sample.stamp_s + 0.01, 0, sample) for sample in drive.samples]
    events += [(0.01 * index + age_s, 1, 0.01 * index) for index in range(790)]
    for _, kind, event in nonempty(sorted(events)):
        if kind == 1:
            measured = StampedPose(event, drive.true_pose(event), np.diag((1e-7, 1e-7, 1e-5)))
            used = (Outcome.FIRST, Outcome.USED, Outcome.WAITING)
            assert event < 0.1 or pose_filter.add_measurement(measured) in used
            continue
        for _, _, outcome in maybe_empty(pose_filter.add_odometry(event.stamp_s, event.odometry)):
            assert outcome in (Outcome.FIRST, Outcome.USED)
        found = pose_filter.estimate()
        if found is not None and found.stamp_s > 1.0:
            true = drive.true_pose(found.stamp_s)
            errors.append((found.pose.x_m - true.x_m, found.pose.y_m - true.y_m))
    assert rms(np.array(errors)) < 0.001


def test_poses_count_without_waiting_once_odometry_has_ended():
    pose_filter = PoseFilter()
    pose_filter.add_odometry(1.0, Pose(0.0, 0.0, 0.0))
    pose = Pose(0.3, 0.1, 0.5)
    outcomes = [pose_filter.add_measurement(StampedPose(1.1 + 0.1 * i, pose, COVARIANCE)) for i in range(4)]
    assert outcomes == [Outcome.WAITING, Outcome.WAITING, Outcome.USED, Outcome.USED]
    np.testing.assert_allclose(pose_filter.pose(), pose)


def test_a_late_pose_gives_the_same_as_if_it_had_come_in_order():
    drive = Drive(2).run(1.9)
    measured = [drive.measure(0.1 * index) for index in range(19)]
    late = (12, 15)
    in_time = [pose for index, pose in enumerate(measured) if index not in late]
    filters = PoseFilter(), PoseFilter()
    for pose_filter, poses in zip(filters, (measured, in_time + [measured[index] for index in late])):
        for stamp_s, _, odometry in drive.samples:
            pose_filter.add_odometry(stamp_s, odometry)
        for pose in poses:
            assert pose_filter.add_measurement(pose) in (Outcome.FIRST, Outcome.USED)
    in_order, out_of_order = (pose_filter.estimate() for pose_filter in filters)
    np.testing.assert_allclose(out_of_order.pose, in_order.pose, atol=1e-12)
    np.testing.assert_allclose(out_of_order.covariance, in_order.covariance, atol=1e-15)


@pytest.mark.parametrize("seed", range(2))
def test_after_two_seconds_unseen_the_robot_is_right_within_0_2_seconds(seed):
    drive, pose_filter = Drive(seed).run(14.0), PoseFilter()
    errors = follow(drive, pose_filter, is_seen=lambda stamp_s: not 8.0 <= stamp_s < 10.0)
    stamps_s = np.array([sample.stamp_s for sample in drive.samples if sample.stamp_s > 1.0])
    unseen = errors[(stamps_s > 8.2) & (stamps_s < 10.1)]
    again = errors[stamps_s > 10.2 + DELAY_S]
    assert rms(again) < 0.003
    assert rms(unseen) < 0.03


@pytest.mark.slow
def test_the_uncertainty_holds_the_true_error():
    inside = total = 0
    for seed in range(20):
        drive, pose_filter = Drive(seed).run(10.0), PoseFilter()
        follow(drive, pose_filter, is_seen=lambda stamp_s: stamp_s < 8.0)
        found, true = pose_filter.estimate(), drive.samples[-1].true
        yaw_rad = wrap_angle(found.pose.yaw_rad - true.yaw_rad)
        off = np.array((found.pose.x_m - true.x_m, found.pose.y_m - true.y_m, yaw_rad))
        inside += float(off @ np.linalg.solve(found.covariance, off)) < 16.3
        total += 1
    assert inside >= total - 1


def test_wrong_poses_that_disagree_never_move_the_robot():
    drive, pose_filter = Drive(3).run(5.0), PoseFilter()
    follow(drive, pose_filter)
    before = pose_filter.estimate().pose
    for index in range(8):
        wrong = drive.measure(4.8)._replace(stamp_s=4.8 + 0.02 * index)
        wrong = wrong._replace(pose=wrong.pose._replace(x_m=0.5 + 0.2 * index))
        assert pose_filter.add_measurement(wrong) is Outcome.OUTLIER
    assert pose_filter.estimate().pose == before


@pytest.mark.parametrize("linear_m_s", [0.1, 0.2])
def test_a_robot_that_a_wall_holds_stays_where_it_is_measured(linear_m_s):
    drive, pose_filter = Drive(4, linear_m_s).run(5.0), PoseFilter()
    wall_s = drive.samples[-1].stamp_s
    errors = follow(drive.push(3.0).run(3.0), pose_filter)
    stamps_s = np.array([sample.stamp_s for sample in drive.samples if sample.stamp_s > 1.0])
    # Until an image of the wall has come, and of the free drive after it, nothing tells of either.
    unknown_m = linear_m_s * (DELAY_S + 0.15)
    assert np.hypot(*errors[:, :2].T).max() < unknown_m + 0.005
    assert rms(errors[(stamps_s > wall_s + DELAY_S + 0.3) & (stamps_s < wall_s + 2.9)]) < 0.005
    assert rms(errors[stamps_s > wall_s + 3.0 + DELAY_S + 0.3]) < 0.002


def test_a_restart_of_the_robot_does_not_move_it():
    drive, pose_filter = Drive(5).run(5.0), PoseFilter()
    follow(drive, pose_filter)
    before, end_s = pose_filter.estimate().pose, drive.samples[-1].stamp_s
    pose_filter.add_odometry(end_s + ODOMETRY_S, Pose(0.0, 0.0, 0.0))
    np.testing.assert_allclose(pose_filter.estimate().pose, before, atol=1e-9)
    assert pose_filter.odometry.jumps == 1
    pose_filter.add_odometry(end_s + 2.0 * ODOMETRY_S, Pose(0.005, 0.0, 0.0))
    moved = pose_filter.estimate().pose
    assert math.hypot(moved.x_m - before.x_m, moved.y_m - before.y_m) == pytest.approx(0.005)
    np.testing.assert_allclose(find_frame(moved, pose_filter.odometry.raw_pose), before, atol=1e-9)


def test_a_robot_unseen_for_minutes_goes_on_by_its_odometry():
    drive, pose_filter = Drive(7).run(1.0), PoseFilter()
    follow(drive, pose_filter)
    start = pose_filter.estimate()
    odometry = drive.run(120.0).samples
    for stamp_s, _, reading in odometry:
        pose_filter.add_odometry(stamp_s, reading)
    last = next(sample for sample in odometry if sample.stamp_s >= start.stamp_s)
    driven = transform_pose(invert_pose(last.odometry), odometry[-1].odometry)
    np.testing.assert_allclose(pose_filter.estimate().pose[:2], transform_pose(start.pose, driven)[:2], atol=1e-6)
    assert pose_filter.estimate().covariance[0, 0] > 0.05**2


def test_a_pose_without_odometry_or_from_long_ago_is_left_out():
    pose_filter = PoseFilter()
    pose = StampedPose(1.0, Pose(0.0, 0.0, 0.0), COVARIANCE)
    assert pose_filter.add_measurement(pose) is Outcome.TOO_LATE
    assert pose_filter.estimate() is None
    for index in range(100):
        pose_filter.add_odometry(0.05 * index, Pose(0.0, 0.0, 0.0))
    assert pose_filter.add_measurement(pose) is Outcome.TOO_LATE
    assert pose_filter.add_measurement(pose._replace(stamp_s=4.5)) is Outcome.FIRST
    assert pose_filter.add_measurement(pose._replace(stamp_s=4.2)) is Outcome.TOO_LATE


@pytest.mark.parametrize("pose", [Pose(math.nan, 0.0, 0.0), Pose(0.0, math.inf, 0.0)])
def test_a_pose_that_is_not_finite_is_refused(pose):
    with pytest.raises(ValueError, match="finite"):
        PoseFilter().add_measurement(StampedPose(0.0, pose, COVARIANCE))


@pytest.mark.parametrize("covariance", [np.zeros((3, 3)), np.eye(2), np.full((3, 3), math.nan), np.ones((3, 3))])
def test_a_covariance_that_is_none_is_refused(covariance):
    with pytest.raises(ValueError, match="covariance"):
        PoseFilter().add_measurement(StampedPose(0.0, Pose(0.0, 0.0, 0.0), covariance))


def test_after_a_long_occlusion_a_pose_of_the_last_second_is_used():
    for readings in range(20, 50):
        filter_ = PoseFilter()
        filter_.add_odometry(0.0, Pose(0.0, 0.0, 0.0))
        filter_.add_measurement(StampedPose(0.0, ORIGIN, COVARIANCE))
        for number in range(1, readings):
            filter_.add_odometry(0.1 * number, Pose(0.0, 0.0, 0.0))
        seen_s = 0.1 * (readings - 1) - 0.9 * REPLAYED_S
        assert filter_.add_measurement(StampedPose(seen_s, ORIGIN, COVARIANCE)) is Outcome.USED


def start_filter(pose=ZERO, covariance=COVARIANCE, stamp_s=1.0):
    """Return a filter that was told by odometry and by one measured pose where its robot is."""
    pose_filter = PoseFilter()
    pose_filter.add_odometry(stamp_s, Pose(0.0, 0.0, 0.0))
    assert pose_filter.add_measurement(StampedPose(stamp_s, pose, covariance)) is Outcome.FIRST
    return pose_filter


def start_confirmed_filter():
    """Return a filter whose robot was not found by a false detection: a few poses agree."""
    pose_filter = start_filter(stamp_s=0.97)
    for index in range(1, 4):
        stamp_s = 0.97 + 0.01 * index
        pose_filter.add_odometry(stamp_s, Pose(0.0, 0.0, 0.0))
        assert pose_filter.add_measurement(StampedPose(stamp_s, ZERO, COVARIANCE)) is Outcome.USED
    return pose_filter


def test_an_outlier_elsewhere_takes_one_from_those_that_agree():
    pose_filter, outcomes = start_confirmed_filter(), []
    for index, x_m in enumerate((0.3, 0.3, 0.3, 0.9, 0.3, 0.3)):
        stamp_s = 1.05 + 0.05 * index
        pose_filter.add_odometry(stamp_s, ZERO)
        outcomes.append(pose_filter.add_measurement(StampedPose(stamp_s, Pose(x_m, 0.0, 0.0), COVARIANCE)))
    assert outcomes == [Outcome.OUTLIER] * 5 + [Outcome.MOVED]


@pytest.mark.parametrize(("off", "outcome"), [(4.03, Outcome.USED), (4.05, Outcome.OUTLIER)])
def test_one_true_pose_of_a_thousand_is_an_outlier(off, outcome):
    for axis in range(3):
        pose_filter = start_filter(Pose(0.5, -0.5, 3.1))
        pose_filter.add_odometry(1.01, Pose(0.0, 0.0, 0.0))
        # Of two poses as uncertain as each other.
        shift = np.zeros(3)
        shift[axis] = off * math.sqrt(2.0 * COVARIANCE[axis, axis])
        x_m, y_m, yaw_rad = np.array((0.5, -0.5, 3.1)) + shift
        measured = StampedPose(1.01, Pose(x_m, y_m, wrap_angle(yaw_rad)), COVARIANCE)
        assert pose_filter.add_measurement(measured) is outcome, axis


def test_slip_explains_at_most_six_centimeters_or_34_degrees():
    for step, end, outcome in (
        (Pose(0.055, 0.0, 0.0), Pose(0.0, 0.0, 0.0), Outcome.USED),
        (Pose(0.065, 0.0, 0.0), Pose(0.0, 0.0, 0.0), Outcome.OUTLIER),
        (Pose(0.0, 0.0, 0.55), Pose(0.0, 0.0, 0.0), Outcome.USED),
        (Pose(0.0, 0.0, 0.65), Pose(0.0, 0.0, 0.0), Outcome.OUTLIER),
        (Pose(0.0, 0.0, -0.55), Pose(0.0, 0.0, 0.0), Outcome.USED),
        (Pose(0.0, 0.0, -0.65), Pose(0.0, 0.0, 0.0), Outcome.OUTLIER),
        (Pose(0.02, 0.0, 0.0), Pose(0.15, 0.0, 0.0), Outcome.OUTLIER),
        (Pose(0.02, 0.0, 0.0), Pose(0.25, 0.0, 0.0), Outcome.OUTLIER),
    ):
        pose_filter = start_filter()
        pose_filter.add_odometry(1.1, step)
        assert pose_filter.add_measurement(StampedPose(1.1, end, COVARIANCE)) is outcome, (step, end)


def hold(counted_m, came_m, elapsed_s):
    """Return by how much the robot goes on by odometry after so long a way that the camera did not see."""
    pose_filter, start = start_filter(stamp_s=0.9), StampedPose(1.0, Pose(0.0, 0.0, 0.0), COVARIANCE)
    pose_filter.add_odometry(1.0, start.pose)
    assert pose_filter.add_measurement(start) is Outcome.USED
    pose_filter.add_odometry(1.0 + elapsed_s, Pose(counted_m, 0.0, 0.0))
    measured = StampedPose(1.0 + elapsed_s, Pose(came_m, 0.0, 0.0), COVARIANCE)
    assert pose_filter.add_measurement(measured) is Outcome.USED
    before = pose_filter.pose()
    pose_filter.add_odometry(1.05 + elapsed_s, Pose(counted_m + 0.01, 0.0, 0.2))
    assert pose_filter.pose().yaw_rad == pytest.approx(before.yaw_rad + 0.2), "it may turn where it is"
    return pose_filter.pose().x_m - before.x_m


def test_a_robot_is_blocked_if_it_came_nowhere_though_its_wheels_turned():
    free_m = pytest.approx(0.01, abs=1e-3)
    for counted_m, came_m, elapsed_s in ((0.02, 0.0, 0.1), (0.02, 0.0078, 0.1), (0.0052, 0.0, 0.1), (0.02, 0.0, 0.49)):
        assert hold(counted_m, came_m, elapsed_s) == 0.0, (counted_m, came_m, elapsed_s)
    assert hold(0.02, 0.0082, 0.1) == free_m, "it came two fifths of the way"
    assert hold(0.0048, 0.0, 0.1) == free_m, "so little may be slip"
    assert hold(0.02, 0.0, 0.085) == free_m and hold(0.02, 0.0, 0.51) == free_m, "too short or too long ago to tell"


def test_a_blocked_robot_that_is_not_seen_any_more_follows_its_odometry():
    drive, pose_filter = Drive(4, 0.1, loss=0.0).run(5.0).push(2.0), PoseFilter()
    follow(drive, pose_filter)
    place, start_s, last = pose_filter.pose(), drive.samples[-1].stamp_s, drive.samples[-1].odometry
    for index in range(1, 120):
        step = Pose(0.002 * index, 0.0, 0.0)
        pose_filter.add_odometry(start_s + ODOMETRY_S * index, transform_pose(last, step))
        moved_m = math.hypot(pose_filter.pose().x_m - place.x_m, pose_filter.pose().y_m - place.y_m)
        if index < 50:
            assert moved_m == 0.0, index
    assert moved_m == pytest.approx(step.x_m + 0.1 * DELAY_S, abs=0.005)


def test_four_outliers_over_a_tenth_of_a_second_that_agree_move_the_robot():
    def see(times_s, places_m, count=None):
        pose_filter, outcomes = start_confirmed_filter(), []
        for time_s, x_m in zip(times_s, places_m):
            pose_filter.add_odometry(1.0 + time_s, Pose(0.0, 0.0, 0.0))
            outcomes.append(pose_filter.add_measurement(StampedPose(1.0 + time_s, Pose(x_m, 0.0, 0.0), COVARIANCE)))
        return outcomes

    out, moved = Outcome.OUTLIER, Outcome.MOVED
    assert see((0.1, 0.14, 0.17, 0.205), [0.5] * 4) == [out, out, out, moved]
    assert see((0.1, 0.15, 0.205), [0.5] * 3) == [out, out, out]
    assert see((0.1, 0.12, 0.15, 0.19), [0.5] * 4) == [out] * 4
    assert see((0.1, 0.14, 0.17, 0.205), (0.5, 0.8, 0.5, 0.5)) == [out] * 4
    assert see((0.1, 0.14, 0.17, 0.205, 0.24, 0.28), (0.5, 0.8, 0.5, 0.5, 0.5, 0.5)) == [out] * 5 + [moved]
    assert see((0.1, 0.14, 0.17, 0.18, 0.205, 0.24), (0.5, 0.5, 0.0, 0.5, 0.5, 0.5)) == [
        out, out, Outcome.USED, out, out, out,
    ], "not in a row"  # fmt: skip


def test_no_hand_moves_a_robot_by_less_than_a_centimeter_or_six_degrees():
    for pose, outcome in (
        (Pose(0.009, 0.0, 0.0), Outcome.USED),
        (Pose(0.0, 0.011, 0.0), Outcome.MOVED),
        (Pose(0.0, 0.0, -0.095), Outcome.USED),
        (Pose(0.0, 0.0, 0.105), Outcome.MOVED),
    ):
        pose_filter = start_confirmed_filter()
        for index in range(4):
            pose_filter.add_odometry(1.1 + 0.035 * index, Pose(0.0, 0.0, 0.0))
            found = pose_filter.add_measurement(StampedPose(1.1 + 0.035 * index, pose, COVARIANCE))
        assert found is outcome, pose
        assert pose_filter.pose() == pytest.approx(pose, abs=1e-3)


def test_a_covariance_is_taken_if_it_is_one():
    random, count = np.random.RandomState(0), [0, 0]
    for _ in range(300):
        half = random.normal(size=(3, 3))
        covariance = half + half.T + np.diag(random.uniform(0.0, 4.0, 3))
        smallest = np.linalg.eigvalsh(covariance)[0]
        if abs(smallest) < 1e-6:
            continue
        try:
            PoseFilter().add_measurement(StampedPose(0.0, ZERO, covariance))
        except ValueError as error:
            assert smallest < 0.0 and "covariance" in str(error)
        else:
            assert smallest > 0.0
        count[int(smallest > 0.0)] += 1
    assert min(count) > 50
    for stamp_s in (math.nan, math.inf):
        with pytest.raises(ValueError, match="finite"):
            PoseFilter().add_measurement(StampedPose(stamp_s, ZERO, COVARIANCE))


def test_a_pose_waits_a_quarter_of_a_second_for_odometry():
    used, waiting = Outcome.USED, Outcome.WAITING
    for ahead_s, outcome in ((0.0, used), (0.01, waiting), (0.24, waiting), (0.26, used)):
        assert start_filter().add_measurement(StampedPose(1.0 + ahead_s, ZERO, COVARIANCE)) is outcome, ahead_s
    pose_filter = start_filter()
    for stamp_s in (1.1, 1.2):
        assert pose_filter.add_measurement(StampedPose(stamp_s, ZERO, COVARIANCE)) is Outcome.WAITING
    (first,) = pose_filter.add_odometry(1.1, ZERO)
    assert (first[0].stamp_s, *first[1:]) == (1.1, ZERO, Outcome.USED)
    assert pose_filter.used_s == 1.1
    assert [measured.stamp_s for measured, _, _ in pose_filter.add_odometry(1.3, ZERO)] == [1.2]


def test_poses_come_late_by_a_second_at_most():
    for late_s, outcome in ((0.95, Outcome.USED), (1.05, Outcome.TOO_LATE)):
        pose_filter = start_filter()
        for index in range(1, 31):
            pose_filter.add_odometry(1.0 + 0.1 * index, ZERO)
            assert pose_filter.add_measurement(StampedPose(1.0 + 0.1 * index, ZERO, COVARIANCE)) is Outcome.USED
        assert pose_filter.add_measurement(StampedPose(4.0 - late_s - 0.001, ZERO, COVARIANCE)) is outcome, late_s
