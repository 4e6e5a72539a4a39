"""Programs that pages may start, and the parameters that they may set: nothing else is ever run. Pure."""

import json
from typing import Any, Dict, List, NamedTuple, Sequence, Union

from hero_client.apps.formations import Point, place_formation
from hero_client.controllers.orca import AvoidanceLaw
from hero_client.values.robot_constants import MAX_LINEAR_M_S
from hero_node.number_checks import is_number, is_whole_number

from .requests import MAX_GOAL_M, RequestError

FORMATION_KEYS = ("shape", "spacing_m", "turn_deg", "x_m", "y_m")
"""Of the formation; all others are parameters of the program."""

class Field(NamedTuple):
    """A parameter: a number within limits, one of some options, or a flag."""

    default: Union[float, str, bool]
    low: float = 0.0
    high: float = 0.0
    unit: str = ""
    options: Sequence[str] = ()
    on_map: bool = False  # a click on the map sets it
    whole: bool = False

    def admits(self, value: Any) -> bool:
        """Return whether a page may set this value."""
        if isinstance(self.default, bool):
            return isinstance(value, bool)
        if self.options:
            return isinstance(value, str) and value in self.options
        return (is_whole_number if self.whole else is_number)(value, self.low, self.high)


class Offer(NamedTuple):
    """A program of a package."""

    package: str
    program: str
    title: str
    fields: Dict[str, Field] = {}
    has_frame: bool = False  # it needs the robots' places on the map
    drives: slice = slice(None)  # which of its robots, in their order; pages may drive the others meanwhile
    behavior: str = ""  # the built-in one that program behavior runs; fields but safety are numbers of its class


_SPEED = Field(0.08, 0.01, MAX_LINEAR_M_S, "m/s")
_SPEED_LIMIT = {"max_linear_m_s": _SPEED._replace(default=0.1)}
_WHEELS = {"wheel_m_s": _SPEED._replace(default=0.12)}
_GAIN = Field(0.5, 0.0, 5.0, "1/s")
_RANGE = Field(0.5, 0.05, 5.0, "m")
_COORDINATE = Field(0.0, -MAX_GOAL_M, MAX_GOAL_M, "m")
_PUSH = {"goal_x_m": _COORDINATE, "goal_y_m": _COORDINATE, "linear_m_s": _SPEED}
_VOTE = {"changes_hz": Field(0.5, 0.01, 10.0, "1/s"), "cruise_m_s": _SPEED._replace(default=0.1)}

BEHAVIORS: Dict[str, Dict[str, Field]] = {
    "aggregation": {},
    "evolved_aggregation": _WHEELS,
    "cyclic_pursuit": _WHEELS,
    "dispersal": _WHEELS,
    "milling": _WHEELS,
    "wall_following": _WHEELS,
    "flocking": {
        "spacing_m": _RANGE._replace(default=0.25),
        "alignment": Field(0.1, 0.0, 1.0, "m/s"),
        "cohesion": Field(0.15, 0.0, 2.0, "1/s"),
        "cruise_m_s": _SPEED._replace(default=0.05),
        **_SPEED_LIMIT,
    },
    "dispersion": {"spacing_m": _RANGE, "gain_1_s": _GAIN._replace(default=0.4), **_SPEED_LIMIT},
    "segregation": {
        "groups": Field(2, 2, 6, whole=True),
        "own_m": _RANGE._replace(default=0.15),
        "others_m": _RANGE._replace(default=1.0),
        **_SPEED_LIMIT,
    },
    "rendezvous": {"gain_1_s": _GAIN, **_SPEED_LIMIT},
    "leader_followers": {"gap_m": _RANGE._replace(default=0.15), "leader_m_s": _SPEED._replace(default=0.05)},
    "formation": {"side_m": _RANGE._replace(default=0.25), "max_linear_m_s": _SPEED},
    "coverage": {"width_m": Field(2.0, 0.2, 20.0, "m"), "height_m": Field(2.0, 0.2, 20.0, "m"), **_SPEED_LIMIT},
    "object_clustering": _WHEELS,
    "box_pushing": _PUSH,
    "cooperative_transport": _PUSH,
    "voter": _VOTE,
    "majority": _VOTE,
}
"""Built-in behaviors, with those of their numbers that pages may set."""

_SAFETY = Field("fence and robots", options=("off", "fence and robots"))

_BEHAVIOR_TITLES = {"formation": "formation by distances"}
"""Titles other than the name without underscores."""

OFFERS = {
    "swarm_go_to": Offer(
        "hero_examples",
        "swarm_go_to",
        "formation",
        {
            "shape": Field("circle", options=("circle", "line", "grid")),
            "spacing_m": Field(0.3, AvoidanceLaw().min_spacing_m, 2.0, "m"),
            "turn_deg": Field(0.0, -360.0, 360.0, "deg", on_map=True),
            "x_m": Field(0.0, -MAX_GOAL_M, MAX_GOAL_M, "m", on_map=True),
            "y_m": Field(0.0, -MAX_GOAL_M, MAX_GOAL_M, "m", on_map=True),
            "linear_m_s": _SPEED,
        },
        has_frame=True,
    ),
    "go_to_goal": Offer("hero_examples", "go_to_goal", "take goals from the map", {"avoid": Field(False)}),
    "random_walk": Offer(
        "hero_examples",
        "random_walk",
        "random walk",
        {"linear_m_s": _SPEED._replace(default=0.1), "angular_rad_s": Field(1.5, 0.1, 4.0, "rad/s")},
    ),
    "follow": Offer(
        "hero_examples",
        "follow",
        "follow the first one",
        {"gap_m": Field(0.15, 0.1, 2.0, "m"), "linear_m_s": _SPEED._replace(default=0.15)},
        has_frame=True,
        drives=slice(1, None),
    ),
    "led_show": Offer(
        "hero_examples",
        "led_show",
        "light show",
        {
            "pattern": Field("rainbow", options=("rainbow", "chase", "blink")),
            "period_s": Field(4.0, 0.5, 60.0, "s"),
            "brightness": Field(1.0, 0.0, 1.0),
        },
        drives=slice(0, 0),
    ),
    **{
        "behavior_" + name: Offer(
            "hero_swarm",
            "behavior",
            _BEHAVIOR_TITLES.get(name, name.replace("_", " ")),
            {**fields, "safety": _SAFETY},
            has_frame=True,
            behavior=name,
        )
        for name, fields in BEHAVIORS.items()
    },
}
"""The programs, in the order in which pages list them. Pages send "values" for the fields of one."""


def check_values(program: str, values: Dict[str, Any]) -> None:
    """Check the values that a page sets. Raises: RequestError."""
    if program not in OFFERS:
        raise RequestError("unknown program")
    fields = OFFERS[program].fields
    if set(values) != set(fields):
        raise RequestError("%s needs values for: %s" % (program, ", ".join(fields) or "nothing"))
    for name, value in values.items():
        if not fields[name].admits(value):
            raise RequestError("%s of %s is invalid" % (name, program))


def place_robots(values: Dict[str, Any], count: int) -> List[Point]:
    """Return the places that robots of a program drive to, m; none if it has no formation. Raises: FormationError."""
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
        numbers = {name: value for name, value in values.items() if name in BEHAVIORS[offer.behavior]}
        parameters.update(behavior=offer.behavior, safety=values["safety"], parameters=numbers)
    else:
        parameters.update(values)
    if "shape" in values:
        parameters = {name: value for name, value in parameters.items() if name not in FORMATION_KEYS}
        parameters["formation"] = _make_formation(values)
    if offer.has_frame:
        parameters["frame"] = frame
    # JSON is YAML, as rospy reads arguments: no value becomes another one, or another type.
    return ["_%s:=%s" % (name, json.dumps(value)) for name, value in parameters.items()]


def describe_offers(names: Sequence[str]) -> List[Dict[str, Any]]:
    """Return what pages need to offer these programs."""
    return [
        {
            "program": name,
            "title": OFFERS[name].title,
            "is_behavior": OFFERS[name].behavior != "",
            "fields": [{"name": field, **OFFERS[name].fields[field]._asdict()} for field in OFFERS[name].fields],
        }
        for name in OFFERS
        if name in names
    ]

