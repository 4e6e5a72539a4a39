"""State machines and trees as a behavior: one machine for all worlds, or one for each. Pure."""

from typing import Any, Dict, List, Sequence, Type

import numpy as np

from hero_client.controllers import steer

from ..behavior import Behavior, Command, Floor, Light, Neighbors, Proximity, Random, Sensed
from ..machines.modules import DO, MAX_NEXT, WHEN, State, stack
from .clearance import keep_clear

EXPLORATION, STOP = map(list(DO).index, ("exploration", "stop"))
FIXED, COUNT, INVERTED = map(list(WHEN).index, ("fixed probability", "neighbor count", "inverted neighbor count"))
# Of the behaviors in DO: to the light, and to neighbors.
LIGHT, NEAR = np.array([[0.0, 0.0, 1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0, -1.0]])

BLACK, WHITE = 0.25, 0.75  # the floor is gray between

_COLORS = np.array([(0, 0, 1), (1, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1)], dtype=float)


class Machine(Behavior):
    """A machine whose states robots show by their lights.

    Its behaviors keep clear of what infrared sensors see; exploration turns there for up to turn_steps steps.
    """

    near = Neighbors(range_m=0.5)
    floor = Floor()
    lamp = Light()
    eyes = Proximity()
    rate_hz = 10.0
    linear_m_s = 0.12
    turn_rad_s = 2.5
    clear_m = 0.12  # from the center
    gain_1_s = 2.0
    _tables: Dict[str, np.ndarray]
    _is_tree = False

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        """The memory is the state of each robot, for how many steps it still turns, and to which side."""
        robots, ranges_m = len(sensed.numbers), sensed.eyes.ranges_m
        machine = np.arange(robots) // sensed.count if len(self._tables["do"]) > 1 else np.zeros(robots, int)
        draws = random.random(MAX_NEXT + 1)
        last, turns, side = memory or (np.zeros(robots, int), np.zeros(robots), np.ones(robots))
        state = self._move(sensed, machine, last, draws)
        do, turn_steps, gain = (self._tables[name][machine, state] for name in ("do", "turn_steps", "gain"))
        explores = do == EXPLORATION
        turns = np.where(explores & (state == last), turns, 0.0)
        is_blocked = explores & (turns == 0.0) & (ranges_m[:, [7, 0, 1]] < self.clear_m).any(axis=1)
        turns = np.where(is_blocked, np.floor(draws[:, -1] * (turn_steps + 1.0)), turns)
        left_m, right_m = (np.nan_to_num(ranges_m[:, rays]).min(axis=1) for rays in ([1, 2], [7, 6]))
        side = np.where(is_blocked, np.where(left_m < right_m, -1.0, 1.0), side)
        wanted = self.linear_m_s * self._find_direction(sensed, do, gain)
        wanted += ~explores * keep_clear(ranges_m, self.clear_m, self.gain_1_s)
        linear_m_s, angular_rad_s = steer(wanted[0], wanted[1], self.linear_m_s, max_angular_rad_s=self.turn_rad_s)
        drives = np.where((do == STOP) | (turns > 0.0), 0.0, 1.0)
        angular_rad_s = np.where(turns > 0.0, side * self.turn_rad_s, drives * angular_rad_s)
        return drives * linear_m_s, angular_rad_s, (state, np.maximum(turns - 1.0, 0.0), side)

    def colors(self, memory: Any) -> np.ndarray:
        shown: np.ndarray = _COLORS[memory[0] % len(_COLORS)]
        return shown

    def _move(self, sensed: Sensed, machine: np.ndarray, state: np.ndarray, draws: np.ndarray) -> np.ndarray:
        """Return the next states (R,), by the first transition that holds; in trees by one after the other."""
        rounds, columns = (MAX_NEXT, 1) if self._is_tree else (1, MAX_NEXT)
        moves = np.ones(len(state), bool)
        for number in range(rounds):
            holds = draws[:, number : number + columns] < self._weigh(sensed, machine, state)[:, :columns]
            moves = moves & holds.any(axis=1)
            state = np.where(moves, self._tables["to"][machine, state, holds.argmax(axis=1)], state)
            moves = moves & (state != 0)
        return state

    def _weigh(self, sensed: Sensed, machine: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return the probabilities of transitions in this step (R, MAX_NEXT)."""
        names = ("when", "probability", "neighbors", "steepness")
        when, probability, neighbors, steepness = (self._tables[name][machine, state] for name in names)
        gray = sensed.floor.gray[:, None]
        floor = np.hstack((gray < BLACK, (gray >= BLACK) & (gray <= WHITE), gray > WHITE, np.ones_like(gray, bool)))
        is_so = np.take_along_axis(floor, np.clip(when, 0, FIXED), axis=1)
        lacking = steepness * (neighbors - sensed.near.counts[:, None])
        enough = 1.0 / (1.0 + np.exp(np.clip(lacking, -50.0, 50.0)))
        shares = np.where(when == COUNT, enough, np.where(when == INVERTED, 1.0 - enough, probability * is_so))
        return np.where(when < 0, 0.0, shares)

    def _find_direction(self, sensed: Sensed, do: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Return what a behavior makes of light and neighbors, forward and left (2, R); ahead without either."""
        lamp, near = sensed.lamp, sensed.near
        bearing_rad = np.nan_to_num(lamp.bearing_rad)
        light = LIGHT[do] * (lamp.intensity > 0.0) * np.array((np.cos(bearing_rad), np.sin(bearing_rad)))
        share = 1.0 / np.maximum(near.range_m * (1.0 + near.range_m), 1e-6)
        others = NEAR[do] * gain * np.array([(share * part).sum(axis=1) for part in (near.forward_m, near.left_m)])
        wanted = light + others
        return np.where((wanted == 0.0).all(axis=0), np.array([[1.0], [0.0]]), wanted)


def make_machine(machines: Sequence[List[State]], is_tree: bool, **attributes: Any) -> Type[Machine]:
    """Return the behavior of one machine, or of one for each world; attributes: others of the class."""
    return type("Machine", (Machine,), {"_tables": stack(machines), "_is_tree": is_tree, **attributes})
