"""Files of controllers, which are read, edited and run again. Pure but for YAML.

    arena: black_spot_arena.yaml   # whose floor and lamps it senses
    states:                        # the first one is the start
      - {name: search, do: exploration, turn_steps: 20, next: [{to: rest, when: black floor, probability: 0.9}]}
      - {name: rest, do: stop}

or `tree: [{do: exploration, turn_steps: 20, until: {when: black floor, probability: 0.9}}, ...]`, each child of which
acts until its condition holds, the first after the last; or `behavior: segregation` with `numbers: {own_m: 0.2}`.
"""

from typing import Any, Dict, List, NamedTuple

from hero_node.files import Entry, EntryError, load_entries
from hero_sim.world import locate_arena

from .modules import DO, LIMITS, MAX_NEXT, WHEN, WHOLE_LIMITS, Kinds, State, follow

ENDING = ".controller"

_EXAMPLE = "states: [{name: rest, do: stop}]"


class Controller(NamedTuple):
    """A file that has been checked: states of a machine or tree, or a behavior with numbers."""

    arena: str
    states: List[State] = []
    is_tree: bool = False
    behavior: str = ""
    numbers: Dict[str, float] = {}


def read_controller(path: str, content: bytes) -> Controller:
    """Return what a file holds. Raises: EntryError with path and line."""
    root = load_entries(path, _EXAMPLE, lambda _: content)
    kinds = [kind for kind in ("states", "tree", "behavior") if kind in root.mapping()]
    if len(kinds) != 1:
        raise EntryError(f"{path}: needs states, a tree or a behavior, such as {_EXAMPLE}")
    given = root.mapping(("arena", *kinds, *(["numbers"] if kinds == ["behavior"] else [])))
    arena = locate_arena(path, given["arena"].text() if "arena" in given else "")
    if "behavior" in given:
        if given["behavior"].text().endswith(ENDING):
            given["behavior"].refuse("built in, FILE.py or FILE.py:Class")
        numbers = given["numbers"].mapping() if "numbers" in given else {}
        values = {name: number.number(-1e6, 1e6, "") for name, number in numbers.items()}
        return Controller(arena, behavior=given["behavior"].text(), numbers=values)
    if "tree" in given:
        children = _take(given["tree"])
        conditions = [_read_module(child.mapping(None, ("until",))["until"], "when", WHEN) for child in children]
        pairs = zip(children, conditions)
        return Controller(arena, follow([_read_module(child, "do", DO, until=until) for child, until in pairs]), True)
    entries = given["states"].entries()
    names = [entry.mapping(None, ("name",))["name"].text() for entry in entries]
    if len(set(names)) < len(names):
        given["states"].refuse("states of different names")
    states = []
    for entry, name in zip(entries, names):
        follows = _take(entry.mapping()["next"]) if "next" in entry.mapping() else []
        tos = [item.mapping(None, ("to",))["to"].choice(names) for item in follows]
        moves = [_read_module(item, "when", WHEN, to=to) for item, to in zip(follows, tos)]
        states.append(_read_module(entry, "do", DO, name=name, next=moves))
    return Controller(arena, states)


def _take(entry: Entry) -> List[Entry]:
    if len(entry.entries()) > MAX_NEXT:
        entry.refuse("a list of at most %d" % MAX_NEXT)
    return entry.entries()


def _read_module(entry: Entry, kind: str, kinds: Kinds, **known: Any) -> State:
    """Return known with the behavior (do) or condition (when) of an entry, and its numbers."""
    module = entry.mapping(None, (kind,))[kind].choice(kinds)
    given = entry.mapping((kind, *known, *kinds[module]), kinds[module])
    numbers: State = {name: given[name].whole(*WHOLE_LIMITS[name]) for name in kinds[module] if name in WHOLE_LIMITS}
    numbers.update({name: given[name].number(*LIMITS[name], "") for name in kinds[module] if name not in WHOLE_LIMITS})
    return {**known, kind: module, **numbers}
