"""The reported uncertainty: that of stepped robots, seen and then covered, and what each motion adds to it."""

import math

import numpy as np
import pytest
from test_pose_filter import COVARIANCE as SEEN_COVARIANCE
from test_pose_filter import start_filter

from hero_localization.filter.pose_filter import Outcome, PoseFilter, make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_localization.filter.swarm_localizer import LocalizedRobot, RobotState
from hero_localization.nodes.outputs import describe_robot
from hero_node import Pose, transform_pose, wrap_angle
from hero_sim.stepped import StepSwarm

COUNT = 24
SEEN_S, COVERED_S, STEP_S = 1.0, 10.0, 0.05
BIAS_M, BIAS_RAD = 0.0007, 0.003
"""Standard deviations of what calibration leaves: of x, y, and of yaw."""
NOISE_M, NOISE_RAD = 0.0003, 0.003
COVARIANCE = make_covariance(math.hypot(BIAS_M, NOISE_M), math.hypot(BIAS_RAD, NOISE_RAD))
DRIVES = {
    "rest": lambda now_s: (0.0, 0.0),
    "straight": lambda now_s: (0.2, 0.0),
    "circle": lambda now_s: (0.2, 1.0),
    "turn": lambda now_s: (0.0, 2.0),
    "curves": lambda now_s: (0.15, 1.5 * math.sin(1.3 * now_s)),
}


def report_of(estimate):
    return describe_robot(LocalizedRobot(3, RobotState.TRACKED, estimate, estimate.pose, ""))


@pytest.fixture(scope="module")
def arena(tmp_path_factory):
    """Return an arena in which no robot meets another one, or a wall."""
    starts = ["  - [%d, %d, 40]" % (6 * (index % 6), 6 * (index // 6)) for index in range(COUNT)]
    path = tmp_path_factory.mktemp("arena") / "wide.yaml"
    path.write_text("bounds_m: [-5, -5, 35, 23]\nstarts_m_deg:\n" + "\n".join(starts))
    return str(path)


class CoveredSwarm:
    """Robots that are measured while they begin a drive, and then not."""

    def __init__(self, arena, drive):
        random = np.random.RandomState(4)
        self.swarm, self.drive = StepSwarm(count=COUNT, seed=3, arena=arena), drive
        self.filters = [PoseFilter() for _ in range(COUNT)]
        self.biases = random.normal(0.0, (BIAS_M, BIAS_M, BIAS_RAD), (COUNT, 3))
        self.random = random
        self.is_seen, self.true, self.outcomes = True, np.zeros((COUNT, 3)), [[] for _ in range(COUNT)]
        self.swarm.rows.on_cycle.append(self.measure)

    def run(self, duration_s, is_seen):
        self.is_seen, end_s = is_seen, self.swarm.now_s + duration_s
        while self.swarm.now_s < end_s:
            for robot in self.swarm.robots:
                robot.drive(*self.drive(self.swarm.now_s))
            self.swarm.sleep(STEP_S)

    def measure(self, rows):
        """Take new odometry of these robots, and a measured pose of each while they are seen."""
        now_s = self.swarm.now_s
        for row in rows.tolist():
            pose_filter, self.true[row] = self.filters[row], self.swarm.rows.world.poses[row]
            pose_filter.add_odometry(now_s, Pose(*map(float, self.swarm.rows.odometry[row])))
            if self.is_seen:
                noise = self.random.normal(0.0, (NOISE_M, NOISE_M, NOISE_RAD))
                pose = Pose(*map(float, self.true[row] + self.biases[row] + noise))
                self.outcomes[row].append(pose_filter.add_measurement(StampedPose(now_s, pose, COVARIANCE)))

    def normalize_errors(self):
        """Return errors of place and yaw, rms over the robots, by what is reported of them."""
        shares = []
        for pose_filter, true in zip(self.filters, self.true):
            pose, report = pose_filter.estimate().pose, report_of(pose_filter.estimate())
            off_m = math.hypot(pose.x_m - true[0], pose.y_m - true[1])
            off_rad = wrap_angle(pose.yaw_rad - true[2])
            shares.append((off_m / (math.sqrt(2.0) * report.position_sd), off_rad / report.yaw_sd))
        return np.sqrt((np.array(shares) ** 2).mean(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("name", DRIVES)
def test_the_reported_uncertainty_is_the_true_error(name, arena):
    swarm = CoveredSwarm(arena, DRIVES[name])
    swarm.run(SEEN_S, True)
    seen = swarm.normalize_errors()
    swarm.run(COVERED_S, False)
    covered = swarm.normalize_errors()
    swarm.run(STEP_S, True)
    assert seen.min() > 0.65 and seen.max() < 1.3
    assert covered.min() > 0.65 and covered.max() < 1.3
    # Nobody touched them.
    assert [outcomes[1:] for outcomes in swarm.outcomes] == [[Outcome.USED] * len(o[1:]) for o in swarm.outcomes]


def drive_on(pose_filter, steps, step, start_s=1.0):
    """Drive equal steps of 0.05 s; return the growth of the covariance by them."""
    before, odometry = pose_filter.estimate().covariance, pose_filter.odometry.raw_pose
    for number in range(1, steps + 1):
        odometry = transform_pose(odometry, step)
        pose_filter.add_odometry(start_s + 0.05 * number, odometry)
    return pose_filter.estimate().covariance - before


def test_uncertainty_grows_with_the_path_by_scale_and_chance():
    growth = drive_on(start_filter(), 20, Pose(0.02, 0.0, 0.0))
    distance_m, yaw_rad2 = 0.4, SEEN_COVARIANCE[2, 2]
    along_m2 = (0.012 * distance_m) ** 2 + 1.5e-5 * distance_m
    drift_rad2 = (0.065 * distance_m) ** 2
    assert growth[0, 0] == pytest.approx(along_m2, rel=1e-3)
    # Beside the path also by the heading, as it was and as it drifted.
    assert growth[1, 1] == pytest.approx(along_m2 + distance_m**2 * (yaw_rad2 + drift_rad2 / 4.0), rel=1e-3)
    assert growth[2, 2] == pytest.approx(1e-3 * distance_m + drift_rad2, rel=1e-3)
    assert growth[1, 2] == pytest.approx(distance_m * (yaw_rad2 + drift_rad2 / 2.0), rel=1e-3)
    assert growth[0, 1] == pytest.approx(0.0, abs=1e-12) and growth[0, 2] == pytest.approx(0.0, abs=1e-12)
    north = drive_on(start_filter(Pose(0.3, 0.2, math.pi / 2.0)), 20, Pose(0.02, 0.0, 0.0))
    assert (north[1, 1], north[0, 0]) == pytest.approx((growth[0, 0], growth[1, 1]), rel=1e-6)
    assert north[0, 2] == pytest.approx(-growth[1, 2], rel=1e-6)


def test_turns_to_and_fro_make_the_heading_uncertain_by_chance_only():
    one_way = drive_on(start_filter(), 20, Pose(0.0, 0.0, 0.1))
    assert one_way[2, 2] == pytest.approx(2e-4 * 2.0 + (0.014 * 2.0) ** 2, rel=1e-3)
    assert one_way[0, 0] < 1e-7
    pose_filter = start_filter()
    drive_on(pose_filter, 20, Pose(0.0, 0.0, 0.1))
    drive_on(pose_filter, 20, Pose(0.0, 0.0, -0.1), start_s=2.0)
    to_and_fro = pose_filter.estimate().covariance[2, 2] - start_filter().estimate().covariance[2, 2]
    assert to_and_fro == pytest.approx(2e-4 * 4.0, rel=2e-3)


def test_at_rest_hardly_anything_is_forgotten():
    growth = drive_on(start_filter(), 2000, Pose(0.0, 0.0, 0.0))
    assert growth[0, 0] == pytest.approx(1e-6) and growth[1, 1] == pytest.approx(1e-6)
    assert growth[2, 2] == pytest.approx(1e-5)


def test_without_odometry_a_robot_may_have_driven_anywhere_at_its_speed():
    pose_filter = start_filter()
    for stamp_s in (1.3, 1.4):  # further ahead of odometry than poses wait
        expected = pose_filter.estimate()
        beyond_m = 0.2 * (stamp_s - expected.stamp_s)
        near = StampedPose(stamp_s, expected.pose._replace(x_m=expected.pose.x_m + 3.9 * beyond_m), SEEN_COVARIANCE)
        far = near._replace(pose=expected.pose._replace(x_m=expected.pose.x_m + 4.2 * beyond_m))
        assert pose_filter.add_measurement(far) is Outcome.OUTLIER
        assert pose_filter.add_measurement(near) is Outcome.USED
    turned = StampedPose(1.8, pose_filter.pose()._replace(yaw_rad=3.0), SEEN_COVARIANCE)
    assert pose_filter.add_measurement(turned) is Outcome.USED, "2 rad/s for 0.4 s: four deviations are 3.2 rad"


def test_a_measured_pose_is_weighed_by_its_uncertainty():
    pose_filter = start_filter(covariance=np.diag((4e-6, 1e-6, 9e-4)))
    pose_filter.add_odometry(1.05, Pose(0.0, 0.0, 0.0))
    measured = StampedPose(1.05, Pose(0.002, -0.002, 0.03), np.diag((1e-6, 4e-6, 1e-4)))
    assert pose_filter.add_measurement(measured) is Outcome.USED
    pose, covariance = pose_filter.estimate()[1:3]
    assert pose == pytest.approx((0.8 * 0.002, -0.2 * 0.002, 0.9 * 0.03), rel=1e-2)
    # What calibration leaves stays: 0.7 mm and 0.003 rad.
    assert np.diag(covariance) == pytest.approx((8e-7 + 4.9e-7, 8e-7 + 4.9e-7, 9e-5 + 9e-6), rel=1e-2)


def test_an_accurate_system_is_taken_at_its_word():
    pose_filter = start_filter(covariance=np.diag((1e-8, 1e-8, 1e-8)))
    assert np.diag(pose_filter.estimate().covariance) == pytest.approx([2e-8] * 3)


def test_a_covariance_must_be_positive_definite():
    rotated = np.array(((2.0, 0.9, 0.1), (0.9, 1.0, 0.2), (0.1, 0.2, 0.5)))
    start_filter(covariance=rotated)
    for row, column, value in ((0, 1, 1.42), (1, 2, 0.71), (0, 2, 1.01), (0, 1, -1.42)):
        wrong = rotated.copy()
        wrong[row, column] = wrong[column, row] = value
        assert np.linalg.eigvalsh(wrong).min() < 0.0
        with pytest.raises(ValueError, match="positive definite"):
            start_filter(covariance=wrong)


def test_correlated_poses_are_joined_as_the_kalman_filter_has_it():
    first = 1e-6 * np.array(((2.0, 0.9, 0.1), (0.9, 1.0, 0.2), (0.1, 0.2, 0.5)))
    second = 1e-6 * np.array(((1.0, -0.3, 0.4), (-0.3, 2.0, -0.5), (0.4, -0.5, 1.5)))
    pose_filter, seen = start_filter(covariance=first), np.array((1e-3, -5e-4, 8e-4))
    pose_filter.add_odometry(1.001, Pose(0.0, 0.0, 0.0))
    assert pose_filter.add_measurement(StampedPose(1.001, Pose(*seen), second)) is Outcome.USED
    pose, covariance = pose_filter.estimate()[1:3]
    joined = np.linalg.inv(np.linalg.inv(first) + np.linalg.inv(second))
    assert pose == pytest.approx(joined @ np.linalg.inv(second) @ seen, rel=1e-3)
    left = np.minimum((4.9e-7, 4.9e-7, 9e-6), np.diag(second))
    np.testing.assert_allclose(covariance, joined + np.diag(left), rtol=2e-3, atol=1e-9)


def test_rounding_below_zero_is_no_uncertainty():
    report = report_of(StampedPose(1.5, Pose(0.1, 0.2, 0.3), np.diag((-1e-18, 0.0, -1e-18))))
    assert (report.position_sd, report.yaw_sd) == (0.0, 0.0)
    assert (report.id, report.state, report.x, report.y, report.yaw) == (3, 1, 0.1, 0.2, 0.3)
