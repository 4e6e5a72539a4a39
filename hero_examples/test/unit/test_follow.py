"""follow in virtual time: chains of robots behind a leader that drives a curve."""

import numpy as np
import pytest
import true_paths
from program_runs import Run

from hero_client import CommonFrame
from hero_client.controllers import FollowLaw, Lateness
from hero_client.values import BODY_RADIUS_M
from hero_sim.stepped import StepSwarm

pytest.importorskip("rospy", reason="the program imports rospy")
from hero_examples.swarm import follow
from hero_test.nonempty import nonempty

ARENA = """
bounds_m: [-2, -2, 2, 2]
starts_m_deg: [[0, 0, 0], [-0.25, 0, 0], [-0.5, 0, 0]]
"""

GAP_M = 0.15


def follow_curve(folder, perfect, leader_s):
    """Let the leaders of 20 worlds drive a curve for leader_s and stop; return the paths."""
    arena = folder / "row.yaml"
    arena.write_text(ARENA)
    with StepSwarm(3, seed=1, arena=str(arena), perfect=perfect, worlds=20) as swarm:
        commons = [(CommonFrame("world"), Lateness()) for _ in swarm.worlds]

        def step(time_s):
            for world, (common, lateness) in zip(swarm.worlds, commons):
                if time_s < leader_s:
                    world[0].drive(0.08, 0.25)
                follow.step(world, common, FollowLaw(gap_m=GAP_M), lateness)

        return true_paths.run(swarm, step, leader_s + 8.0)


@pytest.mark.slow
def test_a_chain_follows_a_curve_keeps_its_gaps_and_stops(tmp_path):
    for path in nonempty(follow_curve(tmp_path, True, leader_s=30.0)):
        gaps_m = true_paths.measure_gaps(path)[:, [0, 1], [1, 2]] + 2.0 * BODY_RADIUS_M
        assert true_paths.measure_lengths(path).min() > 1.5
        assert gaps_m.min() > 2.0 * BODY_RADIUS_M + 0.01
        assert gaps_m[len(path) // 3 :].max() < 0.28
        assert np.abs(gaps_m[-1] - GAP_M).max() < 0.03
        assert np.ptp(path[-15:, :, :2], axis=0).max() < true_paths.REST


@pytest.mark.slow
def test_a_chain_whose_odometry_drifts_follows_without_touching(tmp_path):
    for path in nonempty(follow_curve(tmp_path, False, leader_s=15.0)):
        assert true_paths.measure_lengths(path).min() > 0.8
        assert true_paths.measure_gaps(path).min() > 0.01


class HiddenLeader(CommonFrame):
    """A frame in which hero_0 has no pose any more while it is hidden."""

    is_hidden = False

    def pose_of(self, robot):
        pose = super().pose_of(robot)
        return None if self.is_hidden and robot.robot_id == 0 else pose


def test_a_follower_whose_leader_is_not_known_any_more_stops(tmp_path):
    arena = tmp_path / "row.yaml"
    arena.write_text(ARENA)
    with StepSwarm(3, arena=str(arena)) as swarm:
        common, lateness = HiddenLeader("world"), Lateness()

        def step(time_s):
            swarm[0].drive(0.08, 0.0)
            follow.step(swarm, common, FollowLaw(gap_m=GAP_M), lateness)

        true_paths.run(swarm, step, 2.0)
        assert swarm[1].velocity.linear_m_s > 0.05
        common.is_hidden = True
        (path,) = true_paths.run(swarm, step, 1.0)  # the robot's own watchdog would take 2 s
        moved_m, leader_m = true_paths.measure_lengths(path[len(path) // 2 :])[[1, 0]]
        assert moved_m < true_paths.REST < leader_m


def test_robots_without_poses_in_the_frame_are_named():
    with StepSwarm(2) as swarm:
        common = CommonFrame("nowhere")
        true_paths.run(swarm, lambda time_s: follow.step(swarm, common, FollowLaw(), Lateness()), 0.2)
        assert all("nowhere" in common.missing[name] for name in ("hero_0", "hero_1"))


@pytest.mark.parametrize(("gap_m", "linear_m_s"), [(0.15, 0.02), (0.5, 0.0)])
def test_the_program_follows_as_its_parameters_say(monkeypatch, tmp_path, gap_m, linear_m_s):
    arena = tmp_path / "row.yaml"
    arena.write_text(ARENA)
    with StepSwarm(2, seed=1, arena=str(arena), perfect=True) as swarm:
        log = swarm.log()
        monkeypatch.setattr(follow, "Swarm", lambda ids, proximity: swarm)
        Run(monkeypatch, follow, swarm, 0.6, robots="0 1", linear_m_s=0.02, gap_m=gap_m)()
        assert log.command[10, 0, :, 0] == pytest.approx([0.0, linear_m_s])
