"""Candidates as controllers: machines, trees, networks, and numbers of a behavior. Pure."""

from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

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


class Kind(NamedTuple):
    """Meaning of candidates (W, G): make() returns their behavior, world by world, and of equal ones if not is_stacked;
    dump() the file of one (G,), from the arena's path and a first line."""

    genes: Genes
    make: Callable[[np.ndarray], Behavior]
    dump: Callable[[np.ndarray, str, str], bytes]
    ending: str = ENDING
    is_stacked: bool = True


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


def plan_machines(mission: Mission, is_tree: bool = False) -> Kind:
    """Return machines (Chocolate) or trees (Maple) of those modules that the arena has something for."""
    arena = set_up(mission.experiment, mission.experiment.cells[0]).arena
    behaviors = [name for name in DO if len(arena.lamps_m) or "photo" not in name]
    conditions = [name for name in WHEN if arena.areas or "floor" not in name]

    def decode(numbers: _Numbers) -> List[Dict[str, Any]]:
        count, states = numbers.take(1, MAX_STATES, WHOLE), []
        for number in range(MAX_STATES):
            state = numbers.take_module("do", DO, behaviors)
            if is_tree:
                states.append({**state, "until": numbers.take_module("when", WHEN, conditions)})
                continue
            kept, follows = numbers.take(1, MAX_NEXT, WHOLE), []
            for _ in range(MAX_NEXT):
                to = (number + 1 + numbers.take(0, MAX_STATES - 2, CHOICE) % max(count - 1, 1)) % count
                follows.append({"to": "S%d" % to, **numbers.take_module("when", WHEN, conditions)})
            states.append({"name": "S%d" % number, **state, **({"next": follows[:kept]} if count > 1 else {})})
        return states[:count]

    def make(genomes: np.ndarray) -> Behavior:
        decoded = [decode(_Numbers(genome)) for genome in genomes]
        return make_machine(list(map(follow, decoded)) if is_tree else decoded, is_tree)()

    def dump(genome: np.ndarray, arena: str, remark: str) -> bytes:
        content = {"arena": arena, "tree" if is_tree else "states": decode(_Numbers(genome))}
        return replace_values(remark, content).encode()

    numbers = _Numbers()
    decode(numbers)
    return Kind(Genes.of(numbers.genes), make, dump)


def plan_networks(mission: Mission) -> Kind:
    """Return networks of one layer, from what robots sense by themselves, with floor, light and nearest neighbors."""
    bounds_m = set_up(mission.experiment, mission.experiment.cells[0]).arena.bounds_m
    observation = Observation(tuple(bounds_m.tolist()), NEIGHBORS, RANGE_M, {"floor": Floor(), "lamp": Light()})
    inputs = count_observations(NEIGHBORS) + 6

    def split(genomes: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return weights (M, K, 2) and biases (M, 1, 2); a robot's speeds and place do not count."""
        weights = genomes[:, 2:].reshape(len(genomes), inputs, 2).copy()
        weights[:, 8:14] = 0.0
        return weights, genomes[:, None, :2]

    def make(genomes: np.ndarray) -> Behavior:
        return make_policy([split(genomes)], observation, RATE_HZ)()

    def dump(genome: np.ndarray, arena: str, remark: str) -> bytes:
        weights, biases = split(genome[None])
        return dump_policy([(weights[0], biases[0, 0])], observation, RATE_HZ)

    return Kind(Genes.of([(-MAX_WEIGHT, MAX_WEIGHT, REAL)] * (2 * inputs + 2)), make, dump, ".npz")


def plan_numbers(mission: Mission) -> Kind:
    """Return numbers of the mission's behavior: in its ranges, or the settings. Raises: ExperimentError."""
    experiment, (cell,) = mission.experiment, mission.experiment.cells
    kind = type(set_up(experiment, cell).behavior)
    known = {name: setting.limits for name, setting in kind.settings.items() if setting.limits}
    ranges, numbers = mission.content.get("ranges", known), kind().numbers()
    wrong = [name for name in ranges if name not in numbers]
    if wrong or len(ranges) < 2:
        text = "%s: cma needs ranges of two or more numbers of %s, such as ranges: {rate_hz: [5, 20]}; it has %s%s"
        names = ", ".join(numbers), f", not {wrong[0]}" if wrong else ""
        raise ExperimentError(text % (experiment.places["behavior"], cell.behavior, *names))
    genes = Genes.of([(*limits, WHOLE if isinstance(numbers[name], int) else REAL) for name, limits in ranges.items()])

    def decode(genome: np.ndarray) -> Dict[str, Any]:
        values = zip(ranges, genome.tolist(), genes.is_whole)
        return {**cell.parameters, **{name: int(value) if is_whole else value for name, value, is_whole in values}}

    def make(genomes: np.ndarray) -> Behavior:
        return kind(**decode(genomes[0]))

    def dump(genome: np.ndarray, arena: str, remark: str) -> bytes:
        name = cell.behavior if experiment.locate(cell.behavior) == cell.behavior else f"../{cell.behavior}"
        return replace_values(remark, {"arena": arena, "behavior": name, "numbers": decode(genome)}).encode()

    return Kind(genes, make, dump, is_stacked=False)
