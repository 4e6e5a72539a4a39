"""Candidates as controllers: machines, trees, networks, and numbers of a behavior. Pure."""

from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from hero_node.files import replace_values

from ..behavior import Behavior, Floor, Light
from ..behaviors.machine import make_machine
from ..experiments.computing.cell_setup import set_up
from ..experiments.errors import ExperimentError
from ..learning.observation import Observation, count_observations
from ..learning.policy import dump_policy, make_policy
from ..machines.machine_file import ENDING
from ..machines.modules import DO, LIMITS, MAX_NEXT, WHEN, WHOLE_LIMITS, Kinds, follow
from .mission import Mission
from .search import CHOICE, REAL, WHOLE, Genes

MAX_STATES, MAX_WEIGHT = 4, 5.0
"""States of machines, and children of trees; weights of networks."""

NEIGHBORS, RANGE_M, RATE_HZ = 5, 0.5, 10.0
"""Observed neighbors, their range, and the rate of networks."""


class Kind:
    """Meaning of the candidates of one mission, which workers take as it is.

    Attributes:
        genes: of a candidate; ending: of its file.
        is_stacked: whether worlds beside each other may have different candidates.
    """

    genes: Genes
    ending = ENDING
    is_stacked = True

    def make(self, genomes: np.ndarray, behavior: Behavior) -> Behavior:
        """Return the behavior of candidates (W, G), world by world, or of equal ones; behavior: the mission's."""
        raise NotImplementedError

    def dump(self, genome: np.ndarray, arena: str, remark: str) -> bytes:
        """Return the file of a candidate (G,), with the arena's path and a first line."""
        raise NotImplementedError


class _Numbers:
    """The numbers of a candidate in order; without, a list of the genes that are read."""

    def __init__(self, genome: Optional[np.ndarray] = None) -> None:
        self.genes: List[Tuple[float, float, str]] = []
        self._left = None if genome is None else iter(genome.tolist())

    def take(self, low: float, high: float, kind: str) -> Any:
        self.genes.append((low, high, kind))
        number = low if self._left is None else next(self._left)
        return round(number, 3) if kind == REAL else int(number)

    def take_module(self, kind: str, kinds: Kinds, allowed: Sequence[str]) -> Dict[str, Any]:
        """Return one of the allowed modules with its numbers; those of the others are read, too."""
        module = allowed[self.take(0, len(allowed) - 1, CHOICE)]
        names = dict.fromkeys(name for one in allowed for name in kinds[one])
        every = {name: self.take(*LIMITS[name], WHOLE if name in WHOLE_LIMITS else REAL) for name in names}
        return {kind: module, **{name: every[name] for name in kinds[module]}}


class Machines(Kind):
    """Machines (Chocolate) or trees (Maple) of those modules that the arena has something for."""

    def __init__(self, mission: Mission, is_tree: bool = False) -> None:
        """Choose the modules. Raises: ExperimentError."""
        arena, self._is_tree = set_up(mission.experiment, mission.experiment.cells[0]).arena, is_tree
        self._behaviors = [name for name in DO if len(arena.lamps_m) or "photo" not in name]
        self._conditions = [name for name in WHEN if arena.areas or "floor" not in name]
        numbers = _Numbers()
        self._decode(numbers)
        self.genes = Genes.of(numbers.genes)

    def _decode(self, numbers: _Numbers) -> List[Dict[str, Any]]:
        count, states = numbers.take(1, MAX_STATES, WHOLE), []
        for number in range(MAX_STATES):
            state = numbers.take_module("do", DO, self._behaviors)
            if self._is_tree:
                states.append({**state, "until": numbers.take_module("when", WHEN, self._conditions)})
                continue
            kept, follows = numbers.take(1, MAX_NEXT, WHOLE), []
            for _ in range(MAX_NEXT):
                to = (number + 1 + numbers.take(0, MAX_STATES - 2, CHOICE) % max(count - 1, 1)) % count
                follows.append({"to": "S%d" % to, **numbers.take_module("when", WHEN, self._conditions)})
            states.append({"name": "S%d" % number, **state, **({"next": follows[:kept]} if count > 1 else {})})
        return states[:count]

    def make(self, genomes: np.ndarray, behavior: Behavior) -> Behavior:
        decoded = [self._decode(_Numbers(genome)) for genome in genomes]
        return make_machine(list(map(follow, decoded)) if self._is_tree else decoded, self._is_tree)()

    def dump(self, genome: np.ndarray, arena: str, remark: str) -> bytes:
        content = {"arena": arena, "tree" if self._is_tree else "states": self._decode(_Numbers(genome))}
        return replace_values(remark, content).encode()


class Networks(Kind):
    """Networks of one layer, from what robots sense by themselves, with floor, light and nearest neighbors."""

    ending = ".npz"

    def __init__(self, mission: Mission) -> None:
        """Observe the mission's arena. Raises: ExperimentError."""
        bounds_m = set_up(mission.experiment, mission.experiment.cells[0]).arena.bounds_m
        sensors = {"floor": Floor(), "lamp": Light()}
        self._observation = Observation(tuple(bounds_m.tolist()), NEIGHBORS, RANGE_M, sensors)
        self._inputs = count_observations(NEIGHBORS) + 6
        self.genes = Genes.of([(-MAX_WEIGHT, MAX_WEIGHT, REAL)] * (2 * self._inputs + 2))

    def _split(self, genomes: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return weights (M, K, 2) and biases (M, 1, 2); a robot's speeds and place do not count."""
        weights = genomes[:, 2:].reshape(len(genomes), self._inputs, 2).copy()
        weights[:, 8:14] = 0.0
        return weights, genomes[:, None, :2]

    def make(self, genomes: np.ndarray, behavior: Behavior) -> Behavior:
        return make_policy([self._split(genomes)], self._observation, RATE_HZ)()

    def dump(self, genome: np.ndarray, arena: str, remark: str) -> bytes:
        weights, biases = self._split(genome[None])
        return dump_policy([(weights[0], biases[0, 0])], self._observation, RATE_HZ, arena)


class Numbers(Kind):
    """Numbers of the mission's behavior: those in its ranges, or its settings."""

    is_stacked = False

    def __init__(self, mission: Mission) -> None:
        """Find the numbers. Raises: ExperimentError."""
        experiment, (cell,) = mission.experiment, mission.experiment.cells
        if "behavior" not in mission.content:
            text = "%s: cma needs the behavior whose numbers it designs, such as behavior: dispersion"
            raise ExperimentError(text % experiment.places["behavior"])
        kind = type(set_up(experiment, cell).behavior)
        known = {name: setting.limits for name, setting in kind.settings.items() if setting.limits}
        ranges, numbers = mission.content.get("ranges", known), kind().numbers()
        wrong = [name for name in ranges if name not in numbers]
        if wrong or len(ranges) < 2:
            text = "%s: cma needs ranges of two or more numbers of %s, such as ranges: {rate_hz: [5, 20]}; it has %s%s"
            names = ", ".join(numbers), f", not {wrong[0]}" if wrong else ""
            raise ExperimentError(text % (experiment.places["behavior"], cell.behavior, *names))
        of_kinds = [(*limits, WHOLE if isinstance(numbers[name], int) else REAL) for name, limits in ranges.items()]
        self._names, self._given, self.genes = list(ranges), cell.parameters, Genes.of(of_kinds)
        is_built_in = experiment.locate(cell.behavior) == cell.behavior
        self._behavior = cell.behavior if is_built_in else f"../{cell.behavior}"

    def _decode(self, genome: np.ndarray) -> Dict[str, Any]:
        values = zip(self._names, genome.tolist(), self.genes.is_whole)
        return {**self._given, **{name: int(value) if is_whole else value for name, value, is_whole in values}}

    def make(self, genomes: np.ndarray, behavior: Behavior) -> Behavior:
        return type(behavior)(**self._decode(genomes[0]))

    def dump(self, genome: np.ndarray, arena: str, remark: str) -> bytes:
        content = {"arena": arena, "behavior": self._behavior, "numbers": self._decode(genome)}
        return replace_values(remark, content).encode()
