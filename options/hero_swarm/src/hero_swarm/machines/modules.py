"""Behaviors and conditions of which machines are made, and many machines as arrays. Pure.

Source: AutoMoDe-Chocolate (G. Francesca et al., Swarm Intelligence 2015), of whose modules Maple (J. Kuckling et al.,
ANTS 2018) makes trees.
"""

from typing import Any, Dict, List, NamedTuple, Sequence, Tuple

import numpy as np

Kinds = Dict[str, Tuple[str, ...]]
"""Modules, and the names of their numbers."""

_PLAIN: Kinds = dict.fromkeys(("stop", "phototaxis", "anti-phototaxis"), ())
DO: Kinds = {"exploration": ("turn_steps",), **_PLAIN, **dict.fromkeys(("attraction", "repulsion"), ("gain",))}

FLOORS = "black floor", "gray floor", "white floor", "unknown"
MAX_COUNT = 100  # of neighbors; more are as many
_SHARES = (*FLOORS[:3], "fixed probability")
_COUNTS = "neighbor count", "inverted neighbor count"
WHEN: Kinds = {**dict.fromkeys(_SHARES, ("probability",)), **dict.fromkeys(_COUNTS, ("neighbors", "steepness"))}

WHOLE_LIMITS = {"turn_steps": (1, 100), "neighbors": (0, 10)}
LIMITS = {"gain": (1.0, 5.0), "probability": (0.0, 1.0), "steepness": (0.0, 20.0), **WHOLE_LIMITS}

MAX_NEXT = 4  # transitions of a state, and children of a tree

State = Dict[str, Any]  # {name, do, numbers, next: [{to, when, numbers}]}


class Tables(NamedTuple):
    """M machines of S states each, missing ones among them, as arrays (M * S, ...), machine after machine.

    Attributes:
        states: of each machine, S.
        do: which of DO a state is; turn_steps, gain: its numbers, 0 where it has none.
        to: number of the state that each transition leads to (M * S, MAX_NEXT).
        chances: probability of each transition in a step, where there is one (M * S, ..., MAX_NEXT): on floors of each
            kind, see FLOORS, and after these for each number of neighbors. A transition has those of one kind alone.
    """

    states: int
    do: np.ndarray
    turn_steps: np.ndarray
    gain: np.ndarray
    to: np.ndarray
    chances: np.ndarray


def stack(machines: Sequence[List[State]]) -> Tables:
    """Return machines as arrays."""
    count = max(map(len, machines))
    rows = len(machines) * count
    do, to, numbers = np.zeros(rows, dtype=int), np.zeros((rows, MAX_NEXT), dtype=int), np.zeros((2, rows))
    chances = np.zeros((rows, len(FLOORS) + MAX_COUNT + 1, MAX_NEXT))
    for machine, states in enumerate(machines):
        names = [state["name"] for state in states]
        for row, state in enumerate(states, machine * count):
            do[row] = list(DO).index(state["do"])
            numbers[:, row] = state.get("turn_steps", 0.0), state.get("gain", 0.0)
            for column, follows in enumerate(state.get("next", ())):
                to[row, column] = names.index(follows["to"])
                chances[row, :, column] = _find_chances(follows)
    return Tables(count, do, numbers[0], numbers[1], to, chances)


def _find_chances(follows: State) -> np.ndarray:
    when, counts = follows["when"], np.arange(MAX_COUNT + 1.0)
    if when in _SHARES:
        on_floors = [follows["probability"] * (when in (floor, "fixed probability")) for floor in FLOORS]
        return np.array(on_floors + [0.0] * len(counts))
    lacking = follows["steepness"] * (follows["neighbors"] - counts)
    enough = 1.0 / (1.0 + np.exp(np.clip(lacking, -50.0, 50.0)))
    return np.concatenate((np.zeros(len(FLOORS)), enough if when == "neighbor count" else 1.0 - enough))


def follow(children: Sequence[State]) -> List[State]:
    """Return a tree, a sequence with memory of selectors, as states: each acts until its condition holds."""
    following = [str((number + 1) % len(children)) for number in range(len(children))]
    moves = [{"to": to, **child["until"]} for to, child in zip(following, children)]
    return [{**child, "name": str(number), "next": [moves[number]]} for number, child in enumerate(children)]


def draw_dot(states: Sequence[State]) -> str:
    """Return a machine as a graph in the language of Graphviz: a dot leads to the start; transitions have the numbers
    of their order."""
    lines = ["digraph {", 'node [shape=box style=rounded fontname="Helvetica"]', 'edge [fontname="Helvetica"]']
    lines += ['"" [shape=point width=0.15]', '"" -> "%s"' % states[0]["name"]]
    for state in states:
        lines.append('"%s" [label="%s: %s"]' % (state["name"], state["name"], _describe(state, "do", DO)))
        for number, follows in enumerate(state["next"], 1):
            told = state["name"], follows["to"], number, _describe(follows, "when", WHEN).replace("\\n", "  \\n  ")
            lines.append('"%s" -> "%s" [label="  %d. %s  "]' % told)
    return "\n".join([*lines, "}\n"])


def _describe(given: State, kind: str, kinds: Kinds) -> str:
    return "\\n".join([given[kind], *("%s %g" % (name, given[name]) for name in kinds[given[kind]])])
