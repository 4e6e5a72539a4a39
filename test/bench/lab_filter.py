"""Accuracy of the filter's poses and standard deviations: robots stepped in process, measured late, and occluded.

Part of script/bench lab_camera.
"""

import math
import tempfile
from typing import Callable, Dict, List, Tuple

import numpy as np

from hero_localization.filter.pose_filter import Outcome, PoseFilter, make_covariance
from hero_localization.filter.pose_hypothesis import StampedPose
from hero_node import Pose, wrap_angle
from hero_sim.stepped import StepSwarm

AGES_S = (0.0, 0.008, 0.02, 0.05, 0.1, 0.15, 0.2)
AGE_ROBOTS, AGE_S = 6, 12.0
COVER_ROBOTS, SEEN_S, COVERED_S = 20, 1.0, 10.0
BIAS_SD, NOISE_SD = (0.0007, 0.0007, 0.003), (0.0003, 0.0003, 0.003)
DRIVES: Dict[str, Callable[[float], Tuple[float, float]]] = {
    "at rest": lambda now_s: (0.0, 0.0),
    "straight": lambda now_s: (0.2, 0.0),
    "circle": lambda now_s: (0.2, 1.0),
    "turn": lambda now_s: (0.0, 2.0),
    "curves": lambda now_s: (0.15, 1.5 * math.sin(1.3 * now_s)),
}
WIDE_M = 6.0
"""Between robots that meet neither each other nor a wall."""


def describe_wide_arena(count: int) -> str:
    """Return an arena in which no robot meets another one, or a wall."""
    starts = [f"  - [{WIDE_M * (index % 5):g}, {WIDE_M * (index // 5):g}, 40]" for index in range(count)]
    return "bounds_m: [-5, -5, 35, 35]\nstarts_m_deg:\n" + "\n".join(starts)


class SteppedRobots:
    """Stepped robots, each with a filter; measured poses of them have errors of calibration and of chance."""

    def __init__(self, count: int, seed: int, drive: Callable[[float], Tuple[float, float]]) -> None:
        self.random, self.drive = np.random.RandomState(seed), drive
        with tempfile.NamedTemporaryFile("w", suffix=".yaml") as file:
            file.write(describe_wide_arena(count))
            file.flush()
            self.swarm = StepSwarm(count=count, seed=seed, arena=file.name)
        self.filters = [PoseFilter() for _ in range(count)]
        self.biases = self.random.normal(0.0, BIAS_SD, (count, 3))
        self.covariance = make_covariance(math.hypot(BIAS_SD[0], NOISE_SD[0]), math.hypot(BIAS_SD[2], NOISE_SD[2]))
        self.at_odometry = np.zeros((count, 3))
        """True poses at the newest odometry."""
        self.swarm.rows.on_cycle.append(self._receive)

    @property
    def true(self) -> np.ndarray:
        """True poses (N, 3) now: the world is up to a step behind."""
        world = self.swarm.rows.world
        moved_m, turned_rad = (self.swarm.rows.now_ms - world.time_ms) / 1e3 * world.measure_body_speeds().T
        headings_rad = world.poses[:, 2] + turned_rad / 2.0
        return world.poses + np.column_stack(
            (moved_m * np.cos(headings_rad), moved_m * np.sin(headings_rad), turned_rad)
        )

    def _receive(self, rows: np.ndarray) -> None:
        true = self.true
        for row in rows.tolist():
            self.at_odometry[row] = true[row]
            self.filters[row].add_odometry(self.swarm.now_s, Pose(*map(float, self.swarm.rows.odometry[row])))

    def step(self, duration_s: float) -> None:
        """Drive on."""
        for robot in self.swarm.robots:
            robot.drive(*self.drive(self.swarm.now_s))
        self.swarm.sleep(duration_s)

    def take(self) -> List[StampedPose]:
        """Measure all robots."""
        noise = self.random.normal(0.0, NOISE_SD, self.biases.shape)
        poses = self.true + self.biases + noise
        return [StampedPose(self.swarm.now_s, Pose(*map(float, pose)), self.covariance) for pose in poses]

    def list_errors(self) -> np.ndarray:
        """Return errors of x, y (m) and yaw, with the reported standard deviations, (N, 5)."""
        rows = []
        for pose_filter, true in zip(self.filters, self.at_odometry):
            estimate = pose_filter.estimate()
            assert estimate is not None
            pose, covariance = estimate.pose, estimate.covariance
            position_sd, yaw_sd = math.sqrt((covariance[0, 0] + covariance[1, 1]) / 2.0), math.sqrt(covariance[2, 2])
            yaw_rad = wrap_angle(pose.yaw_rad - true[2])
            rows.append((pose.x_m - true[0], pose.y_m - true[1], yaw_rad, position_sd, yaw_sd))
        return np.array(rows)


def measure_ages() -> None:
    """Print errors of the filter's poses by the age of the measured ones, 100 Hz, 0.2 m/s."""
    print("age of measured poses, ms: error of the filter's, mm rms, and rejected share")
    for age_s in AGES_S:
        robots = SteppedRobots(AGE_ROBOTS, 2, lambda now_s: (0.2, 1.5 * math.sin(now_s)))
        robots.biases[:] = 0.0  # motion capture
        waiting: List[List[StampedPose]] = []
        outcomes: List[Outcome] = []
        errors: List[np.ndarray] = []
        while robots.swarm.now_s < AGE_S:
            robots.step(0.01)
            waiting.append(robots.take())
            while waiting and waiting[0][0].stamp_s <= robots.swarm.now_s - age_s + 1e-9:
                for pose_filter, measurement in zip(robots.filters, waiting.pop(0)):
                    outcomes.append(pose_filter.add_measurement(measurement))
            if robots.swarm.now_s > 2.0:
                errors.append(robots.list_errors()[:, :2])
        rms_mm = 1e3 * math.sqrt((np.array(errors) ** 2).sum(axis=2).mean())
        rejected = outcomes.count(Outcome.OUTLIER) / len(outcomes)
        print(f"  {1000.0 * age_s:5.0f} {rms_mm:6.2f} mm, {100.0 * rejected:.2f} % rejected", flush=True)


def measure_uncertainty(seeds: int) -> None:
    """Print errors by the reported standard deviations, and robots that count as kidnapped after an occlusion."""
    print(f"errors by reported standard deviations: position, yaw while tracked; after {COVERED_S:g} s of occlusion")
    kidnapped = covers = 0
    for name, drive in DRIVES.items():
        shares: List[List[np.ndarray]] = [[], []]
        for seed in range(seeds):
            robots = SteppedRobots(COVER_ROBOTS, seed, drive)
            for index, end_s in enumerate((SEEN_S, SEEN_S + COVERED_S)):
                while robots.swarm.now_s < end_s:
                    robots.step(0.05)
                    if index == 0:
                        for pose_filter, measurement in zip(robots.filters, robots.take()):
                            pose_filter.add_measurement(measurement)
                shares[index].append(robots.list_errors())
            for _ in range(8):
                robots.step(0.05)
                for pose_filter, measurement in zip(robots.filters, robots.take()):
                    kidnapped += pose_filter.add_measurement(measurement) is Outcome.MOVED
            covers += COVER_ROBOTS
        figures = []
        for parts in shares:
            x_m, y_m, yaw_rad, position_sd, yaw_sd = np.vstack(parts).T
            figures.append(math.sqrt(((x_m**2 + y_m**2) / (2.0 * position_sd**2)).mean()))
            figures.append(math.sqrt(((yaw_rad / yaw_sd) ** 2).mean()))
        print("  %-10s %.2f %.2f; %.2f %.2f" % (name, *figures), flush=True)
    print("  kidnapped by mistake: %d of %d occlusions" % (kidnapped, covers), flush=True)
