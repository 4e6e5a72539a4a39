"""Segregation by velocities that are sampled from a Gibbs random field."""

from typing import Any, Tuple

import numpy as np

from hero_client.controllers import steer
from hero_node.parameters import whole_number

from ..behavior import Command, Neighborhood, Neighbors, Proximity, Random, Sensed, turn
from .clearance import keep_clear
from .spacing import Segregation

SAMPLES, BURNED = 100, 60
"""Velocities that are drawn in a step, and how many of them do not count for the mean."""

LOST = 1e4
"""Energy of losing sight of a robot of the own group."""

UNIT_CHARGE, UNBOUND = 16.0, -3e-5
"""Product of charges that attracts as a robot of the own group does, and how robots repel that do not bind."""

CANDIDATES = 12
"""Nearest neighbors that a robot may bind."""


def find_potential(apart: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return the Coulomb and Buckingham potential at distances in units; sign: 1 attracts, -1 repels.

    Its constants are those of the paper's program: well depth 0.04, radius 0.8, steepness 1, charges 16 and 1.
    """
    share = 0.8 / apart
    cube = share * share * share  # which numpy computes 20 times as fast as a power
    energy: np.ndarray = 0.04 * (0.2 * cube * cube - 1.2 * np.e * (1.0 - 1.25 * apart)) - sign * 125.0 / np.pi * share
    return energy


class RandomFields(Segregation):
    """Robots move with those of their own group, and away from the others, by velocities drawn from a random field.

    After P. Rezeck et al., Flocking-segregative swarm behaviors using Gibbs random fields, ICRA 2021. A velocity is the
    likelier, the lower the potential of the neighbors where it leads and the kinetic energy relative to the own group.
    The memory holds of each robot its velocity in the common frame, as a share of max_linear_m_s, and its group;
    neighbors tell each other theirs.

    Attributes:
        unit_m: of the potential's lengths.
        nearness: share of a distance that the potential is taken at.
        safe_m: within it robots of other groups repel.
        mass: of a robot, in the kinetic energy.
        spread: of drawn velocities, as a share of max_linear_m_s.
    """

    near = Neighbors(range_m=0.67)
    infrared = Proximity()
    rate_hz = 10.0
    unit_m = 0.45
    nearness = 0.8
    safe_m = 0.135
    clear_m = 0.1
    mass = 0.3
    spread = 0.2
    max_linear_m_s = 0.08
    settings = {name: Segregation.settings[name] for name in ("groups", "max_linear_m_s")}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near, group = sensed.near, sensed.numbers % int(self.groups)
        is_own = near.seen & (group[near.rows] == group[:, None])
        signs = np.where(is_own, 1.0, np.where(near.seen & (near.range_m < self.safe_m), -1.0, 0.0))
        wanted, *speeds = self.choose(sensed, memory, signs, self.mass, random)
        return speeds[0], speeds[1], np.column_stack((wanted, group))

    def choose(
        self, sensed: Sensed, memory: Any, signs: np.ndarray, mass: Any, random: Random
    ) -> Tuple[np.ndarray, Any, Any]:
        """Return velocities that are drawn from the field (R, 2), and the speeds that steer robots so.

        signs: how strongly each neighbor attracts, as in find_potential(); 0: it does not count. mass: (R,) or one.
        """
        own = np.zeros((2, len(signs))) if memory is None else memory[:, :2].T
        velocities = np.empty((2, SAMPLES + 1, len(signs)))
        velocities[:, 0] = own
        drawn = random.normal(2 * SAMPLES).T.reshape(SAMPLES, 2, -1)
        velocities[:, 1:] = own[:, None] + self.spread * drawn.swapaxes(0, 1)
        velocities /= np.maximum(np.hypot(*velocities), 1.0)
        energies = self.find_energies(sensed, own, signs, mass, velocities)
        wanted = self._draw(velocities, energies, random.random(SAMPLES).T)
        clear_m_s = keep_clear(sensed.infrared.ranges_m, self.clear_m, 2.0)
        ahead_m_s, left_m_s = self.max_linear_m_s * turn(wanted, -sensed.poses[:, 2]) + clear_m_s
        return (wanted.T, *steer(ahead_m_s, left_m_s, self.max_linear_m_s, max_angular_rad_s=self.max_angular_rad_s))

    def find_energies(
        self, sensed: Sensed, own: np.ndarray, signs: np.ndarray, mass: Any, velocities: np.ndarray
    ) -> np.ndarray:
        """Return the energies (S, R) of velocities (2, S, R); own: those of now (2, R); signs, mass: see choose()."""
        near, yaw_rad = sensed.near, sensed.poses[:, 2]
        reach = self.max_linear_m_s / self.rate_hz  # m in a step at full speed
        energies, relative = np.zeros(velocities.shape[1:]), np.zeros_like(velocities)
        flock = np.ones_like(energies)
        for is_own, counts in ((True, signs > 0.0), (False, signs < 0.0)):
            # One neighbor of each robot at a time, and only of robots that have so many: arrays stay in the cache.
            neighbors, total = np.argsort(~counts, axis=1, kind="stable"), counts.sum(axis=1)
            for place in range(total.max()):
                rows = np.flatnonzero(total > place)
                pairs = rows, neighbors[rows, place]
                other, drawn = own[:, near.rows[pairs]], velocities[..., rows]
                to_m = turn((near.forward_m[pairs], near.left_m[pairs]), yaw_rad[rows]) + reach * other
                x_m, y_m = to_m[:, None] - reach * drawn
                apart_m = np.sqrt(x_m * x_m + y_m * y_m) + 1e-6
                energy = find_potential(self.nearness / self.unit_m * apart_m, signs[pairs])
                if is_own:
                    energy[apart_m > self.near.range_m] = LOST
                    is_flock = apart_m > self.safe_m
                    flock[:, rows] += is_flock
                    relative[..., rows] += (other[:, None] - drawn) * is_flock
                energies[:, rows] += energy
        speeds = np.minimum((relative**2).sum(axis=0), 1.0), (velocities**2).sum(axis=0)
        return energies + 0.5 * mass * flock * (speeds[0] + 1.0 - speeds[1])

    @staticmethod
    def _draw(velocities: np.ndarray, energies: np.ndarray, chances: np.ndarray) -> np.ndarray:
        """Return the mean of a chain of velocities (2, R) by Metropolis and Hastings, without those that are burned.

        velocities (2, S, R), energies (S, R); chances: numbers from 0 to 1 (S - 1, R).
        """
        robots, chosen = np.arange(energies.shape[1]), np.zeros(energies.shape, dtype=int)
        for sample in range(1, SAMPLES + 1):
            before = chosen[sample - 1]
            gain = energies[before, robots] - energies[sample]
            chosen[sample] = np.where(chances[sample - 1] < np.exp(np.minimum(gain, 0.0)), sample, before)
        mean: np.ndarray = velocities[:, chosen[BURNED + 1 :], robots].mean(axis=1)
        return mean


class Molecules(RandomFields):
    """Robots form the pattern of a molecule: each center binds some of the others, such as two in water.

    After P. Rezeck and L. Chaimowicz, Chemistry-inspired pattern formation with robotic swarms, RA-L 2022. Every
    (bonds + 1)-th robot is a center, which binds hydrogens only; a hydrogen binds one robot, a center rather than
    another hydrogen. Bound robots attract each other by the product of their charges. The memory holds each robot's
    velocity, the rows of those that it binds, -1 for none, and its kind; neighbors tell each other theirs.

    Attributes:
        bonds: of a center.
        charge, center_charge: of hydrogens and of centers.
        mass, center_mass: of the same, in the kinetic energy.
    """

    near = Neighbors(range_m=0.36)
    nearness = 0.7
    safe_m = 0.36
    bonds = 2
    charge, center_charge = 5.0, 15.0
    mass, center_mass = 1.0, 16.0
    settings = {"bonds": whole_number(2, 1, 6), "max_linear_m_s": RandomFields.settings["max_linear_m_s"]}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        near, robots = sensed.near, len(sensed.numbers)
        kind = (sensed.numbers % (int(self.bonds) + 1) == 0).astype(int)
        bound = np.full((robots, int(self.bonds)), -1) if memory is None else memory[:, 2:-1].astype(int)
        bound = self.bind(near, kind, bound)
        is_bound, (rows, places) = np.zeros_like(near.seen), np.nonzero(bound >= 0)
        is_bound[rows, bound[rows, places] % sensed.count] = True
        charges = np.where(kind, self.center_charge, self.charge)
        product = charges[:, None] * charges[near.rows] / UNIT_CHARGE
        signs = np.where(is_bound & near.seen, product, UNBOUND * near.seen)
        mass = np.where(kind, self.center_mass, self.mass)
        wanted, *speeds = self.choose(sensed, memory, signs, mass, random)
        return speeds[0], speeds[1], np.column_stack((wanted, bound, kind))

    def bind(self, near: Neighborhood, kind: np.ndarray, bound: np.ndarray) -> np.ndarray:
        """Return which rows robots bind now (R, K), -1 for none, the nearest first; kind: 1 of centers (R,).

        bound: which they bound before. A robot is bound if it bound this one, or has room for it, unless one that is
        bound already binds the same one: molecules have no rings.
        """
        rows, room_of = np.arange(len(kind)), np.where(kind, int(self.bonds), 1)
        order = np.argsort(np.where(near.seen, near.range_m, np.inf), axis=1, kind="stable")[:, :CANDIDATES]
        others, seen = near.rows[rows[:, None], order], near.seen[rows[:, None], order]
        centers = ((bound >= 0) & (kind[bound] == 1)).sum(axis=1)
        # A hydrogen that binds a hydrogen has room for a center.
        has_room = np.where(kind[:, None] == 1, centers[others] < 1, ((bound >= 0).sum(axis=1) < room_of)[others])
        has_room |= (bound[others] == rows[:, None, None]).any(axis=2)
        has_room &= seen & ~((kind[:, None] == 1) & (kind[others] == 1))
        taken = np.full(others.shape, -2)
        for column in range(others.shape[1]):
            beyond = bound[others[:, column]]
            is_ring = (beyond[:, :, None] == taken[:, None]).any(axis=(1, 2))
            taken[:, column] = np.where(has_room[:, column] & ~is_ring, others[:, column], -2)
        rank = np.where(taken < 0, 2, 1 - kind[taken]) * taken.shape[1] + np.arange(taken.shape[1])
        chosen = np.take_along_axis(taken, np.argsort(rank, axis=1)[:, : bound.shape[1]], axis=1)
        kept = np.full(bound.shape, -1)
        kept[:, : chosen.shape[1]] = chosen
        return np.where((kept >= 0) & (np.arange(bound.shape[1]) < room_of[:, None]), kept, -1)
