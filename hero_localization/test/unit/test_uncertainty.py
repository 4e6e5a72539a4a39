"""Whether the reported uncertainty is the true error: stepped robots that are seen, and then covered for 10 s."""

import math

import numpy as np
import pytest

from hero_localization.filter.pose_filter import Measurement, Outcome, PoseFilter, make_covariance
from hero_localization.nodes.outputs import make_robot_pose
from hero_node.geometry import Pose, wrap_angle
from hero_sim.stepped.swarm import StepSwarm

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
                self.outcomes[row].append(pose_filter.add_measurement(Measurement(now_s, pose, COVARIANCE)))

    def normalize_errors(self):
        """Return errors of place and yaw, rms over the robots, by what is reported of them."""
        shares = []
        for pose_filter, true in zip(self.filters, self.true):
            pose, covariance = pose_filter.estimate()[1:]
            report = make_robot_pose(0, 0, None, pose, covariance)
            off_m = math.hypot(pose.x_m - true[0], pose.y_m - true[1])
            off_rad = wrap_angle(pose.yaw_rad - true[2])
            shares.append((off_m / (math.sqrt(2.0) * report.position_sd), off_rad / report.yaw_sd))
        return np.sqrt((np.array(shares) ** 2).mean(axis=0))


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


def test_position_sd_is_that_of_one_axis():
    report = make_robot_pose(0, 0, None, Pose(0.0, 0.0, 0.0), np.diag((4e-6, 16e-6, 9e-4)))
    assert report.position_sd == pytest.approx(math.sqrt(10e-6))
    assert report.yaw_sd == pytest.approx(0.03)
