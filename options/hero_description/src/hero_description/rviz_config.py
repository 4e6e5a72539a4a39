"""The configuration of RViz for a number of robots, as text: displays.yaml, with the displays of each robot. Pure."""

from colorsys import hls_to_rgb
from pathlib import Path
from string import Template
from typing import Any, Collection, Sequence, Tuple

import yaml

from hero_node.parameters import parse_explicit_ids

TEMPLATE = Path(__file__).with_name("displays.yaml")

TRUE = "true"
"""Part of the names of frames and topics of simulated robots where they truly are: see true_poses."""

FRAMES = {"orbit": "world", "close": "world", "above": "world", "map": "map"}
"""Fixed frame of each view, unless another is given."""


def read_ids(name: str, value: Any) -> Sequence[int]:
    """Return the ids of a parameter that may name no robot. Raises: ProgramError."""
    return parse_explicit_ids(name, value) if value not in ("", ()) else ()


def color_of(robot_id: int) -> Tuple[float, float, float]:
    """Return a robot's own color, red, green, blue, each 0..1; hues are a golden angle apart, as in hero_monitor."""
    return hls_to_rgb((robot_id * 137.508 + 24.0) / 360.0, 0.42, 0.7)


def make_config(
    names: Sequence[str],
    fixed_frame: str = "",
    view: str = "orbit",
    picture: bool = False,
    hero_plus: Collection[str] = (),
    simulated: Collection[str] = (),
) -> str:
    """Return the configuration for robots with these names (hero_0, ...), of which hero_plus are HeRo+.

    Those that are simulated are drawn where they are; a group shows where odometry believes them.
    view: one of FRAMES, which holds the fixed frame if none is given; picture: with that of the overhead camera.
    """
    common, own = TEMPLATE.read_text(encoding="utf-8").split("\n---\n")
    config = yaml.safe_load(Template(common).substitute(name=names[0]))
    manager = config["Visualization Manager"]
    *displays, odometry, localization, image = manager["Displays"]
    for name in names:
        parts = yaml.safe_load(
            Template(own).substitute(
                name=name,
                place=f"{name}/{TRUE}" if name in simulated else name,
                color="; ".join("%d" % (255 * part) for part in color_of(int(name.rpartition("_")[2]))),
            )
        )
        displays += [*(parts["hero_plus"] if name in hero_plus else []), *parts["robot"]]
        odometry["Displays"] += parts["odometry"] if name in simulated else []
        localization["Displays"] += parts["localization"]
    localization["Enabled"] = view == "map"
    # RViz enables an image even if its file says no.
    manager["Displays"] = [*displays, odometry, localization, *([image] if picture else [])]
    manager["Global Options"]["Fixed Frame"] = fixed_frame or FRAMES[view]
    manager["Views"] = {"Current": manager["Views"][view]}
    return str(yaml.safe_dump(config, sort_keys=False, default_flow_style=False))
