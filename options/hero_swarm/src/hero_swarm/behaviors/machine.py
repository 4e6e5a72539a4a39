"""State machines and trees as a behavior: one machine for all worlds, or one for each. Pure."""

from typing import Any, List, Sequence, Type

import numpy as np

from hero_client.controllers import steer

from ..behavior import Behavior, Command, Floor, Light, Neighborhood, Neighbors, Proximity, Random, Sensed
from ..machines.modules import DO, FLOORS, MAX_COUNT, MAX_NEXT, State, Tables, stack
from .clearance import keep_clear

EXPLORATION, STOP = map(list(DO).index, ("exploration", "stop"))
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
    _tables: Tables
    _is_tree = False

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        """The memory is the state of each robot, for how many steps it still turns, and to which side."""
        robots, ranges_m, tables = len(sensed.numbers), sensed.eyes.ranges_m, self._tables
        first = np.arange(robots) // sensed.count * tables.states if len(tables.do) > tables.states else 0
        draws = random.random(MAX_NEXT + 1)
        last, turns, side = memory or (np.zeros(robots, int), np.zeros(robots), np.ones(robots))
        state = self._move(sensed, first, last, draws)
        row = first + state
        do = tables.do[row]
        explores = do == EXPLORATION
        turns = turns * (explores & (state == last))
        is_near = ranges_m < self.clear_m
        is_blocked = explores & (turns == 0.0) & (is_near[:, 7] | is_near[:, 0] | is_near[:, 1])
        turns = np.where(is_blocked, np.floor(draws[:, -1] * (tables.turn_steps[row] + 1.0)), turns)
        near_m = np.fmax(ranges_m, 0.0)  # a range that is not known is none
        is_left = np.minimum(near_m[:, 1], near_m[:, 2]) < np.minimum(near_m[:, 7], near_m[:, 6])
        side = np.where(is_blocked, np.where(is_left, -1.0, 1.0), side)
        wanted = self.linear_m_s * self._find_direction(sensed, do, tables.gain[row])
        wanted += ~explores * keep_clear(ranges_m, self.clear_m, self.gain_1_s)
        linear_m_s, angular_rad_s = steer(wanted[0], wanted[1], self.linear_m_s, max_angular_rad_s=self.turn_rad_s)
        turning, drives = turns > 0.0, (do != STOP) & (turns == 0.0)
        angular_rad_s = np.where(turning, side * self.turn_rad_s, drives * angular_rad_s)
        return drives * linear_m_s, angular_rad_s, (state, np.maximum(turns - 1.0, 0.0), side)

    def colors(self, memory: Any) -> np.ndarray:
        shown: np.ndarray = _COLORS[memory[0] % len(_COLORS)]
        return shown

    def _move(self, sensed: Sensed, first: Any, state: np.ndarray, draws: np.ndarray) -> np.ndarray:
        """Return the next states (R,), by the first transition that holds; in trees by one after the other.

        first: row of each robot's first state in the tables (R,), or of all.
        """
        rounds, columns = (MAX_NEXT, 1) if self._is_tree else (1, MAX_NEXT)
        gray, tables, moves = sensed.floor.gray, self._tables, np.ones(len(state), dtype=bool)
        floor = np.where(np.isnan(gray), FLOORS.index("unknown"), (gray >= BLACK) + 1 * (gray > WHITE))
        count, robots = len(FLOORS) + np.minimum(sensed.near.counts, MAX_COUNT), np.arange(len(state))
        for number in range(rounds):
            row = first + state
            chances = tables.chances[row, floor, :columns] + tables.chances[row, count, :columns]
            holds = draws[:, number : number + columns] < chances
            follows = holds.argmax(axis=1)
            moves &= holds[robots, follows]  # much faster than holds.any(axis=1)
            state = np.where(moves, tables.to[row, follows], state)
            moves &= state != 0
        return state

    def _find_direction(self, sensed: Sensed, do: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Return what a behavior makes of light and neighbors, forward and left (2, R); ahead without either."""
        lamp, wanted = sensed.lamp, np.zeros((2, len(do)))
        (rows,) = ((LIGHT[do] != 0.0) & (lamp.intensity > 0.0)).nonzero()
        bearing_rad = lamp.bearing_rad[rows]
        wanted[:, rows] = LIGHT[do[rows]] * np.array((np.cos(bearing_rad), np.sin(bearing_rad)))
        (rows,) = NEAR[do].nonzero()
        near = Neighborhood(*(values[rows] for values in sensed.near))
        share = 1.0 / np.maximum(near.range_m * (1.0 + near.range_m), 1e-6)
        pull = np.array([(share * part).sum(axis=1) for part in (near.forward_m, near.left_m)])
        wanted[:, rows] = NEAR[do[rows]] * gain[rows] * pull
        return np.where((wanted == 0.0).all(axis=0), np.array([[1.0], [0.0]]), wanted)


def make_machine(machines: Sequence[List[State]], is_tree: bool, **attributes: Any) -> Type[Machine]:
    """Return the behavior of one machine, or of one for each world; attributes: others of the class."""
    return type("Machine", (Machine,), {"_tables": stack(machines), "_is_tree": is_tree, **attributes})
