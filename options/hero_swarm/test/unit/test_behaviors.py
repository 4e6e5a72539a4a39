"""Each built-in behavior by its metric, beside robots that stand still and robots that walk at random."""

import inspect

import numpy as np
import pytest

from hero_client.values import BODY_RADIUS_M
from hero_sim.world import load_arena, place_robots
from hero_sim.world.arena import build_rectangle
from hero_swarm import metrics
from hero_swarm.behavior import Behavior
from hero_swarm.behaviors import find_behavior, list_names, make_behavior
from hero_swarm.behaviors.consensus import Formation, LeaderFollowers
from hero_swarm.behaviors.coverage import VoronoiCoverage
from hero_swarm.trial import OPEN, Trial, scatter_objects
from hero_test.nonempty import nonempty

ARENA = build_rectangle(1.71, 1.42, 1)
SQUARE = build_rectangle(2.0, 2.0, 1)
BOX = load_arena("box")
DISCS = build_rectangle(1.0, 1.0, 1)._replace(objects=load_arena("discs").objects[:3])
SEEDS = (5, 7)
WINDOW_S = 10

MILLING_GENOME = {"left0": 0.8, "right0": 1.0, "left1": 0.5, "right1": 0.6}

FRICTIONLESS = ("object_clustering", "wheel_genome")
"""Behaviors that need robots to slide along walls and each other: with friction, robots that meet stay where they are
(docs/benchmarks.md says how often each works with it)."""


class StandingStill(Behavior):
    def step(self, sensed, memory, random):
        return np.zeros(len(sensed.poses)), np.zeros(len(sensed.poses)), memory


class RandomWalk(Behavior):
    def step(self, sensed, memory, random):
        turn_rad_s = random.normal() if memory is None else 0.9 * memory + 0.5 * random.normal()
        return np.full(len(turn_rad_s), 0.1), turn_rad_s, turn_rad_s


def place(arena, robots, seeds):
    """Return starts of robots and places of objects where an arena has some; else None, to scatter them."""
    starts = objects = None
    if arena.objects:
        starts = np.array([place_robots(arena, robots, np.random.RandomState(seed)) for seed in seeds])
    if arena is DISCS:
        objects = [scatter_objects(arena, poses, seed) for poses, seed in zip(starts, seeds)]
    return starts, objects


def measure(behavior, metric, robots, time_s, arena=OPEN, size_m=(1.5, 1.5), known=(), is_met=lambda values: False):
    """Return the median of a metric (poses, velocities, trial) over the second half, at most WINDOW_S, for each seed.

    The trial ends sooner where the median over as long a time is_met already.
    """
    seeds = SEEDS[:1] if arena.objects or robots == 20 else SEEDS  # many contacts take long
    starts, objects = place(arena, robots, seeds)
    trial = Trial(behavior, arena, robots, seeds, size_m, starts=starts, objects=objects, known_errors=known)
    window_s, times_s, values = min(time_s / 2, WINDOW_S), [], []

    def find_median():
        return np.median([value for at_s, value in zip(times_s, values) if at_s >= times_s[-1] - window_s], axis=0)

    for now_s, poses in trial.run(time_s):
        times_s.append(now_s)
        values.append(metric(poses, trial.velocities, trial))
        if now_s >= window_s and len(values) % 5 == 0 and is_met(find_median()):
            break
    return find_median()


def by_name(name):
    return lambda poses, velocities, trial: metrics.METRICS[name](
        poses, velocities, trial.things.poses, BODY_RADIUS_M, trial.rows.world.arena
    )


def measure_side_error(poses, velocities, trial):
    """How far off a regular polygon its distances are, as a share of its side."""
    robots = poses.shape[1]
    sides_m = Formation.side_m * np.abs(np.sin(np.pi * np.arange(robots) / robots)) / np.sin(np.pi / robots)
    off_m = poses[..., :2] - poses[..., :2].mean(axis=1, keepdims=True)
    order = np.arctan2(off_m[..., 1], off_m[..., 0]).argsort(axis=1)
    poses = np.take_along_axis(poses, order[..., None], axis=1)
    off_m = [
        np.hypot(*(poses[:, first, :2] - poses[:, second, :2]).T) - sides_m[second - first]
        for first in range(robots) for second in range(first)
    ]  # fmt: skip
    return np.abs(off_m).max(axis=0) / Formation.side_m


def measure_gap_error(poses, velocities, trial):
    """How far off the gap each follower is at most, while the leader moves on."""
    gaps_m = np.hypot(*np.moveaxis(np.diff(poses[..., :2], axis=1), -1, 0))
    leads = np.hypot(*velocities[:, 0, :2].T) > 0.02
    return np.where(leads, np.abs(gaps_m - LeaderFollowers.gap_m).max(axis=1), 9.0)


def measure_mixing(poses, velocities, trial):
    """The share of robots whose nearest neighbor is of another group."""
    distances_m = np.hypot(*np.moveaxis(poses[:, :, None, :2] - poses[:, None, :, :2], -1, 0))
    distances_m[:, np.arange(poses.shape[1]), np.arange(poses.shape[1])] = np.inf
    return (distances_m.argmin(axis=2) % 2 != np.arange(poses.shape[1]) % 2).mean(axis=1)


def measure_lacking(poses, velocities, trial):
    """The number of centers of molecules that do not bind two robots which bind them, too; all without a memory."""
    if not isinstance(trial.memory, np.ndarray) or trial.memory.shape[1:] != (5,):
        return np.full(len(poses), 4.0)
    bound, kind = trial.memory[:, 2:4].astype(int), trial.memory[:, 4]
    is_back = (bound[bound] == np.arange(len(bound))[:, None, None]).any(axis=2) & (bound >= 0)
    return ((is_back.sum(axis=1) < 2) & (kind == 1)).reshape(poses.shape[:2]).sum(axis=1)


def measure_way_to_center(poses, velocities, trial):
    """The mean distance of robots from the middles of their cells, as Lloyd's algorithm has it."""
    grid_m = np.linspace(-0.975, 0.975, 40)
    points_m = np.array(np.meshgrid(grid_m, grid_m)).reshape(2, -1).T
    distances_m = []
    for places_m in poses[..., :2]:
        owner = ((points_m[:, None] - places_m) ** 2).sum(axis=2).argmin(axis=1)
        middles_m = [points_m[owner == row].mean(axis=0) for row in range(len(places_m))]
        distances_m.append(np.hypot(*(np.array(middles_m) - places_m).T).mean())
    return np.array(distances_m)


def measure_flock(poses, velocities, trial):
    """Order, if the robots move on and stay together; else nothing."""
    moves = np.hypot(*np.moveaxis(velocities[..., :2], -1, 0)).mean(axis=1) > 0.02
    together = metrics.cluster_fraction(poses[..., :2], 0.8) > 0.9
    return metrics.order(poses[..., 2]) * moves * together


def measure_agreement(poses, velocities, trial):
    if not isinstance(trial.memory, np.ndarray) or trial.memory.dtype != int:
        return np.zeros(len(poses))
    shares = trial.memory.reshape(poses.shape[:2]).mean(axis=1)
    return np.maximum(shares, 1.0 - shares)


# name: metric, its limit, whether it must be above, robots, seconds, arena, size of the start
CASES = {
    "aggregation": (by_name("dispersion_ratio"), 1.4, False, 20, 70, OPEN, (2.07, 2.07)),
    "evolved_aggregation": (by_name("cluster_fraction"), 0.9, True, 20, 50, ARENA, None),
    "cyclic_pursuit": (by_name("rotation"), 0.9, True, 20, 40, ARENA, None),
    "dispersal": (by_name("nearest_neighbor"), 0.22, True, 20, 40, ARENA, (0.6, 0.6)),
    "milling": (by_name("rotation"), 0.9, True, 20, 60, ARENA, None),
    "wall_following": (by_name("wall_following"), 0.7, True, 9, 60, ARENA, None),
    "wheel_genome": (by_name("rotation"), 0.7, True, 20, 130, ARENA, None),
    "flocking": (measure_flock, 0.9, True, 12, 30, OPEN, (1.0, 1.0)),
    "dispersion": (by_name("nearest_neighbor"), 0.45, True, 16, 30, OPEN, (0.6, 0.6)),
    "segregation": (measure_mixing, 0.1, False, 12, 40, OPEN, (1.2, 1.2)),
    "potential_segregation": (measure_mixing, 0.1, False, 12, 40, OPEN, (1.2, 1.2)),
    "random_fields": (measure_mixing, 0.1, False, 12, 60, SQUARE, None),
    "molecules": (measure_lacking, 3, False, 12, 60, SQUARE, None),
    "rendezvous": (by_name("consensus_error"), 0.2, False, 10, 30, OPEN, (2.0, 2.0)),
    "leader_followers": (measure_gap_error, 0.06, False, 5, 60, OPEN, (1.0, 1.0)),
    "formation": (measure_side_error, 0.1, False, 6, 90, OPEN, (1.2, 1.2)),
    "coverage": (measure_way_to_center, 0.03, False, 12, 40, SQUARE, (0.8, 0.8)),
    "object_clustering": (by_name("object_cluster_fraction"), 0.8, True, 2, 106, DISCS, None),
    "box_pushing": (by_name("object_distance"), 0.1, False, 2, 150, BOX, None),
    "cooperative_transport": (by_name("object_distance"), 0.1, False, 4, 150, BOX, None),
    "voter": (measure_agreement, 0.8, True, 6, 150, SQUARE, None),
    "majority": (measure_agreement, 0.85, True, 9, 300, SQUARE, None),
}


def make(name):
    return find_behavior(name)(**(MILLING_GENOME if name == "wheel_genome" else {}))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(CASES))
def test_a_behavior_does_what_its_metric_says(name):
    metric, limit, is_above, robots, time_s, arena, size_m = CASES[name]
    known = ["friction=0"] if name in FRICTIONLESS else ()

    def is_met(values):
        return (values >= limit if is_above else values <= limit).all()

    values = measure(make(name), metric, robots, time_s, arena, size_m, known, is_met)
    assert is_met(values), values


@pytest.mark.parametrize("name", sorted(CASES))
@pytest.mark.parametrize("behavior", [StandingStill, RandomWalk])
def test_standing_still_and_random_walks_fail_every_metric(name, behavior):
    metric, limit, is_above, robots, _, arena, size_m = CASES[name]
    values = measure(behavior(), metric, robots, 3, arena, size_m)
    assert (values < limit if is_above else values > limit).all(), values


@pytest.mark.parametrize("name", ["cyclic_pursuit", "milling", "wall_following"])
def test_the_limit_of_a_name_is_far_above_random_controllers(name):
    _, limit, *_ = CASES[name]
    assert metrics.score(find_behavior(name).metric, limit) >= 0.5


def test_every_behavior_is_tested_and_names_its_units_and_source():
    assert sorted(CASES) == list_names()
    for name in nonempty(list_names()):
        found = find_behavior(name)
        assert found.__doc__
        assert found.metric in metrics.METRICS
        source = inspect.getsource(inspect.getmodule(found))
        assert any(sign in source for sign in ("et al.", "Reynolds", "Olfati", "Krick", "Galam")), name


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ((np.zeros((6, 1)), 0.0, None), r"linear_m_s of shape \(6, 1\).*6 robots"),
        ((0.0, np.zeros(3), None), r"angular_rad_s of shape \(3,\)"),
        ((0.0, 0.0), "must return linear_m_s, angular_rad_s, memory, not"),
        (None, "not None"),
    ],
)
def test_a_step_that_gives_other_shapes_is_named(command, told):
    class Crooked(Behavior):
        def step(self, sensed, memory, random):
            return command

    with pytest.raises(ValueError, match=r"^Crooked.step\(\).*" + told):
        Trial(Crooked(), SQUARE, 3, [3, 4]).step()


def test_a_parameter_that_a_behavior_lacks_is_refused():
    assert VoronoiCoverage(width_m=3.0).width_m == 3.0
    with pytest.raises(TypeError, match="no parameter 'with_m'"):
        VoronoiCoverage(with_m=3.0)


def test_numbers_of_a_behavior_are_given_by_name_or_as_yaml():
    for given in ({"spacing_m": 0.3, "rate_hz": 5}, "{spacing_m: 0.3, rate_hz: 5}"):
        made = make_behavior("flocking", given)
        assert (made.spacing_m, made.rate_hz, made.cruise_m_s) == (0.3, 5, 0.05)
    assert make_behavior("flocking", "{}").spacing_m == 0.25
    for wrong, told in (
        ({"spacing": 0.3}, "flocking has no number 'spacing'; it has .*spacing_m"),
        ({"near": 0.3}, "no number 'near'"),
        ({"spacing_m": "0.3"}, "spacing_m is '0.3', but must be a number"),
        ({"spacing_m": float("nan")}, "spacing_m is nan"),
        ({"rate_hz": 0}, "rate_hz is 0, but must be a number from 0.1 to 100"),
        ("0.3", "is 0.3, but must be numbers such as"),
        ("{spacing_m", "not YAML"),
    ):
        with pytest.raises(ValueError, match="^parameters.*" + told):
            make_behavior("flocking", wrong)


def test_a_behavior_of_a_file_is_found_by_its_name(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(
        "from hero_swarm.behavior import Behavior\n"
        "class Mine(Behavior):\n"
        "    def step(self, sensed, memory, random):\n"
        "        return 0.1 + 0.0 * sensed.numbers, 0.0 * sensed.numbers, memory\n"
    )
    assert find_behavior(str(path)).__name__ == find_behavior("%s:Mine" % path).__name__ == "Mine"
    for wrong in ("nothing", "/nowhere.py", "%s:Other" % path):
        with pytest.raises(ValueError, match="behavior "):
            find_behavior(wrong)
