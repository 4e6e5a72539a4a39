"""Rules of segregation by potentials and by random fields against closed forms, and points in place of robots."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hero_client.values import Neighbors, sense_neighbors
from hero_swarm.behavior import Behavior
from hero_swarm.behaviors import find_behavior
from hero_swarm.behaviors.random_fields import BURNED, LOST, SAMPLES, Molecules, RandomFields, find_potential
from hero_swarm.behaviors.spacing import PotentialSegregation
from hero_swarm.metrics.own import State, measure_metric
from hero_swarm.trial import OPEN, Trial

MEASURES = Path(__file__).resolve().parents[2] / "src" / "hero_swarm" / "published" / "measures.py"


class Sideways(Behavior):
    """Drives ahead, and turns as steer() does for a velocity to the left."""

    rate_hz = 10.0

    def step(self, sensed, memory, random):
        return 0.1, 0.2 / 0.06, memory


def test_points_move_to_any_side_and_stop_at_the_bounds():
    arena = OPEN._replace(bounds_m=np.array([-1.0, -1.0, 1.0, 1.0]))
    starts = np.array([[(0.0, 0.0, 0.0), (0.01, 0.0, np.pi / 2)]])
    trial = Trial(Sideways(), arena, 2, [1], starts=starts, is_point=True)
    for _ in range(20):
        trial.step()
    assert trial.poses[0] == pytest.approx(np.array([(0.2, 0.4, 0.0), (0.01 - 0.4, 0.2, np.pi / 2)]))
    for _ in range(100):
        trial.step()
    assert trial.poses[0, 0] == pytest.approx((1.0, 1.0, 0.0)) and trial.poses[0, 1, 0] == -1.0


@pytest.mark.slow
@pytest.mark.parametrize(("groups", "rest_m"), [(1, 0.2), (2, 1.0)])
def test_two_robots_rest_at_the_distance_of_their_groups(groups, rest_m):
    starts = np.array([[(0.0, 0.0, 1.0), (0.5, 0.0, 2.0)]])
    trial = Trial(
        PotentialSegregation(groups=groups, max_linear_m_s=1.0, max_angular_rad_s=30.0),
        OPEN,
        2,
        [1],
        starts=starts,
        is_point=True,
    )
    trial.step()
    moved_m = 0.5 - np.hypot(*(trial.poses[0, 0, :2] - trial.poses[0, 1, :2]))
    assert 20.0 * moved_m == pytest.approx((0.5 - rest_m) * (1.0 + (0.1 / 0.5) ** 2), abs=1e-9)
    for _ in range(300):
        trial.step()
    assert np.hypot(*(trial.poses[0, 0, :2] - trial.poses[0, 1, :2])) == pytest.approx(rest_m, abs=1e-4)


def test_the_potential_is_that_of_coulomb_and_buckingham():
    for sign in (1.0, -1.0):
        coulomb = -16.0 * sign / (4.0 * np.pi * 0.04 * 0.5)
        buckingham = 0.04 * (6.0 / (1.0 - 6.0) * np.exp(1.0) * (1.0 - 0.5 / 0.8) - 1.0 / (1.0 - 6.0) * (0.8 / 0.5) ** 6)
        assert find_potential(np.array(0.5), np.array(sign)) == pytest.approx(coulomb + buckingham)
    apart = np.linspace(0.1, 2.0, 1901)
    # Where the derivative is zero, 31.83 / r^2 = 0.048 * 0.8^6 / r^7, but for the small linear term.
    assert apart[find_potential(apart, np.ones_like(apart)).argmin()] == pytest.approx(0.209, abs=0.003)
    assert (np.diff(find_potential(apart, -np.ones_like(apart))) < 0.0).all(), "other groups repel at any distance"


def find_energies(groups, apart_m, velocities):
    """Return the energies (S,) of the first of two robots at rest that is apart_m behind the other one."""
    poses = np.array([[(0.0, 0.0, 0.7), (apart_m, 0.0, -2.0)]])
    behavior = RandomFields()
    near = sense_neighbors(poses, Neighbors(range_m=behavior.near.range_m))
    given = np.repeat(np.array(velocities, dtype=float).T[:, :, None], 2, axis=2)
    signs = {}
    behavior.choose = lambda sensed, memory, found, *rest: signs.update(found=found) or np.zeros((3, 2))
    sensed = SimpleNamespace(near=near, numbers=np.array(groups), poses=poses[0])
    behavior.step(sensed, None, None)
    return behavior.find_energies(sensed, np.zeros((2, 2)), signs["found"], behavior.mass, given)[:, 0]


def test_a_velocity_is_the_likelier_the_nearer_it_leads_to_the_own_group():
    ahead, away = (1.0, 0.0), (-1.0, 0.0)
    own = find_energies((0, 0), 0.4, (ahead, away, (0.0, 0.0)))
    assert own[0] < own[1] - 1.0
    apart = 0.8 * (0.4 - 0.008) / 0.45
    assert own[0] == pytest.approx(find_potential(apart, 1.0) + 0.15 * 2.0 * (1.0 + 1.0 - 1.0), abs=1e-3)
    assert own[2] == pytest.approx(find_potential(0.8 * 0.4 / 0.45, 1.0) + 0.15 * 2.0, abs=1e-3)
    assert find_energies((0, 0), 0.665, (away,))[0] > LOST / 2.0, "the own group is not left"
    others = find_energies((0, 1), 0.4, (ahead, away))
    assert others[0] == pytest.approx(others[1]), "other groups count only within safe_m"
    near = find_energies((0, 1), 0.12, (ahead, away))
    assert near[1] < near[0] - 1.0


def test_the_chain_takes_what_is_likelier_and_leaves_out_its_beginning():
    velocities = np.zeros((2, SAMPLES + 1, 1))
    velocities[0, :, 0] = np.arange(SAMPLES + 1)
    chances, same = np.full((SAMPLES, 1), 0.99), np.zeros((SAMPLES + 1, 1))
    all_taken = RandomFields._draw(velocities, same, chances)
    assert all_taken[0, 0] == pytest.approx(np.mean(range(BURNED + 1, SAMPLES + 1)))
    same[5:] = 20.0
    assert RandomFields._draw(velocities, same, chances)[0, 0] == 4.0, "those that cost much are not taken"
    likely = RandomFields._draw(velocities, same, np.zeros_like(chances))
    assert likely[0, 0] == all_taken[0, 0], "but for the rare chance"


@pytest.mark.parametrize("kind", [RandomFields, Molecules])
def test_robots_move_alike_whatever_worlds_are_beside_theirs(kind):
    poses = []
    for seeds in ([1], [2, 1]):
        trial = Trial(kind(), OPEN, 12, seeds, size_m=(0.6, 0.6), is_point=True)
        for _ in range(5):
            trial.step()
        poses.append(trial.poses[-1])
    assert (poses[0] == poses[1]).all()


def test_clusters_are_chains_of_nearest_robots_of_a_group():
    places = [(0, 0), (9, 9), (1, 0), (9.5, 9), (5, 0), (30, 9), (2, 0), (9, 9.5)]
    poses = np.array([[(x, y, 0.0) for x, y in places]] * 2)
    poses[1, 4, 0] = 3.0
    state = State(0.0, poses, np.zeros_like(poses), np.empty((2, 0, 3)), 0.037, memory=np.tile((0, 1), 8))
    assert measure_metric(f"{MEASURES}:chained_clusters", state).tolist() == [4.0, 3.0]


def bind(places, kind, bound, bonds=2):
    """Return which rows each robot binds now, as lists, and the neighborhood."""
    poses = np.array([[(x, y, 0.3) for x, y in places]])
    near = sense_neighbors(poses, Neighbors(range_m=1.0))
    found = Molecules(bonds=bonds).bind(near, np.array(kind), np.array(bound))
    return [[row for row in rows if row >= 0] for rows in found.tolist()]


def test_a_hydrogen_binds_the_nearest_center_before_other_hydrogens():
    places, kind = [(0, 0), (0.1, 0), (0.3, 0), (0.5, 0)], [0, 0, 1, 1]
    nothing = np.full((4, 2), -1)
    assert bind(places, kind, nothing) == [[2], [2], [1, 0], [1, 0]]
    assert bind(places[:2], kind[:2], nothing[:2]) == [[1], [0]]
    # Bound to each other, hydrogens have room for a center, which takes one; one of a center has none for another one.
    assert bind(places, kind, [[1, -1], [0, -1], [-1, -1], [-1, -1]])[2:] == [[1], [1]]
    assert bind(places, kind, [[2, -1], [2, -1], [1, 0], [-1, -1]]) == [[2], [2], [1, 0], []]


def test_a_full_center_keeps_its_own_and_molecules_have_no_rings():
    places, kind = [(0, 0), (0.2, 0), (0, 0.2), (0.1, 0.1)], [1, 0, 0, 0]
    full = [[1, 2], [0, -1], [0, -1], [-1, -1]]
    assert bind(places, kind, full) == [[3, 1], [0], [0], []], "the center would take the nearest, which finds no room"
    # Two centers that share a hydrogen: it does not bind the second, as both bind the same one.
    shared = bind([(0, 0), (0.1, 0), (0.2, 0)], [1, 0, 1], [[1, -1], [0, 2], [1, -1]], 2)
    assert shared[1] == [0]


def test_at_first_molecules_bind_as_robots_that_were_not_bound():
    starts = np.array([[(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.2, 0.0)]])
    trial = Trial(Molecules(), OPEN, 3, [1], starts=starts)
    trial.step()
    assert trial.memory[:, 2:-1].tolist() == [[1, 2], [0, -1], [0, -1]]


def test_molecules_and_their_missing_bonds_are_counted_as_published():
    # Water; a pair of hydrogens; a center that binds one which binds another one.
    bound = [[1, 2], [0, -1], [0, -1], [4, -1], [3, -1], [1, -1]]
    kind = [1, 0, 0, 0, 0, 1]
    memory = np.column_stack((np.zeros((6, 2)), bound, kind))
    poses = np.zeros((1, 6, 3))
    state = State(0.0, poses, poses, np.empty((1, 0, 3)), 0.037, memory=memory)
    assert measure_metric(f"{MEASURES}:molecules", state).tolist() == [2.0]
    assert measure_metric(f"{MEASURES}:missing_bonds", state).tolist() == [2.0]


def test_accelerated_points_feel_the_forces_and_damping_of_the_program():
    kind = find_behavior(str(MEASURES.with_name("accelerated.py")))
    starts = np.array([[(0.0, 0.0, 1.0), (3.0, 0.0, 2.0)]])
    trial = Trial(kind(groups=2), OPEN, 2, [1], starts=starts, is_point=True)
    trial.step()
    force = (3.0 - 5.0) + (1.0 / 3.0 - 5.0 / 9.0)  # towards the other one, of another group
    assert trial.memory[0, 2:4] == pytest.approx((force, 0.0), abs=1e-12)
    assert trial.poses[0, :, 0] == pytest.approx((0.5 * force * 1e-4, 3.0 - 0.5 * force * 1e-4), abs=1e-9)
    trial.step()
    apart = trial.poses[0, 1, 0] - trial.poses[0, 0, 0]
    assert trial.memory[0, 2] == pytest.approx(0.98 * force, abs=1e-3) and apart > 3.0
    noisy = Trial(kind(groups=2, noise=0.3), OPEN, 2, [1], starts=starts, is_point=True)
    noisy.step()
    assert 0.01 < abs(noisy.memory[0, 2] - force) < 0.3 * 3.0
    state = State(0.0, *[noisy.poses] * 2, np.empty((1, 0, 3)), 0.037, memory=noisy.memory)
    assert measure_metric(f"{MEASURES}:effort", state)[0] == pytest.approx(np.abs(noisy.memory[:, 2:4]).sum())


def test_items_and_robots_on_the_spot_are_counted_by_their_floor():
    kept, counts = {}, []
    for areas in ((1, 0), (-1, 2), (0, 0), (0, 1)):
        sensed = SimpleNamespace(floor=SimpleNamespace(area=np.array(areas)))
        poses = np.zeros((1, 2, 3))
        state = State(0.0, poses, poses, np.empty((1, 0, 3)), 0.037, sensed=sensed, kept=kept)
        counts.append([measure_metric(f"{MEASURES}:{name}", state)[0] for name in ("items", "on_spot")])
    assert counts == [[0, 1], [0, 0], [2, 2], [2, 1]]
