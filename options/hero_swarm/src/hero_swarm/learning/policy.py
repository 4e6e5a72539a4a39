"""Learned policies as files, and such a file as a behavior. Pure: numpy only.

A file (.npz) has the layers of a network that all robots share, and what it observes; it holds numbers and texts alone.
"""

import io
import json
import zipfile
from typing import Any, Dict, Sequence, Tuple, Type

import numpy as np

from hero_client.values import MAX_LINEAR_M_S
from hero_node import one_line
from hero_node.files import write_file
from hero_sim.world import locate_arena

from .. import behavior as known
from ..behavior import Behavior, Command, Random, Sensed
from .observation import MAX_LEARNED_ANGULAR_RAD_S, Observation

VERSION = 1

Layers = Sequence[Tuple[np.ndarray, np.ndarray]]
"""Weights (K, L) and biases (L,) of each layer; tanh between layers, and two shares of speed at the end."""


def run_network(layers: Layers, observed: np.ndarray) -> np.ndarray:
    """Return shares of the largest linear and angular speed, -1 to 1, for observations (R, K)."""
    values = observed.astype(float)
    for number, (weights, biases) in enumerate(layers):
        values = (np.tanh(values) if number else values) @ weights + biases
    return np.clip(values, -1.0, 1.0)


def save_policy(path: str, layers: Layers, observation: Observation, rate_hz: float = 10.0) -> None:
    """Write a policy, as dump_policy() does. Raises: ValueError. OSError."""
    write_file(path, dump_policy(layers, observation, rate_hz))


def dump_policy(layers: Layers, observation: Observation, rate_hz: float, arena: str = "") -> bytes:
    """Return the file of a policy; observation, rate_hz: of the environment in which it was learned.

    arena: of its virtual sensors, where the program is given none: shipped, or a path from the file.

    Raises: ValueError for layers that do not fit each other, or a sensor of your own.
    """
    for name, sensor in observation.sensors.items():
        if getattr(known, type(sensor).__name__, None) is not type(sensor):
            raise ValueError(f"sensor {name}: only built-in sensors can be saved, not {type(sensor).__name__}")
    _check_layers(layers, layers[0][0].shape[0])
    sensors = {name: [type(sensor).__name__, sensor._asdict()] for name, sensor in observation.sensors.items()}
    about = {"version": VERSION, "rate_hz": rate_hz, "arena": arena, **observation._asdict(), "sensors": sensors}
    arrays = {f"{kind}_{number}": array for number, layer in enumerate(layers) for kind, array in zip("wb", layer)}
    content = io.BytesIO()
    np.savez(content, about=np.array(json.dumps(about)), **arrays)
    return content.getvalue()


def load_policy(path: str, content: bytes) -> Type[Behavior]:
    """Return the behavior of a file's content. Raises: ValueError with path for what is no policy of this version."""
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as file:
            about: Dict[str, Any] = json.loads(str(file["about"]))
            count = sum(name.startswith("w_") for name in file.files)
            layers = [(file[f"w_{number}"], file[f"b_{number}"]) for number in range(count)]
        if about.get("version") != VERSION:
            text = "it has version %s, this suite reads %d: save it again"
            raise ValueError(text % (about.get("version", "none"), VERSION))
        given = {name: getattr(known, kind)(**fields) for name, (kind, fields) in about["sensors"].items()}
        observation = Observation(tuple(about["bounds_m"]), about["neighbors"], about["range_m"], given)
        _check_layers(layers, len(layers[0][0]))
        arena = locate_arena(path, about.get("arena", ""))
        return type("Policy", (make_policy(layers, observation, about["rate_hz"], path),), {"arena": arena})
    except (OSError, ValueError, LookupError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise ValueError(f"policy {path} cannot be read: {one_line(error)}; save_policy() writes such files") from error


def make_policy(layers: Layers, observation: Observation, rate_hz: float, path: str = "") -> Type[Behavior]:
    """Return a policy as a behavior; layers may also be those of a network for each world: (W, K, L) and (W, 1, L)."""
    attributes = {**observation.list_sensors(), "rate_hz": rate_hz, "_file": (path, observation, layers)}
    return type("Policy", (_Policy,), attributes)


def _check_layers(layers: Layers, inputs: int) -> None:
    """Raise ValueError unless layers lead from inputs to two outputs by finite numbers."""
    for number, (weights, biases) in enumerate(layers):
        if weights.shape != (inputs, biases.size) or not all(np.isfinite(array).all() for array in (weights, biases)):
            raise ValueError(f"layer {number} has weights {weights.shape}, biases {biases.shape} or numbers not finite")
        inputs = biases.size
    if inputs != 2:
        raise ValueError(f"the last layer gives {inputs} numbers, but must give 2")


class _Policy(Behavior):
    """A network that all robots share."""

    _file: Tuple[str, Observation, Layers]

    def step(self, sensed: Sensed, memory: Any, random: Random) -> Command:
        path, observation, layers = self._file
        observed = observation.read(sensed)
        *worlds, inputs, _ = layers[0][0].shape
        if observed.shape[1] != inputs:
            text = "policy %s takes %d numbers, but its sensors give %d: save it again"
            raise ValueError(text % (path, inputs, observed.shape[1]))
        shares = run_network(layers, observed.reshape(*worlds, -1, inputs)).reshape(-1, 2)
        return MAX_LINEAR_M_S * shares[:, 0], MAX_LEARNED_ANGULAR_RAD_S * shares[:, 1], memory
