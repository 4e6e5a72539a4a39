"""A mission with a carry state: robots take items from sources, and bring them to a nest below a lamp."""

import numpy as np

from hero_swarm.behavior import Behavior, Floor, Light, Proximity

BLACK, WHITE = 0.25, 0.75
"""The floor is darker than this in a source, and brighter in the nest."""


class Forage(Behavior):
    """Wanders; with an item, it drives to the lamp behind the nest."""

    floor = Floor()
    lamp = Light(reach_m=1.0)
    eyes = Proximity()
    rate_hz = 10
    linear_m_s = 0.12
    uses_light = 1

    def step(self, sensed, memory, random):
        robots = len(sensed.numbers)
        carries, items = (np.zeros(robots, bool), np.zeros(robots)) if memory is None else memory
        is_home = carries & (sensed.floor.gray > WHITE)
        items = items + is_home
        carries = (carries & ~is_home) | (sensed.floor.gray < BLACK)
        wander_rad_s = 1.2 * random.normal()
        to_lamp_rad_s = np.clip(2.5 * np.nan_to_num(sensed.lamp.bearing_rad), -2.5, 2.5)
        away_rad_s = -0.6 * np.sign(to_lamp_rad_s) * (sensed.floor.gray > WHITE)
        guided_rad_s = np.where(carries, to_lamp_rad_s, away_rad_s + wander_rad_s)
        turn_rad_s = np.where(self.uses_light > 0, guided_rad_s, wander_rad_s)
        ranges_m = sensed.eyes.ranges_m
        is_blocked = (ranges_m[:, [7, 0, 1]] < 0.11).any(axis=1)
        side = np.where(ranges_m[:, 1] < ranges_m[:, 7], -1.0, 1.0)
        turn_rad_s = np.where(is_blocked, 2.5 * side, turn_rad_s)
        return np.where(is_blocked, 0.02, self.linear_m_s), turn_rad_s, (carries, items)

    def colors(self, memory):
        carries, _ = memory
        return np.column_stack((np.zeros(len(carries)), carries, ~carries)).astype(float)


def items(state):
    """Return the items that were brought home in each world."""
    return state.by_world(state.memory[1]).sum(axis=1) if state.memory else np.zeros(len(state.poses))
