"""The behaviors that come with the suite, by the names that programs and launch files take."""

import importlib
import inspect
import os
from typing import Any, Dict, List, Optional, Type

from hero_node import suggest
from hero_node.files import EntryError, YamlError, parse_yaml
from hero_node.parameters import is_number

from ..behavior import MAX_RATE_HZ, MIN_RATE_HZ, Behavior
from ..learning.policy import load_policy
from ..machines.machine_file import ENDING, read_controller
from ..sources import Sources, load_file, read_content
from .machine import make_machine

POLICY_ENDING = ".npz"

MAX_NUMBER = 1e6
"""Limit of the other parameters, whatever their unit."""

_MODULES: Dict[str, str] = {
    "aggregation": "aggregation.Aggregation",
    "evolved_aggregation": "binary_family.EvolvedAggregation",
    "cyclic_pursuit": "circling.CyclicPursuit",
    "dispersal": "binary_family.Dispersal",
    "milling": "circling.Milling",
    "wall_following": "wall_following.WallFollowing",
    "wheel_genome": "binary_family.WheelGenome",
    "flocking": "flocking.Flocking",
    "dispersion": "spacing.Dispersion",
    "segregation": "spacing.Segregation",
    "potential_segregation": "spacing.PotentialSegregation",
    "random_fields": "random_fields.RandomFields",
    "molecules": "random_fields.Molecules",
    "rendezvous": "consensus.Rendezvous",
    "leader_followers": "consensus.LeaderFollowers",
    "formation": "consensus.Formation",
    "coverage": "coverage.VoronoiCoverage",
    "object_clustering": "pushing.ObjectClustering",
    "box_pushing": "pushing.BoxPushing",
    "cooperative_transport": "pushing.CooperativeTransport",
    "voter": "voting.Voter",
    "majority": "voting.Majority",
}


def list_names() -> List[str]:
    """Return the names of all behaviors."""
    return sorted(_MODULES)


def find_behavior(name: str, sources: Optional[Sources] = None) -> Type[Behavior]:
    """Return a behavior by its name, FILE.py, FILE.py:Class, POLICY.npz or MACHINE.controller.

    sources: None: read anew. Raises: ValueError that says what there is.
    """
    sources = sources or Sources()
    if name in _MODULES:
        module, class_name = _MODULES[name].split(".")
        found: Type[Behavior] = getattr(importlib.import_module(__name__ + "." + module), class_name)
        return found
    path, _, class_name = name.partition(":")
    if name.endswith(POLICY_ENDING):
        return load_policy(name, read_content("policy", name, sources))
    if name.endswith(ENDING):
        return _load_controller(name, sources)
    if not path.endswith(".py"):
        text = "behavior %r: must be FILE.py, FILE.py:Class, POLICY.npz, MACHINE.controller, or one of %s%s"
        raise ValueError(text % (name, ", ".join(list_names()), suggest(name, list_names())))
    classes = list_classes(path, sources)
    if class_name in classes:
        return classes[class_name]
    if class_name or len(classes) != 1:
        text = f"behavior {name}: name one class as {path}:CLASS; it has {', '.join(sorted(classes)) or 'none'}"
        raise ValueError(text)
    return next(iter(classes.values()))


def _load_controller(path: str, sources: Sources) -> Type[Behavior]:
    """Return the behavior of a controller's file. Raises: ValueError."""
    try:
        made = read_controller(path, read_content("controller", path, sources))
        if made.states:
            return make_machine([made.states], made.is_tree, arena=made.arena)
        is_file = made.behavior.partition(":")[0].endswith((".py", POLICY_ENDING))
        kind = find_behavior(os.path.join(os.path.dirname(path), made.behavior) if is_file else made.behavior, sources)
        changed, names = kind(**made.numbers), {name.partition(".")[0] for name in made.numbers}
        return type(kind.__name__, (kind,), {"arena": made.arena, **{name: getattr(changed, name) for name in names}})
    except (EntryError, TypeError) as error:
        raise ValueError(f"{path}: {error}" if isinstance(error, TypeError) else str(error)) from None


def list_classes(path: str, sources: Sources) -> Dict[str, Type[Behavior]]:
    """Return the behaviors in a file by the names of their classes. Raises: ValueError."""
    loaded = load_file("behavior", path, sources)
    return {
        key: value for key, value in vars(loaded).items()
        if inspect.isclass(value) and issubclass(value, Behavior) and value.__module__ == loaded.__name__
    }  # fmt: skip


def make_behavior(name: str, numbers: Any) -> Behavior:
    """Return a behavior by its name, as of find_behavior(); numbers: those that differ, by name, or as YAML.

    Raises: ValueError that says what there is.
    """
    kind = find_behavior(name)
    defaults = kind().numbers()
    if isinstance(numbers, str):
        try:
            numbers = parse_yaml(numbers)
        except YamlError as error:
            raise ValueError(f"parameters: not YAML: {error}") from None
    if not isinstance(numbers, dict):
        raise ValueError("parameters is %r, but must be numbers such as {rate_hz: %g}" % (numbers, kind.rate_hz))
    for key, value in numbers.items():
        if key not in defaults:
            text = f"parameters: {name} has no number {key!r}; it has {', '.join(defaults)}{suggest(key, defaults)}"
            raise ValueError(text)
        low, high = (MIN_RATE_HZ, MAX_RATE_HZ) if key == "rate_hz" else (-MAX_NUMBER, MAX_NUMBER)
        if not is_number(value, low, high):
            raise ValueError(f"parameters: {key} is {value!r}, but must be a number from {low:g} to {high:g}")
    return kind(**numbers)
