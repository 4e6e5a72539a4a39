"""The safety filter: no touch, where robots without it touch; and nothing changed where nothing is near."""

import math

import numpy as np
import pytest

from hero_client.controllers import nearest_allowed, steer
from hero_client.values import BODY_RADIUS_M, MAX_WHEEL_M_S, MODELS, WHEEL_SEPARATION_M
from hero_sim.stepped import StepSwarm
from hero_swarm.behavior import Behavior
from hero_swarm.metrics.graphs import measure_distances
from hero_swarm.safety import OFF, ROBOTS, TOLERANCE_M_S, SafetyFilter
from hero_swarm.trial import OPEN, Trial

FENCE_M = np.array((-0.7, -0.7, 0.7, 0.7))


class RandomWalk(Behavior):
    def step(self, sensed, memory, random):
        turn_rad_s = random.normal() if memory is None else 0.95 * memory + 0.4 * random.normal()
        return np.full(len(turn_rad_s), 0.12), turn_rad_s, turn_rad_s


@pytest.mark.slow
@pytest.mark.parametrize("mode", [OFF, ROBOTS])
def test_robots_that_walk_at_random_touch_only_without_the_filter(mode):
    trial = Trial(RandomWalk(), OPEN, 10, (1, 2, 3), (1.2, 1.2), filter_commands=SafetyFilter(mode, FENCE_M))
    nearest_m, farthest_m = np.inf, 0.0
    for _ in range(400):
        trial.step()
        nearest_m = min(nearest_m, measure_distances(trial.poses[..., :2]).min())
        farthest_m = max(farthest_m, np.abs(trial.poses[..., :2]).max())
    assert (nearest_m < 2.0 * BODY_RADIUS_M + 1e-4) == (mode == OFF)
    assert (farthest_m > 0.7 - BODY_RADIUS_M) == (mode == OFF)


@pytest.mark.slow
def test_wider_bodies_keep_a_wider_distance_from_robots_and_fence():
    places_m, radii_m = np.array([(-0.2, 0.0, 0.0), (0.2, 0.0, math.pi)]), np.array([BODY_RADIUS_M, 0.060])
    safe = SafetyFilter(ROBOTS, np.array((-0.3, -0.3, 0.3, 0.3)))
    safe.sidestep, safe.radii_m = 0.0, radii_m
    for way in (1.0, -1.0):
        poses = places_m.copy()
        for _ in range(200):
            poses[:, 0] += 0.05 * safe(poses[None], np.full(2, 0.1 * way), np.zeros(2))[0][0] * np.cos(poses[:, 2])
        if way > 0.0:
            gap_m = 2.0 * (2.0 * safe.lookahead_m + safe.margin_m)
            assert np.diff(poses[:, 0]) - radii_m.sum() == pytest.approx([gap_m])
        else:
            assert 0.3 - np.abs(poses[:, 0]) - radii_m == pytest.approx(np.full(2, safe.margin_m))


def test_far_from_everything_commands_stay_as_they_are():
    poses = np.array([[(0.0, 0.0, 0.5), (3.0, 0.0, 2.0)]])
    linear_m_s, angular_rad_s = np.array([[0.1, 0.05]]), np.array([[0.4, -1.0]])
    found = SafetyFilter(ROBOTS)(poses, linear_m_s, angular_rad_s)
    assert found[0] == pytest.approx(linear_m_s) and found[1] == pytest.approx(angular_rad_s)


def test_a_robot_without_a_fresh_pose_is_stopped_and_ignored():
    poses = np.array([[(0.0, 0.0, 0.0), (0.1, 0.0, math.pi), (np.nan, np.nan, np.nan)]])
    speeds = np.full((1, 3), 0.1)
    linear_m_s, angular_rad_s = SafetyFilter(ROBOTS)(poses, speeds, 0.0 * speeds, np.array([[0.0, 0.9, 0.0]]))
    assert linear_m_s[0, 0] == pytest.approx(0.1)
    assert not linear_m_s[0, 1:].any() and not angular_rad_s[0, 1:].any()


def test_a_speed_that_was_no_number_once_disturbs_nobody_later():
    poses = np.array([[(0.0, 0.0, 0.0), (0.4, 0.0, 0.0)]])
    speeds, ages_s = np.full((1, 2), 0.1), np.full((1, 2), 0.1)
    keep_apart = SafetyFilter(ROBOTS)
    keep_apart(poses, np.array([[np.nan, 0.1]]), np.array([[0.0, np.inf]]), ages_s)
    linear_m_s, angular_rad_s = keep_apart(poses, speeds, 0.0 * speeds, ages_s)
    assert linear_m_s == pytest.approx(speeds) and angular_rad_s == pytest.approx(0.0 * speeds)


def test_of_the_allowed_velocities_the_nearest_is_found():
    normals = np.array([[(1.0, 0.0), (0.0, 1.0)], [(-1.0, 0.0), (0.0, 1.0)]])
    bounds = np.array([[0.1, -np.inf], [0.0, 0.05]])
    found = nearest_allowed(np.array([(0.0, 0.02), (0.1, 0.0)]), normals, bounds, 0.2)
    assert found == pytest.approx(np.array([(0.1, 0.02), (0.0, 0.05)]))
    fast = nearest_allowed(np.array([(0.3, 0.4)]), normals[:1], np.array([[-1.0, -1.0]]), 0.2)
    assert fast == pytest.approx(np.array([(0.12, 0.16)]))


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1.0, 1e300])
def test_no_wanted_speed_makes_robots_touch_or_leave_the_fence(factor):
    names = ["hero_plus" if number % 3 == 1 else "hero" for number in range(8)]
    swarm = StepSwarm(8, seed=2, model=["%s,robot=%d" % (name, number) for number, name in enumerate(names)])
    rows = swarm.rows
    half_m = np.abs(rows.world.poses[:, :2]).max() + 0.12
    safe = SafetyFilter(ROBOTS, half_m * np.array((-1.0, -1.0, 1.0, 1.0)))
    safe.set_models([MODELS[name] for name in names])
    radii_m, rows_of_all = np.array(safe.radii_m), np.arange(8)
    nearest_m, farthest_m = np.inf, -np.inf
    for _ in range(250):
        poses = rows.world.poses.copy()
        nearest_m = min(nearest_m, (measure_distances(poses[None, :, :2])[0] - radii_m[:, None] - radii_m).min())
        farthest_m = max(farthest_m, (np.abs(poses[:, :2]).max(axis=1) + radii_m - half_m).max())
        bearings_rad = np.arctan2(-poses[:, 1], 2.0 - poses[:, 0]) - poses[:, 2]
        bearings_rad -= 2.0 * np.pi * np.rint(bearings_rad / (2.0 * np.pi))
        linear_m_s, angular_rad_s = safe(poses[None], np.full(8, 0.2 * factor), 6.0 * factor * bearings_rad)
        rows.send_velocity(rows_of_all, linear_m_s[0], angular_rad_s[0])
        rows.advance(rows.now_ms + 50)
    assert nearest_m > 0.005 and farthest_m < 0.0


def test_speeds_beyond_the_limits_count_as_the_fastest_of_their_curve():
    poses = np.array([[(0.0, 0.0, 0.0), (9.0, 0.0, 0.0), (18.0, 0.0, 0.0)]])
    safe = SafetyFilter(ROBOTS)
    for factor in (1.0, 1e3, 1e307):
        linear_m_s, angular_rad_s = safe(poses, factor * np.array((0.3, 0.2, 0.0)), factor * np.array((0.0, 4.0, 9.0)))
        assert linear_m_s[0, 0] == pytest.approx(0.2) and angular_rad_s[0, 2] == pytest.approx(6.0)
        assert angular_rad_s[0, 1] / linear_m_s[0, 1] == pytest.approx(20.0)
        assert linear_m_s[0, 1] + angular_rad_s[0, 1] * WHEEL_SEPARATION_M / 2.0 == pytest.approx(MAX_WHEEL_M_S)
        assert safe.is_limited.all()
    linear_m_s, angular_rad_s = safe(poses, np.array((0.2, 0.1, np.nan)), np.array((0.0, -2.0, 1.0)))
    assert safe.is_limited.tolist() == [[False, False, True]]
    assert linear_m_s[0, 2] == angular_rad_s[0, 2] == 0.0


def test_the_outer_wheel_of_each_model_keeps_within_its_limit():
    models = [MODELS["hero"], MODELS["hero_plus"]]
    safe = SafetyFilter(ROBOTS)
    safe.set_models(models)
    linear_m_s, angular_rad_s = safe(np.array([[(0.0, 0.0, 0.0), (9.0, 0.0, 0.0)]]), np.full(2, 0.2), np.full(2, 4.0))
    arms_m = np.array([model.wheel_separation_m for model in models]) / 2.0
    assert linear_m_s[0] + angular_rad_s[0] * arms_m == pytest.approx(np.full(2, MAX_WHEEL_M_S))
    assert linear_m_s[0, 0] != linear_m_s[0, 1] and safe.radii_m == [model.body_radius_m for model in models]


class LeaveTogether(Behavior):
    """All robots drive to one place outside of the fence as fast as they can, or back away to there, turning on."""

    direction = 1.0

    def step(self, sensed, memory, random):
        x_m, y_m, yaw_rad = sensed.poses.T
        bearing_rad = np.arctan2(-y_m, 3.0 - x_m) - yaw_rad
        turn_rad = bearing_rad - 2.0 * np.pi * np.rint(bearing_rad / (2.0 * np.pi))
        return self.direction * 0.2, self.direction * 6.0 * turn_rad, memory


def leave_together(rate_hz, delay_s, direction=1.0):
    """Return the least distance between two robots, and how far the farthest was outside of the fence, m."""
    behavior, safe = LeaveTogether(rate_hz=rate_hz, direction=direction), SafetyFilter(ROBOTS, FENCE_M)
    trial = Trial(behavior, OPEN, 8, (1, 2, 3), (1.2, 1.2), delay_s=delay_s, filter_commands=safe)
    nearest_m, farthest_m = [], []

    def watch(_):
        poses = trial.rows.world.poses.reshape(trial.poses.shape)
        nearest_m.append(measure_distances(poses[..., :2]).min())
        farthest_m.append(np.abs(poses[..., :2]).max())

    trial.rows.on_cycle.append(watch)
    assert np.abs(list(trial.run(12.0))[-1][1][..., :2]).max() > 0.55, "or they did not drive"
    assert len(nearest_m) > 300
    return min(nearest_m) - 2.0 * BODY_RADIUS_M, max(farthest_m) + BODY_RADIUS_M - 0.7


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [1.0, 20.0])
def test_behaviors_that_decide_seldom_are_filtered_as_often_as_others(rate_hz):
    gap_m, outside_m = leave_together(rate_hz, 0.0)
    assert gap_m > 0.0 and outside_m < 0.0


@pytest.mark.slow
def test_robots_that_spin_and_back_away_do_not_drift_through_the_fence():
    gap_m, outside_m = leave_together(20.0, 0.0, direction=-1.0)
    assert gap_m > 0.0 and outside_m < -0.005


@pytest.mark.slow
@pytest.mark.parametrize(("rate_hz", "delay_s"), [(20.0, 0.2), (1.0, 0.5)])
def test_robots_whose_poses_are_old_neither_touch_nor_leave_the_fence(rate_hz, delay_s):
    gap_m, outside_m = leave_together(rate_hz, delay_s)
    assert gap_m > 0.0 and outside_m < 0.0


RING_M = 0.6


class CrossRing(Behavior):
    """Each robot drives to the opposite place of a ring."""

    def step(self, sensed, memory, random):
        x_m, y_m, yaw_rad = sensed.poses.T
        angle_rad = 2.0 * np.pi * sensed.numbers / sensed.count + np.pi
        to_x_m, to_y_m = RING_M * np.cos(angle_rad) - x_m, RING_M * np.sin(angle_rad) - y_m
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        forward_m_s, left_m_s = 0.5 * (cosine * to_x_m + sine * to_y_m), 0.5 * (cosine * to_y_m - sine * to_x_m)
        return (*steer(forward_m_s, left_m_s, 0.1), memory)


def cross_ring(mode):
    """Return when all ten robots of each world are across, and the least distance between two."""
    angles_rad = 2.0 * np.pi * np.arange(10) / 10
    ring_m = RING_M * np.column_stack((np.cos(angles_rad), np.sin(angles_rad)))
    turned_rad = np.random.RandomState(1).normal(0.0, 0.3, (3, 10, 1)) + angles_rad[:, None] + np.pi
    starts = np.concatenate((np.broadcast_to(ring_m, (3, 10, 2)), turned_rad), axis=2)
    trial = Trial(CrossRing(), OPEN, 10, (1, 2, 3), starts=starts, filter_commands=SafetyFilter(mode))
    across_s, nearest_m = np.full(3, np.inf), np.inf
    while np.isinf(across_s).any() and trial.rows.now_ms < 40000:
        now_s = trial.step()
        are_across = (np.hypot(*np.moveaxis(trial.poses[..., :2] + ring_m, -1, 0)) < 0.05).all(axis=1)
        across_s = np.where(are_across, np.minimum(across_s, now_s), across_s)
        nearest_m = min(nearest_m, measure_distances(trial.poses[..., :2]).min())
    return np.median(across_s), nearest_m


@pytest.mark.slow
def test_robots_cross_a_ring_untouched_in_little_more_time_than_pushing():
    pushing_s, _ = cross_ring(OFF)
    across_s, nearest_m = cross_ring(ROBOTS)
    assert nearest_m > 2.0 * BODY_RADIUS_M + 0.01
    assert across_s < 1.3 * pushing_s


WORLDS, ROBOTS_EACH = 40, 5
POINT_RADIUS_M = BODY_RADIUS_M + SafetyFilter.lookahead_m + SafetyFilter.margin_m


def draw_worlds(seed):
    """Return poses and wanted speeds of crowded worlds, whose steered points keep their distance and the fence."""
    random = np.random.RandomState(seed)
    poses = np.empty((0, ROBOTS_EACH, 3))
    while len(poses) < WORLDS:
        drawn = random.uniform((-0.45, -0.3, -math.pi), (0.45, 0.3, math.pi), (4000, ROBOTS_EACH, 3))
        points_m = find_points(drawn)
        apart_m = measure_distances(points_m).min(axis=(1, 2))
        inside = (np.abs(points_m) < (0.5 - POINT_RADIUS_M, 0.35 - POINT_RADIUS_M)).all(axis=(1, 2))
        poses = np.concatenate((poses, drawn[(apart_m > 2.0 * POINT_RADIUS_M) & inside]))
    speeds = random.uniform((-0.2, -3.0), (0.2, 3.0), (WORLDS, ROBOTS_EACH, 2))
    return poses[:WORLDS], speeds[..., 0], speeds[..., 1]


def find_points(poses):
    headings = np.stack((np.cos(poses[..., 2]), np.sin(poses[..., 2])), axis=-1)
    return poses[..., :2] + SafetyFilter.lookahead_m * headings


def find_velocities(poses, linear_m_s, angular_rad_s):
    """Return the velocities of the steered points."""
    cosine, sine = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    aside_m_s = SafetyFilter.lookahead_m * angular_rad_s
    return np.stack((cosine * linear_m_s - sine * aside_m_s, sine * linear_m_s + cosine * aside_m_s), axis=-1)


SMALL_FENCE_M = np.array((-0.5, -0.35, 0.5, 0.35))


def measure_slack(poses, velocities_m_s, fence_m):
    """Return how much slower than allowed pairs and fences are closed, at least (W, N)."""
    points_m = find_points(poses)
    away_m = points_m[:, :, None] - points_m[:, None]
    distances_m = measure_distances(points_m)
    closing_m_s = -(away_m * velocities_m_s[:, :, None]).sum(axis=-1) / distances_m
    slack = (0.5 * SafetyFilter.gain_1_s * (distances_m - 2.0 * POINT_RADIUS_M) - closing_m_s).min(axis=2)
    for axis in (0, 1):
        for sign, edge_m in ((-1.0, fence_m[axis]), (1.0, fence_m[axis + 2])):
            left_m = sign * (edge_m - points_m[..., axis]) - POINT_RADIUS_M
            slack = np.minimum(slack, SafetyFilter.fence_gain_1_s * left_m - sign * velocities_m_s[..., axis])
    return slack


@pytest.mark.parametrize("sidestep", [0.0, SafetyFilter.sidestep])
def test_no_pair_and_no_fence_is_closed_faster_than_allowed(sidestep):
    poses, linear_m_s, angular_rad_s = draw_worlds(1)
    safe = SafetyFilter(ROBOTS, SMALL_FENCE_M)
    safe.sidestep = sidestep
    found = safe(poses, linear_m_s.ravel(), angular_rad_s.ravel())
    assert measure_slack(poses, find_velocities(poses, *found), SMALL_FENCE_M).min() > -TOLERANCE_M_S - 1e-9
    wanted_m_s = find_velocities(poses, linear_m_s, angular_rad_s)
    assert (measure_slack(poses, wanted_m_s, SMALL_FENCE_M) < -1e-3).any(axis=1).mean() > 0.7, "or nothing was shown"
    assert np.abs(found[0]).max() <= 0.2 and np.abs(found[1]).max() <= 6.0


def test_no_other_allowed_velocity_is_nearer_to_the_wanted_one():
    poses, linear_m_s, angular_rad_s = draw_worlds(2)
    safe = SafetyFilter(ROBOTS, SMALL_FENCE_M)
    safe.sidestep, safe.max_angular_rad_s, safe.max_wheel_m_s = 0.0, 100.0, 100.0
    found_m_s = find_velocities(poses, *safe(poses, linear_m_s, angular_rad_s))
    wanted_m_s = find_velocities(poses, linear_m_s, angular_rad_s)
    off_m_s = np.hypot(*np.moveaxis(found_m_s - wanted_m_s, -1, 0))
    random = np.random.RandomState(3)
    for spread_m_s in (0.002, 0.02, 0.2):
        for _ in range(30):
            others_m_s = found_m_s + random.normal(0.0, spread_m_s, found_m_s.shape)
            allowed = measure_slack(poses, others_m_s, SMALL_FENCE_M) >= 0.0
            allowed &= np.hypot(*np.moveaxis(others_m_s, -1, 0)) <= safe.max_speed_m_s
            others_off_m_s = np.hypot(*np.moveaxis(others_m_s - wanted_m_s, -1, 0))
            assert (others_off_m_s >= off_m_s - 2e-3)[allowed].all()


def test_commands_depend_on_where_robots_are_to_each_other_alone():
    poses, linear_m_s, angular_rad_s = draw_worlds(4)
    expected = SafetyFilter(ROBOTS)(poses, linear_m_s, angular_rad_s)
    turn_rad, order = 2.0, [3, 0, 4, 1, 2]
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    x_m, y_m, yaw_rad = np.moveaxis(poses, -1, 0)
    turned = np.stack((cosine * x_m - sine * y_m + 7.0, sine * x_m + cosine * y_m - 3.0, yaw_rad + turn_rad), axis=-1)
    assert np.allclose(SafetyFilter(ROBOTS)(turned, linear_m_s, angular_rad_s), expected, atol=1e-6)
    ordered = SafetyFilter(ROBOTS)(poses[:, order], linear_m_s[:, order], angular_rad_s[:, order])
    assert np.allclose(ordered, np.array(expected)[..., order], atol=1e-6)
    mirrored, plain = SafetyFilter(ROBOTS), SafetyFilter(ROBOTS)
    mirrored.sidestep = plain.sidestep = 0.0
    linear_found, angular_found = plain(poses, linear_m_s, angular_rad_s)
    found = mirrored(np.stack((x_m, -y_m, -yaw_rad), axis=-1), linear_m_s, -angular_rad_s)
    assert np.allclose(found, (linear_found, -angular_found), atol=1e-6), "left as right"


def test_only_the_nearest_robots_are_looked_at():
    poses, linear_m_s, angular_rad_s = draw_worlds(5)
    safe = SafetyFilter(ROBOTS)
    safe.neighbors = 2
    found = np.array(safe(poses, linear_m_s, angular_rad_s))
    nearest = measure_distances(find_points(poses)).argsort(axis=2)[..., :2]
    worlds = np.arange(WORLDS)
    for robot in range(ROBOTS_EACH):
        rows = np.column_stack((np.full(WORLDS, robot), nearest[:, robot]))
        three = [values[worlds[:, None], rows] for values in (poses, linear_m_s, angular_rad_s)]
        assert np.allclose(np.array(SafetyFilter(ROBOTS)(*three))[..., 0], found[..., robot], atol=1e-6)
