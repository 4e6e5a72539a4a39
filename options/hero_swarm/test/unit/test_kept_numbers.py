"""Safety filter, trials, sensors, metrics and learners on varied cases: their results must not change without a word.

See hero_test.checks.kept_results.
"""

import math
from typing import NamedTuple

import numpy as np
import pytest

from hero_client.values import MODELS
from hero_sim.world import load_arena
from hero_sim.world.arena import Area, build_rectangle
from hero_swarm import metrics
from hero_swarm.behavior import PULSES, Behavior, Floor, Light, Pheromone, Random, RangeAndBearing, sense
from hero_swarm.experiments.computing.starts import place_all
from hero_swarm.experiments.experiment_file import Start
from hero_swarm.learning.observation import Observation
from hero_swarm.learning.vector_env import SwarmVectorEnv
from hero_swarm.metrics.own import State, measure_metric
from hero_swarm.safety import FENCE, OFF, ROBOTS, SafetyFilter
from hero_swarm.trial import Trial, scatter_objects
from hero_test.checks.kept_results import check_sums

FENCE_M = np.array((-0.5, -0.4, 0.45, 0.35))


def draw_poses(worlds=3, robots=7, seed=1, reach_m=0.4):
    random = np.random.RandomState(seed)
    return random.uniform((-reach_m, -reach_m, -3.0), (reach_m, reach_m, 3.0), (worlds, robots, 3))


@pytest.mark.parametrize(
    ("mode", "fence_m", "neighbors", "kept"),
    [
        (OFF, None, 6, [7.5617589, 3.089998, 131]),
        (FENCE, FENCE_M, 6, [11.2601936, 7.3904216, 191]),
        (ROBOTS, None, 2, [25.3394894, 10.9160794, 191]),
        (ROBOTS, FENCE_M, 6, [22.1124051, -8.9676155, 191]),
    ],
)
def test_the_filter_gives_the_commands_that_it_gave(mode, fence_m, neighbors, kept):
    random, safe, found = np.random.RandomState(2), SafetyFilter(mode, fence_m), []
    safe.neighbors = neighbors
    safe.set_models([MODELS["hero_plus" if number % 3 == 1 else "hero"] for number in range(7)])
    for step in range(3):
        poses, ages_s = draw_poses(seed=step), random.uniform(0.0, 0.55, (3, 7))
        poses[0, 1], poses[1, 2, 2] = math.nan, math.nan
        linear_m_s, angular_rad_s = random.uniform(-0.25, 0.25, 21), random.uniform(-5.0, 5.0, 21)
        angular_rad_s[4] = math.inf if step == 1 else 0.0
        safe.others_m = random.uniform((-0.5, -0.5, 0.03), (0.5, 0.5, 0.07), (step, 3))
        found += [*safe(poses, linear_m_s, angular_rad_s, ages_s if step else None), safe.is_limited]
    check_sums(kept, *found, safe.calls, safe.limited_calls)


def test_a_filter_is_called_at_20_hz_or_more_often_unless_it_is_off():
    assert [SafetyFilter(mode, FENCE_M).rate_hz for mode in (OFF, FENCE, ROBOTS)] == [0.0, 20.0, 20.0]


def test_a_robot_whose_yaw_is_no_number_is_stopped_as_one_without_a_pose():
    poses = np.array([[(0.0, 0.0, 0.0), (0.1, 0.0, math.nan)]])
    linear_m_s, angular_rad_s = SafetyFilter(ROBOTS)(poses, np.full(2, 0.1), np.full(2, 0.5))
    assert linear_m_s[0] == pytest.approx((0.1, 0.0)) and angular_rad_s[0] == pytest.approx((0.5, 0.0))


AREAS = (
    Area("dark", (-1.0, -1.0, 0.1, 0.05), (0.0, 0.2, 0.1)),
    Area("light", (0.2, 0.2, 0.3), (1.0, 0.9, 0.8)),
    Area("picture", (-0.5, 0.1, 0.0, 0.5), (0.0, 0.0, 0.0), np.array([(0.1, 0.9, 0.4), (0.7, 0.3, 0.6)])),
)
FLOOR = build_rectangle(1.4, 1.2, 1)._replace(areas=AREAS, lamps_m=np.array([(0.4, 0.3), (-0.5, 0.1)]))


def test_virtual_sensors_give_what_they_gave():
    behavior, random, kept, found = Behavior(), Random([5, 6], 5), {}, []
    behavior.floor, behavior.lamp = Floor(ahead_m=0.03), Light(reach_m=0.4)
    behavior.radio, behavior.trail = RangeAndBearing(0.5, 0.3, 4.0), Pheromone(half_life_s=3.0, cell_m=0.3, reach_m=0.2)
    around = {"arena": FLOOR, "kept": kept}
    for step in range(6):
        poses = draw_poses(2, 5, seed=step, reach_m=0.75)
        poses[0, step % 5] = math.nan
        sensed = sense(behavior, 0.1 * step, poses, random, **around)
        for sensor in (sensed.floor, sensed.lamp, sensed.radio, sensed.trail):
            found += sensor
        around["messages"] = np.arange(20.0).reshape(10, 2) + step
        around["deposits"] = np.arange(10.0) / 5.0
    check_sums([-31.4924609, -69.5476864, 2050], *found)


@pytest.mark.parametrize("name", sorted(metrics.METRICS))
def test_each_metric_measures_what_it_did(name):
    poses, velocities = draw_poses(5, 8), 0.1 * draw_poses(5, 8, seed=2)
    velocities[:, ::3] *= 0.05
    poses[4, 2, 0] = math.nan
    arena = build_rectangle(0.9, 0.9, 1)._replace(circles_m=np.array([(0.1, 0.1, 0.08)]))
    state = State(1.0, poses, velocities, draw_poses(5, 3, 3), np.linspace(0.036, 0.06, 8), arena)
    found = [measure_metric(name, state)]
    if name in metrics.CHANCE:
        found.append(metrics.score(name, np.linspace(0.0, 1.0, 21)))
    check_sums(METRICS[name], *found)


METRICS = {
    "algebraic_connectivity": [3.6186452, 4.5818775, 5],
    "cluster_fraction": [5.4932702, -0.0222892, 26],
    "collisions": [2.1793735, 2.0515265, 5],
    "consensus_error": [4.6381883, 0.5189442, 5],
    "dispersion": [4.8730381, 5.7479391, 5],
    "dispersion_ratio": [5.0978407, 10.3107432, 5],
    "fatness": [4.8616993, 2.2039454, 5],
    "nearest_neighbor": [4.6387614, 0.1308902, 5],
    "object_cluster_fraction": [0.1223927, 1.3414239, 5],
    "object_distance": [-0.0599359, 0.7760309, 5],
    "order": [0.4889855, -0.5420408, 26],
    "rotation": [5.1538398, -1.7633753, 26],
    "wall_following": [4.7229267, -1.3302244, 26],
}


class Wander(Behavior):
    """Drives in curves that depend on all that it senses."""

    rate_hz = 8.0

    def step(self, sensed, memory, random):
        x_m, y_m, yaw_rad = np.nan_to_num(sensed.poses).T
        return 0.15 * np.cos(3.0 * x_m + yaw_rad) + 0.02 * random.normal(), 2.0 * np.sin(y_m - 2.0 * yaw_rad), memory

    def colors(self, memory):
        return None


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        ({}, [-1.7791966, 0.8992851, 231]),
        ({"errors": 0.0, "delay_s": 0.2}, [-3.3030875, 1.7374554, 231]),
        (
            {"drive": PULSES, "wifi": "bad", "known_errors": ["friction=0.2", "robot=1,lag_s=0.2"]},
            [-2.3565602, 1.2102032, 231],
        ),
        ({"safety": ROBOTS, "delay_s": 0.15, "errors": 2.0}, [-1.9179, -2.1199834, 231]),
        ({"arena": "box", "known_errors": ["wheel_friction=0.4"]}, [-6.6301459, -18.1835955, 252]),
        ({"is_point": True}, [1.246201, -1.3999715, 231]),
    ],
    ids=str,
)
def test_a_trial_drives_robots_to_where_it_did(options, kept):
    given = dict(options)
    arena = load_arena(given.pop("arena")) if "arena" in given else FLOOR
    mode = given.pop("safety", None)
    safe = None if mode is None else SafetyFilter(mode, np.array((-0.7, -0.6, 0.7, 0.6)))
    behavior = Wander(**{"drive": given.pop("drive")} if "drive" in given else {})
    trial = Trial(behavior, arena, 5, (3, 4), filter_commands=safe, **given)
    found = [trial.poses]
    for time_s, poses in trial.run(1.5, every_s=0.5):
        state = trial.state
        found += [time_s, state.time_s, poses, trial.velocities, state.objects, state.radii_m, trial.things.radii_m]
    check_sums(kept, *found)


def test_objects_are_scattered_where_they_were():
    arena, robots = load_arena("box"), draw_poses(1, 12, reach_m=0.5)[0]
    arena = arena._replace(objects=arena.objects * 4)
    found = [thing.pose for seed in range(8) for thing in scatter_objects(arena, robots, seed)]
    check_sums([2.9737138, 7.845585, 96], *found)


@pytest.mark.parametrize(
    ("start", "kept"),
    [
        (Start("uniform", 0.05, 0.01, None), [5.185556, -4.2764222, 63]),
        (Start("grid", 0.0, 0.03, None), [4.6730099, 6.0570998, 63]),
        (Start("circle", 0.0, 0.02, None), [-0.1352343, 0.2466849, 63]),
        (Start("arena", 0.0, 0.0, None), [-5.8558875, -2.2884803, 63]),
        (Start("file", 0.0, 0.0, "places.csv"), [-0.9245434, -0.493662, 63]),
    ],
    ids=lambda given: getattr(given, "kind", ""),
)
def test_robots_are_placed_where_they_were(start, kept):
    rows = b"# x, y, yaw\n" + b"\n".join(b"%f, %f, %f" % tuple(pose) for pose in 5.0 * draw_poses(1, 8)[0])
    arena = load_arena("empty") if start.kind != "file" else build_rectangle(9.0, 9.0, 1)
    check_sums(kept, place_all(start, arena, 7, [3, 5, 3], lambda path: rows))


def test_learners_observe_and_are_rewarded_as_they_were():
    sensors = {"trail": Pheromone(), "floor": Floor(), "lamp": Light()}
    arena = FLOOR._replace(bounds_m=np.array([-0.7, -0.6, 0.9, 0.7]))
    env = SwarmVectorEnv(2, 4, arena, 0.5, metric="order", rate_hz=8.0, neighbors=2, range_m=0.6, sensors=sensors)
    found, random = [env.reset(5)], np.random.RandomState(1)
    while not env.ended:
        found += [*env.step(random.uniform(-1.2, 1.2, (8, 2))), env.time_s]
    found.append(env.reset())
    check_sums([4.0173147, -46.6899321, 1332], *found)


def test_observations_have_the_defaults_of_their_document():
    assert Observation((0.0, 0.0, 1.0, 1.0)) == ((0.0, 0.0, 1.0, 1.0), 5, 1.0, {})


class Calls(NamedTuple):
    """A sensor that counts how often it was read since the worlds began."""

    def read(self, around):
        around.kept["calls"] = around.kept.get("calls", 0) + 1
        return np.full(around.poses.shape[0] * around.poses.shape[1], 0.1 * around.kept["calls"])


def test_what_sensors_keep_ends_with_its_episode():
    env = SwarmVectorEnv(2, 3, errors=0.0, metric=None, sensors={"calls": Calls()})
    for _ in range(2):
        observed = [env.reset(), *(env.step(np.zeros((6, 2)))[0] for _ in range(2))]
        assert np.array(observed)[..., -1] == pytest.approx(np.repeat([[0.1], [0.2], [0.3]], 6, axis=1))
