"""Behaviors and conditions of which machines are made, and many machines as arrays. Pure.

Source: AutoMoDe-Chocolate (G. Francesca et al., Swarm Intelligence 2015), of whose modules Maple (J. Kuckling et al.,
ANTS 2018) makes trees.
"""

from typing import Any, Dict, List, Sequence, Tuple

import numpy as np

Kinds = Dict[str, Tuple[str, ...]]
"""Modules, and the names of their numbers."""

_PLAIN: Kinds = dict.fromkeys(("stop", "phototaxis", "anti-phototaxis"), ())
DO: Kinds = {"exploration": ("turn_steps",), **_PLAIN, **dict.fromkeys(("attraction", "repulsion"), ("gain",))}

_SHARES = "black floor", "gray floor", "white floor", "fixed probability"
_COUNTS = "neighbor count", "inverted neighbor count"
WHEN: Kinds = {**dict.fromkeys(_SHARES, ("probability",)), **dict.fromkeys(_COUNTS, ("neighbors", "steepness"))}

WHOLE_LIMITS = {"turn_steps": (1, 100), "neighbors": (0, 10)}
LIMITS = {"gain": (1.0, 5.0), "probability": (0.0, 1.0), "steepness": (0.0, 20.0), **WHOLE_LIMITS}

MAX_NEXT = 4  # transitions of a state, and children of a tree

State = Dict[str, Any]  # {name, do, numbers, next: [{to, when, numbers}]}


def stack(machines: Sequence[List[State]]) -> Dict[str, np.ndarray]:
    """Return M machines of up to S states as arrays, by the names of what they hold.

    do and its numbers (M, S); to, when and its numbers (M, S, MAX_NEXT); when is -1 where there is no transition.
    """
    shape = len(machines), max(map(len, machines))
    tables = {name: np.zeros(shape, int if name == "do" else float) for name in ("do", "turn_steps", "gain")}
    tables.update({name: np.zeros((*shape, MAX_NEXT)) for name in ("probability", "neighbors", "steepness")})
    tables.update(to=np.zeros((*shape, MAX_NEXT), int), when=np.full((*shape, MAX_NEXT), -1))
    for machine, states in enumerate(machines):
        names = [state["name"] for state in states]
        for row, state in enumerate(states):
            _fill(tables, (machine, row), "do", DO, state)
            for column, follows in enumerate(state.get("next", ())):
                _fill(tables, (machine, row, column), "when", WHEN, follows)
                tables["to"][machine, row, column] = names.index(follows["to"])
    return tables


def _fill(tables: Dict[str, np.ndarray], place: Tuple[int, ...], kind: str, kinds: Kinds, given: State) -> None:
    tables[kind][place] = list(kinds).index(given[kind])
    for name in kinds[given[kind]]:
        tables[name][place] = given[name]


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
