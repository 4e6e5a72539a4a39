"""Limits of the safety filter, of trials and of episodes: ages, fences, delays, rewards, and where runs begin."""

import math

import numpy as np
import pytest

from hero_client.values import BODY_RADIUS_M, MAX_LINEAR_M_S
from hero_node import Pose
from hero_sim.world.arena import build_rectangle, is_free
from hero_sim.world.arena_file import load_arena
from hero_swarm import metrics
from hero_swarm.behavior import Behavior, Neighbors
from hero_swarm.experiments.computing.starts import _place_in_circle, _place_in_grid, place_all
from hero_swarm.experiments.experiment_file import Start
from hero_swarm.learning.observation import MAX_LEARNED_ANGULAR_RAD_S, count_observations
from hero_swarm.learning.vector_env import SwarmVectorEnv
from hero_swarm.safety import FENCE, MAX_AGE_S, ROBOTS, SafetyFilter
from hero_swarm.trial import OPEN, Trial, is_clear, scatter
from hero_test.nonempty import nonempty

RADIUS_M = BODY_RADIUS_M + 0.03 + 0.012
"""Of the body around the steered point, with the margin."""


def keep_safe(poses, linear_m_s, angular_rad_s=0.0, mode=ROBOTS, fence_m=None, ages_s=None, safe=None):
    count = len(poses)
    speeds = [np.broadcast_to(np.array(values, dtype=float), (1, count)) for values in (linear_m_s, angular_rad_s)]
    ages_s = None if ages_s is None else np.array([ages_s])
    found = (safe or SafetyFilter(mode, fence_m))(np.array([poses], dtype=float), *speeds, ages_s)
    return [tuple(map(float, pair)) for pair in zip(found[0][0], found[1][0])]


def make_filter(mode, fence_m=None):
    """Return a filter that lets robots close half of what is left in a second, and does not turn them aside."""
    safe = SafetyFilter(mode, fence_m)
    safe.gain_1_s, safe.sidestep = 2.0, 0.0
    return safe


def test_two_robots_close_no_faster_than_what_is_left_of_their_distance():
    for left_m, expected_m_s in ((0.05, 0.05), (0.2, 0.1), (0.0, 0.0), (-0.02, -0.02)):
        apart_m = left_m + 2.0 * RADIUS_M + 0.06  # both steered points lie 0.03 m nearer
        safe = make_filter(ROBOTS)
        commands = keep_safe([(0, 0, 0), (apart_m, 0, math.pi)], 0.1, safe=safe)
        assert commands == [pytest.approx((expected_m_s, 0.0), abs=1e-6)] * 2
    safe.sidestep = 1.0
    commands = keep_safe([(0, 0, 0), (0.05 + 2.0 * RADIUS_M + 0.06, 0, math.pi)], 0.1, safe=safe)
    assert commands[0] == pytest.approx((0.05, -0.05 / 0.03), abs=1e-6), "what is left over goes to the right"
    poses, wide_m = [(0, 0, 0), (0.0 + 2.0 * RADIUS_M + 0.06, 0, math.pi)], np.array((-9.0, -9.0, 9.0, 9.0))
    free = keep_safe(poses, 0.1, mode=FENCE, fence_m=wide_m)
    assert free == [pytest.approx((0.1, 0.0))] * 2


def test_robots_that_are_not_commanded_are_given_all_of_the_way():
    for left_m, expected_m_s in ((0.05, 0.1), (0.0, 0.0), (-0.02, -0.04)):
        safe = make_filter(ROBOTS)
        safe.others_m = np.array([(9.0, 0.0, 0.06), (0.03 + RADIUS_M + 0.06 + left_m, 0.0, 0.06)])
        assert keep_safe([(0, 0, 0)], 0.2, safe=safe) == [pytest.approx((expected_m_s, 0.0), abs=1e-6)]
        safe.mode = FENCE
        assert keep_safe([(0, 0, 0)], 0.2, safe=safe) == [pytest.approx((0.2, 0.0))]


def test_a_fence_is_approached_no_faster_than_its_distance_allows():
    fence_m = np.array((-1.0, -0.5, 1.0, 0.5))
    for pose in (
        (0.9 - RADIUS_M, 0, 0),
        (-0.9 + RADIUS_M, 0, math.pi),
        (0, 0.4 - RADIUS_M, math.pi / 2),
        (0, RADIUS_M - 0.4, -math.pi / 2),
    ):
        safe = make_filter(FENCE, fence_m)
        away = (pose[0] - 0.03 * math.cos(pose[2]), pose[1] - 0.03 * math.sin(pose[2]), pose[2])
        assert keep_safe([away], 0.2, safe=safe) == [pytest.approx((0.2, 0.0), abs=1e-6)]
        near = (
            pose[0] + 0.05 * math.cos(pose[2]) - 0.03 * math.cos(pose[2]),
            pose[1] + 0.02 * math.sin(pose[2]),
            pose[2],
        )
        assert keep_safe([near], 0.2, safe=safe) == [pytest.approx((0.1, 0.0), abs=1e-6)]


def test_a_robot_whose_pose_is_older_than_half_a_second_is_stopped():
    for age_s, expected_m_s in ((MAX_AGE_S, 0.1), (MAX_AGE_S + 0.01, 0.0)):
        assert keep_safe([(0, 0, 0)], 0.1, ages_s=[age_s]) == [(pytest.approx(expected_m_s), pytest.approx(0.0))]


def test_commands_keep_their_limits_and_their_curve():
    assert keep_safe([(0, 0, 0)], 0.3) == [pytest.approx((0.2, 0.0))]
    ((linear_m_s, angular_rad_s),) = keep_safe([(0, 0, 0)], 0.05, 6.5)
    assert angular_rad_s == pytest.approx(6.0) and linear_m_s / angular_rad_s == pytest.approx(0.05 / 6.5, rel=0.05)
    with pytest.raises(ValueError, match="safety 'walls': must be one of off, fence, fence and robots"):
        SafetyFilter("walls")
    with pytest.raises(ValueError, match="safety fence needs a fence"):
        SafetyFilter(FENCE)


class Note(Behavior):
    """Drives straight on, and keeps what it sensed."""

    rate_hz = 10.0

    def step(self, sensed, memory, random):
        poses = [*(memory or []), (sensed.time_s, sensed.poses.copy())]
        return np.full(len(sensed.poses), 0.1), 0.0 * sensed.poses[:, 0], poses


def test_a_trial_senses_poses_of_a_while_ago_and_tells_speeds():
    for delay_s, steps in ((0.0, 0), (0.2, 2), (0.25, 3)):
        trial = Trial(Note(), OPEN, 2, (1,), (1.0, 1.0), delay_s=delay_s)
        true = []
        for time_s, poses in nonempty(trial.run(1.0, every_s=0.1)):
            true.append(poses[0].copy())
            assert time_s == pytest.approx(0.1 * (len(true) - 1))
            if len(true) > 1:
                assert trial.velocities[0] == pytest.approx((true[-1] - true[-2]) * 10.0)
        assert len(true) == len(trial.memory) == 10
        for number, (time_s, seen) in nonempty(enumerate(trial.memory)):
            assert time_s == pytest.approx(0.1 * number) and seen == pytest.approx(true[max(0, number - steps)])
    assert len(list(Trial(Note(), OPEN, 1, (1,), (1.0, 1.0)).run(2.0, every_s=0.5))) == 4


class Write(Behavior):
    """Writes into what it senses, after it has taken copies."""

    near = Neighbors()

    def __init__(self, name):
        super().__init__()
        self._name = name

    def step(self, sensed, memory, random):
        copied = sensed.poses.copy()
        copied -= 1.0
        values = sensed.near.forward_m if self._name == "near" else getattr(sensed, self._name)
        values[:1] += 1
        return 0.0, 0.0, memory


@pytest.mark.parametrize("name", ["poses", "numbers", "is_known", "near"])
def test_a_behavior_that_writes_into_what_it_senses_is_told_to_copy(name):
    trial = Trial(Write(name), OPEN, 2, (1,), (1.0, 1.0))
    before = trial.poses.copy()
    with pytest.raises(ValueError, match=r"^Write.step\(\) writes into .* read-only: copy it first") as caught:
        trial.step()
    assert caught.traceback[-1].name == "step", "the line that writes"
    assert (trial.poses == before).all()


def test_poses_that_a_trial_yields_are_read_only_and_starts_the_callers():
    starts = np.zeros((1, 2, 3)) + ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    trial = Trial(Note(), OPEN, 2, (1,), starts=starts)
    starts[...] = 9.0
    for _, poses in nonempty(trial.run(0.5, every_s=0.1)):
        assert np.abs(poses).max() < 1.0
        for values in (poses, trial.velocities):
            with pytest.raises(ValueError, match="read-only"):
                values[0, 0, 0] = 7.0


@pytest.mark.slow
def test_robots_are_scattered_inside_and_apart():
    poses = scatter(10, 1.0, 0.5, 3, gap_m=0.02)
    apart_m = np.hypot(*np.moveaxis(poses[:, None, :2] - poses[None, :, :2], -1, 0)) + np.eye(10)
    assert apart_m.min() > 2.0 * BODY_RADIUS_M + 0.02
    assert np.abs(poses[:, 0]).max() < 0.5 - BODY_RADIUS_M and np.abs(poses[:, 1]).max() < 0.25 - BODY_RADIUS_M
    assert np.abs(poses[:, 2]).max() > 2.0 and np.abs(poses[:, 1]).max() > 0.1
    with pytest.raises(ValueError, match=r"60 robots find no place in 0.5 m x 0.5 m"):
        scatter(60, 0.5, 0.5, 1)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["obstacles", "maze", "box", "discs"])
def test_robots_are_never_scattered_into_what_an_arena_holds(name):
    arena = load_arena(name)
    trial = Trial(Note(), arena, 10, range(20))
    for poses in nonempty(trial.poses.reshape(-1, 3)):
        assert is_free(Pose(*poses), (), arena, BODY_RADIUS_M - 1e-6)
    uniform = place_all(Start("uniform", 0.03, 0.0, None), arena, 10, range(20))
    assert all(is_free(Pose(*pose), (), arena, BODY_RADIUS_M - 1e-6) for pose in nonempty(uniform.reshape(-1, 3)))
    low_m, high_m = arena.bounds_m.reshape(2, 2)
    assert (uniform[..., :2] > low_m).all() and (uniform[..., :2] < high_m).all()


@pytest.mark.slow
def test_an_arena_without_room_for_the_robots_is_refused():
    full = build_rectangle(1.0, 1.0, 1)._replace(circles_m=np.array([(0.0, 0.0, 0.7)]), name="full")
    with pytest.raises(ValueError, match="3 robots find no place in 1 m x 1 m of arena full"):
        Trial(Note(), full, 3, (1,))


def test_starts_in_rows_and_circles_have_their_spacing():
    grid = _place_in_grid(7, 0.1, 5)
    assert grid[:, :2].tolist() == pytest.approx(
        np.array([(-0.1, -0.1), (0, -0.1), (0.1, -0.1), (-0.1, 0), (0, 0), (0.1, 0), (-0.1, 0.1)])
    )
    assert np.ptp(grid[:, 2]) > 1.0 and (grid == _place_in_grid(7, 0.1, 5)).all()
    circle = _place_in_circle(6, 0.1)
    assert np.hypot(circle[:, 0], circle[:, 1]) == pytest.approx(np.full(6, 0.1))
    assert circle[:, 2] == pytest.approx(
        [math.pi / 2, 5 * math.pi / 6, -5 * math.pi / 6, -math.pi / 2, -math.pi / 6, math.pi / 6]
    )
    assert _place_in_circle(1, 0.1)[0, :2] == pytest.approx((0.05, 0.0))


def test_an_episode_rewards_what_gets_better_and_observes_shares():
    arena = build_rectangle(2.0, 1.0, 3)
    episode = SwarmVectorEnv(1, 3, arena, errors=0.0, neighbors=2, range_m=0.8)
    rising = SwarmVectorEnv(1, 3, arena, errors=0.0, metric="cluster_fraction")
    plain = SwarmVectorEnv(1, 3, arena, errors=0.0, metric=None)
    for env in (episode, rising, plain):
        env.reset(7)
    values = [metrics.dispersion_ratio(episode._poses[..., :2])[0]]
    for _ in range(5):
        observed, rewards = episode.step(np.array([(5.0, 0.0), (0.5, -1.0), (-1.0, 0.0)]))
        values.append(metrics.dispersion_ratio(episode._rows.world.poses[None, :, :2])[0])
        assert rewards == pytest.approx(np.full(3, values[-2] - values[-1])), "a falling metric"
        assert plain.step(np.zeros((3, 2)))[1].tolist() == [0.0] * 3
        before = metrics.cluster_fraction(rising._poses[..., :2])[0]
        gain = rising.step(np.array([(1.0, 0.0), (0.5, -1.0), (-1.0, 0.0)]))[1][0]
        assert gain == pytest.approx(metrics.cluster_fraction(rising._poses[..., :2])[0] - before)
    assert episode.time_s == pytest.approx(0.5)
    assert observed.shape == (3, count_observations(2)) == (3, 18)
    poses, rows = episode._poses[0], episode._rows
    assert observed[:, 8:10] == pytest.approx(rows.velocities / (MAX_LINEAR_M_S, MAX_LEARNED_ANGULAR_RAD_S), abs=1e-6)
    assert observed[:, 10:12] == pytest.approx(poses[:, :2] / (1.0, 0.5), abs=1e-6)
    assert observed[:, 12:14] == pytest.approx(np.column_stack((np.cos(poses[:, 2]), np.sin(poses[:, 2]))), abs=1e-6)
    for row, pose in enumerate(poses):
        others = sorted((math.dist(pose[:2], other[:2]), index) for index, other in enumerate(poses) if index != row)
        for column, (range_m, index) in nonempty(enumerate(others)):
            shares = observed[row, 14 + 2 * column : 16 + 2 * column]
            if range_m > 0.8:
                assert shares.tolist() == [0.0, 0.0]
                continue
            bearing_rad = math.atan2(poses[index, 1] - pose[1], poses[index, 0] - pose[0]) - pose[2]
            expected = range_m / 0.8 * np.array((math.cos(bearing_rad), math.sin(bearing_rad)))
            assert shares == pytest.approx(expected, abs=1e-6)
    assert observed[:, :8].min() >= 0.0 and observed[:, :8].max() == 1.0


def test_a_place_is_clear_up_to_an_overlap_that_is_allowed():
    arena = build_rectangle(1.0, 1.0, 1)
    places_m = np.array([(0.5 - BODY_RADIUS_M + into_m, 0.0) for into_m in (-0.001, 0.001, 0.003)])
    assert is_clear(places_m, arena).tolist() == [True, False, False]
    assert is_clear(places_m, arena, 0.002).tolist() == [True, True, False]
    rim_m = 50.0 + 5e-10 * np.array([(0, 0), (1, 1), (-1, -1)])  # of a plane without walls, rounded
    assert is_clear(rim_m, OPEN).all() and is_clear(-rim_m, OPEN).all()
    assert not is_clear(np.array([(50.001, 0), (-50.001, 0), (0, 50.001), (0, -50.001)]), OPEN).any()


@pytest.mark.parametrize("is_point", [False, True])
def test_yaws_lie_side_by_side_in_memory(is_point):
    """Else numpy rounds their cosines one way or another, as memory happens to be used: bytes would not be the same."""
    trial = Trial(Behavior(), OPEN, 3, (1, 2), (1.0, 1.0), is_point=is_point)
    trial.behavior.step = lambda sensed, memory, random: (0.1, 0.0, memory)
    for _ in range(2):
        for yaws_rad in (trial.poses[..., 2], trial.state.poses[..., 2], trial.state.sensed.poses[:, 2]):
            assert yaws_rad.flags.c_contiguous
        trial.step()


def test_yaws_lie_side_by_side_where_robots_learn():
    env = SwarmVectorEnv(robots=3, worlds=2)
    env.reset(seed=1)
    for _ in range(2):
        assert env._poses[..., 2].flags.c_contiguous
        env.step(np.zeros((6, 2)))
