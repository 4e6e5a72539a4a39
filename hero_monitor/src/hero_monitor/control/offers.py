"""Programs that pages may start, and the parameters that they may set: nothing else is ever run. Pure."""

import json
from typing import Any, Dict, List, NamedTuple, Sequence, Union

from hero_client.apps.formations import Point, place_formation
from hero_client.controllers.orca import AvoidanceLaw
from hero_client.values.robot_constants import MAX_LINEAR_M_S
from hero_node.number_checks import is_number

from .requests import MAX_GOAL_M, RequestError

FORMATION_KEYS = ("shape", "spacing_m", "turn_deg", "x_m", "y_m")
"""Of the formation; all others are parameters of the program."""

BEHAVIORS = (
    "aggregation", "box_pushing", "cooperative_transport", "coverage", "cyclic_pursuit", "dispersal", "dispersion",
    "evolved_aggregation", "flocking", "formation", "leader_followers", "majority", "milling", "object_clustering",
    "rendezvous", "segregation", "voter", "wall_following",
)  # fmt: skip


class Field(NamedTuple):
    """A parameter: a number within limits, one of some options, or a flag."""

    default: Union[float, str, bool]
    low: float = 0.0
    high: float = 0.0
    unit: str = ""
    options: Sequence[str] = ()
    on_map: bool = False  # a click on the map sets it

    def admits(self, value: Any) -> bool:
        """Return whether a page may set this value."""
        if isinstance(self.default, bool):
            return isinstance(value, bool)
        if self.options:
            return isinstance(value, str) and value in self.options
        return is_number(value, self.low, self.high)


class Offer(NamedTuple):
    """A program, by the name that its package installs it under."""

    package: str
    title: str
    fields: Dict[str, Field] = {}
    has_frame: bool = False  # it needs the robots' places on the map
    drives: slice = slice(None)  # which of its robots, in their order; pages may drive the others meanwhile


_SPEED = Field(0.08, 0.01, MAX_LINEAR_M_S, "m/s")

OFFERS = {
    "swarm_go_to": Offer(
        "hero_examples",
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
    "go_to_goal": Offer(
        "hero_examples", "take goals from the map", {"avoid": Field(False)}
    ),
    "random_walk": Offer(
        "hero_examples",
        "random walk",
        {"linear_m_s": _SPEED._replace(default=0.1), "angular_rad_s": Field(1.5, 0.1, 4.0, "rad/s")},
    ),
    "follow": Offer(
        "hero_examples",
        "follow the first one",
        {"gap_m": Field(0.15, 0.1, 2.0, "m"), "linear_m_s": _SPEED._replace(default=0.15)},
        has_frame=True,
        drives=slice(1, None),
    ),
    "led_show": Offer(
        "hero_examples",
        "light show",
        {
            "pattern": Field("rainbow", options=("rainbow", "chase", "blink")),
            "period_s": Field(4.0, 0.5, 60.0, "s"),
            "brightness": Field(1.0, 0.0, 1.0),
        },
        drives=slice(0, 0),
    ),
    "behavior": Offer(
        "hero_swarm",
        "behavior",
        {
            "behavior": Field("milling", options=BEHAVIORS),
            "safety": Field("fence and robots", options=("off", "fence and robots")),
        },
        has_frame=True,
    ),
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
    parameters: Dict[str, Any] = {"robots": " ".join(map(str, robot_ids))}
    parameters.update(values)
    if "shape" in values:
        parameters = {name: value for name, value in parameters.items() if name not in FORMATION_KEYS}
        parameters["formation"] = _make_formation(values)
    if OFFERS[program].has_frame:
        parameters["frame"] = frame
    # JSON is YAML, as rospy reads arguments: no value becomes another one, or another type.
    return ["_%s:=%s" % (name, json.dumps(value)) for name, value in parameters.items()]


def describe_offers(names: Sequence[str]) -> List[Dict[str, Any]]:
    """Return what pages need to offer these programs."""
    return [
        {
            "program": name,
            "title": OFFERS[name].title,
            "fields": [{"name": field, **OFFERS[name].fields[field]._asdict()} for field in OFFERS[name].fields],
        }
        for name in OFFERS
        if name in names
    ]

