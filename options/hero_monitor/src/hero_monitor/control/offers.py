"""Programs that pages may start, and the parameters that they may set: nothing else is ever run. Pure."""

import json
from typing import Any, Dict, List, NamedTuple, Sequence

from hero_client.apps.formations import Point, place_formation
from hero_client.controllers import AvoidanceLaw
from hero_client.values import MAX_LINEAR_M_S
from hero_node import ProgramError
from hero_node.parameters import Parameter, choice, flag, number, whole_number

from .requests import MAX_GOAL_M, RequestError


class ProgramDescription(NamedTuple):
    """A program of a package."""

    package: str
    program: str
    title: str
    fields: Dict[str, Parameter] = {}
    has_frame: bool = False  # it needs the robots' places on the map
    drives: slice = slice(None)  # which of its robots, in their order; pages may drive the others meanwhile
    sentence: str = ""  # on what it does
    behavior: str = ""  # what program behavior runs; fields but safety are numbers of its class


_SPEED = number(0.08, 0.01, MAX_LINEAR_M_S, "m/s")
_COORDINATE = number(0.0, -MAX_GOAL_M, MAX_GOAL_M, "m")

_SAFETY = choice("fence and robots", ("off", "fence and robots"))

_PLACE = {"turn_deg": number(0.0, -360.0, 360.0, "deg"), "x_m": _COORDINATE, "y_m": _COORDINATE}
"""Parameters of a formation: a click on the map sets it."""

_FORMATION = {
    "shape": choice("circle", ("circle", "line", "grid")),
    "spacing_m": number(0.3, AvoidanceLaw().min_spacing_m, 2.0, "m"),
    **_PLACE,
    "linear_m_s": _SPEED,
}
_WALK = {"linear_m_s": _SPEED._replace(default=0.1), "angular_rad_s": number(1.5, 0.1, 4.0, "rad/s")}
_ROW = {"gap_m": number(0.15, 0.1, 2.0, "m"), "linear_m_s": _SPEED._replace(default=0.15)}
_LIGHTS = {
    "pattern": choice("rainbow", ("rainbow", "chase", "blink")),
    "period_s": number(4.0, 0.5, 60.0, "s"),
    "brightness": number(1.0, 0.0, 1.0),
}

_EXAMPLES = (
    ProgramDescription("hero_examples", "swarm_go_to", "formation", _FORMATION, has_frame=True),
    ProgramDescription("hero_examples", "go_to_goal", "take goals from the map", {"avoid": flag(False)}),
    ProgramDescription("hero_examples", "random_walk", "random walk", _WALK),
    ProgramDescription("hero_examples", "follow", "follow the first one", _ROW, has_frame=True, drives=slice(1, None)),
    ProgramDescription("hero_examples", "led_show", "light show", _LIGHTS, drives=slice(0, 0)),
)

OFFERS: Dict[str, ProgramDescription] = {offer.program: offer for offer in _EXAMPLES}
"""The programs, in the order in which pages list them. Pages send "values" for the fields of one.

Programs adds the behaviors that are installed.
"""


def read_behaviors(described: Sequence[Dict[str, Any]]) -> Dict[str, ProgramDescription]:
    """Return the behaviors that `python3 -m hero_swarm describe` lists."""
    return {"behavior_" + behavior["behavior"]: _read_behavior(**behavior) for behavior in described}


def _read_behavior(
    behavior: str, title: str, fields: Sequence[Dict[str, Any]], sentence: str = ""
) -> ProgramDescription:
    settings = {}
    for field in fields:
        declare, (low, high) = whole_number if isinstance(field["default"], int) else number, field["limits"]
        settings[field["name"]] = declare(field["default"], low, high, field["unit"])
    settings["safety"] = _SAFETY
    return ProgramDescription(
        "hero_swarm", "behavior", title, settings, has_frame=True, behavior=behavior, sentence=sentence
    )


def check_values(program: str, values: Dict[str, Any]) -> Dict[str, Any]:
    """Return the values that a page sets, checked. Raises: RequestError."""
    if program not in OFFERS:
        raise RequestError("unknown program")
    fields = OFFERS[program].fields
    if set(values) != set(fields):
        raise RequestError(f"{program} needs values for: {', '.join(fields) or 'nothing'}")
    try:
        return {name: fields[name].check(name, value) for name, value in values.items()}
    except ProgramError as error:
        raise RequestError(str(error)) from None


def place_robots(values: Dict[str, Any], count: int) -> List[Point]:
    """Return the places that robots of a program drive to, m; none if it has no formation. Raises: EntryError."""
    if "shape" not in values:
        return []
    return place_formation(_make_formation(values), count, AvoidanceLaw().min_spacing_m)


def _make_formation(values: Dict[str, Any]) -> Dict[str, Any]:
    formation = {name: values[name] for name in ("shape", "spacing_m", "turn_deg")}
    return {**formation, "center": [values["x_m"], values["y_m"]]}


def make_arguments(program: str, robot_ids: Sequence[int], frame: str, values: Dict[str, Any]) -> List[str]:
    """Return the private parameters of a program as arguments; frame: the map's."""
    offer = OFFERS[program]
    parameters: Dict[str, Any] = {"robots": " ".join(map(str, robot_ids))}
    if offer.behavior:
        numbers = dict(values)
        parameters.update(behavior=offer.behavior, safety=numbers.pop("safety"), parameters=numbers)
    elif "shape" in values:
        parameters.update(formation=_make_formation(values), linear_m_s=values["linear_m_s"])
    else:
        parameters.update(values)
    if offer.has_frame:
        parameters["frame"] = frame
    # JSON is YAML, as rospy reads arguments: no value becomes another one, or another type.
    return [f"_{name}:={json.dumps(value)}" for name, value in parameters.items()]


def describe_offers(names: Sequence[str]) -> List[Dict[str, Any]]:
    """Return what pages need to offer these programs."""
    return [
        {
            "program": name,
            "title": OFFERS[name].title,
            "sentence": OFFERS[name].sentence,
            "fields": [_describe_field(*field) for field in OFFERS[name].fields.items()],
        }
        for name in OFFERS
        if name in names
    ]


def _describe_field(name: str, field: Parameter) -> Dict[str, Any]:
    return {
        "name": name,
        "default": field.default,
        "limits": field.limits,
        "step": 1 if isinstance(field.default, int) else "any",
        "unit": field.unit,
        "choices": field.choices,
        "on_map": name in _PLACE,
    }
