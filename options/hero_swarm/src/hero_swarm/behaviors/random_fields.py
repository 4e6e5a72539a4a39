"""Segregation by velocities that are sampled from a Gibbs random field."""

from typing import Any

import numpy as np

from hero_client.controllers import steer

from ..behavior import Command, Neighborhood, Neighbors, Proximity, Random, Sensed
from .clearance import keep_clear
from .spacing import Segregation

SAMPLES, BURNED = 100, 60
"""Velocities that are drawn in a step, and how many of them do not count for the mean."""

LOST = 1e4
"""Energy of losing sight of a robot of the own group."""


def find_potential(apart: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """Return the Coulomb and Buckingham potential at distances in units; sign: 1 attracts, -1 repels.

    Its constants are those of the paper's program: well depth 0.04, radius 0.8, steepness 1, charges 16 and 1.
    """
    share = 0.8 / apart
    energy: np.ndarray = 0.04 * (0.2 * share**6 - 1.2 * np.e * (1.0 - 1.0 / share)) - sign * 100.0 / (np.pi * apart)
    return energy


class RandomFields(Segregation):
    """Robots move with those of their own group, and away from the others, by velocities drawn from a random field.

    After P. Rezeck et al., Flocking-segregative swarm behaviors using Gibbs random fields, ICRA 2021. A velocity is the
    likelier, the lower the potential of the neighbors where it leads and the kinetic energy relative to the own group.
    The memory holds of each robot its velocity in the common frame, as a share of max_linear_m_s, and its group;
    neighbors tell each other theirs.

    Attributes:
        unit_m: of the potential's lengths.
        safe_m: within it robots of other groups repel.
        spread: of drawn velocities, as a share of max_linear_m_s.
    """

    near = Neighbors(range_m=0.67)
    infrared = Proximity()
    rate_hz = 10.0
    unit_m = 0.45
    safe_m = 0.135
    clear_m = 0.1
    spread = 0.2
    max_linear_m_s = 0.08
    settings = {name: Segregation.settings[name] for name in ("groups", "max_linear_m_s")}

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        group = sensed.numbers % int(self.groups)
        own = np.zeros((len(group), 2)) if memory is None else memory[:, :2]
        drawn = random.normal(2 * SAMPLES).reshape(-1, SAMPLES, 2).transpose(1, 0, 2)
        velocities = np.concatenate((own[None], own + self.spread * drawn))
        velocities /= np.maximum(np.hypot(*velocities.T).T, 1.0)[..., None]
        energies = self.find_energies(sensed.near, sensed.poses[:, 2], own, group, velocities)
        wanted = self._draw(velocities, energies, random.random(SAMPLES))
        cosine, sine = np.cos(sensed.poses[:, 2]), np.sin(sensed.poses[:, 2])
        ahead = np.array((cosine * wanted[:, 0] + sine * wanted[:, 1], cosine * wanted[:, 1] - sine * wanted[:, 0]))
        command = self.max_linear_m_s * ahead + keep_clear(sensed.infrared.ranges_m, self.clear_m, 2.0)
        speeds = steer(command[0], command[1], self.max_linear_m_s, max_angular_rad_s=self.max_angular_rad_s)
        return (*speeds, np.column_stack((wanted, group)))

    def find_energies(
        self, near: Neighborhood, yaw_rad: np.ndarray, own: np.ndarray, group: np.ndarray, velocities: np.ndarray
    ) -> np.ndarray:
        """Return the energies (S, R) of velocities (S, R, 2); own: velocities of now (R, 2)."""
        is_own = near.seen & (group[near.rows] == group[:, None])
        counts = is_own | (near.seen & (near.range_m < self.safe_m))
        nearest = np.argsort(~counts, axis=1, kind="stable")[:, : max(1, int(counts.sum(axis=1).max()))]
        rows = np.arange(len(group))[:, None]
        counts, is_own, others = counts[rows, nearest], is_own[rows, nearest], own[near.rows[rows, nearest]]
        length_m, angle_rad = near.range_m[rows, nearest], near.bearing_rad[rows, nearest] + yaw_rad[:, None]
        reach = self.max_linear_m_s / self.rate_hz  # m in a step at full speed
        to_m = np.stack((length_m * np.cos(angle_rad), length_m * np.sin(angle_rad)), axis=2) + reach * others
        apart_m = np.hypot(*np.moveaxis(to_m - reach * velocities[:, :, None], -1, 0)) + 1e-6
        pairs = find_potential(0.8 * apart_m / self.unit_m, np.where(is_own, 1.0, -1.0))
        pairs = np.where(is_own & (apart_m > self.near.range_m), LOST, pairs) * counts
        flock = is_own[None] & (apart_m > self.safe_m)
        relative = ((others - velocities[:, :, None]) * flock[..., None]).sum(axis=2)
        speeds = np.minimum((relative**2).sum(axis=2), 1.0), (velocities**2).sum(axis=2)
        energies: np.ndarray = pairs.sum(axis=2) + 0.15 * (1.0 + flock.sum(axis=2)) * (speeds[0] + 1.0 - speeds[1])
        return energies

    @staticmethod
    def _draw(velocities: np.ndarray, energies: np.ndarray, chances: np.ndarray) -> np.ndarray:
        """Return the mean of a chain of velocities (R, 2) by Metropolis and Hastings, without those that are burned."""
        robots, total = np.arange(len(chances)), np.zeros(velocities.shape[1:])
        chosen = np.zeros(len(chances), dtype=int)
        for sample in range(1, SAMPLES + 1):
            gain = energies[chosen, robots] - energies[sample]
            chosen = np.where(chances[:, sample - 1] < np.exp(np.minimum(gain, 0.0)), sample, chosen)
            if sample > BURNED:
                total += velocities[chosen, robots]
        mean: np.ndarray = total / (SAMPLES - BURNED)
        return mean
