"""The configuration of RViz for a number of robots, as text. Pure.

Displays of what only simulated or localized robots have (arena; poses, occupancy grid) are always
included: with other robots nothing is published on their topics. Source of the format: files that RViz 1.14 writes,
reduced to what differs from its defaults.
"""

from colorsys import hls_to_rgb
from typing import Any, Collection, Dict, List, Mapping, Sequence, Tuple

import yaml

from hero_node.parameters import parse_explicit_ids

LIGHTS_TOPIC = "/hero_lights"
# Between RViz and the node goal_choice.
CHOICE_TOPIC = "/hero_choice/chosen"
POINT_TOPIC = "/hero_choice/point"
GOAL_TOPIC = "/hero_choice/goal"
ABOVE_PIXELS_PER_M = 300
"""Scale of the views from above: an arena of 2.2 m fits into the window."""

TRUE = "true"
"""Part of the names of frames and topics of simulated robots where they truly are: see true_poses."""

PLUS_DESCRIPTION = "hero_plus_description"
"""Parameter that holds the URDF of HeRo+."""

MARKERS = 10000
"""Single markers that wait for their transform; RViz drops the oldest, of walls for good."""

ORBITS = {"orbit": (2.6, 1.0, 4.71, 0.0), "close": (0.27, 0.45, 0.6, 0.02)}
"""Distance (m), pitch and yaw (rad) of the camera, height of the focal point above the fixed frame (m)."""

FRAMES = {"orbit": "world", "close": "world", "above": "world", "map": "map"}
"""Fixed frame of each view, unless another is given."""


def read_ids(name: str, value: Any) -> Sequence[int]:
    """Return the ids of a parameter that may name no robot. Raises: ProgramError."""
    return parse_explicit_ids(name, value) if value not in ("", ()) else ()


def color_of(robot_id: int) -> Tuple[float, float, float]:
    """Return a robot's own color, red, green, blue, each 0..1; hues are a golden angle apart, as in hero_monitor."""
    return hls_to_rgb((robot_id * 137.508 + 24.0) / 360.0, 0.42, 0.7)


def make_display(kind: str, name: str, settings: Mapping[str, Any], enabled: bool = True) -> Dict[str, Any]:
    """Return a display of one of RViz's own kinds."""
    return {"Class": "rviz/" + kind, "Name": name, "Enabled": enabled, **settings}


def make_model(name: str, title: str, prefix: str, is_plus: bool, alpha: float = 1.0) -> Dict[str, Any]:
    """Return the display of a robot's body, at the frames with this prefix."""
    settings = {
        "Robot Description": PLUS_DESCRIPTION if is_plus else "robot_description",
        "TF Prefix": prefix,
        "Update Interval": 0,
        "Alpha": alpha,
    }
    return make_display("RobotModel", title, settings)


def make_robot_displays(name: str, is_plus: bool, place: str) -> List[Dict[str, Any]]:
    """Return the displays of one robot: model, path by odometry, proximity, and of a HeRo+ the distance ahead.

    place: name, or of a simulated robot name/true, where its frames and what it sees are drawn.
    """
    color = "; ".join("%d" % (255 * part) for part in color_of(int(name.rpartition("_")[2])))
    path = {
        "Topic": f"/{name}/odom",
        "Unreliable": False,
        "Queue Size": 100,  # of slow graphics, which draw a few times a second
        "Keep": 300,
        "Position Tolerance": 0.02,
        "Angle Tolerance": 7.0,
        "Covariance": {"Value": False},
        # Without heads, each as long as the way to the next: a line.
        "Shape": make_arrow(color, (0.025, 0.0025), (0.0001, 0.0001)),
    }
    proximity = {
        "Topic": f"/{place}/proximity",
        "Style": "Spheres",
        "Size (m)": 0.012,
        "Color Transformer": "FlatColor",
        "Color": color,
        "Decay Time": 0,
    }
    distance = {"Topic": f"/{name}/range", "Color": color, "Alpha": 0.3}
    return [
        *([make_display("Range", name + " distance", distance)] if is_plus else []),
        make_model(name, name, place, is_plus),
        make_display("Odometry", name + " path", path),
        make_display("LaserScan", name + " proximity", proximity),
    ]


def make_arrow(color: str, shaft_m: Tuple[float, float], head_m: Tuple[float, float]) -> Dict[str, Any]:
    """Return the shape of an Odometry display; shaft_m, head_m: length and radius."""
    return {
        "Value": "Arrow",
        "Color": color,
        "Alpha": 0.8,
        **dict(zip(("Shaft Length", "Shaft Radius", "Head Length", "Head Radius"), shaft_m + head_m)),
    }


def make_pose_display(name: str) -> Dict[str, Any]:
    """Return the display of a robot's pose by hero_localization, with its error."""
    settings = {
        "Topic": f"/{name}/pose",
        "Shape": "Axes",
        "Axes Length": 0.06,
        "Axes Radius": 0.003,
        "Covariance": {"Value": True, "Orientation": {"Value": False}, "Position": {"Value": True, "Scale": 3}},
    }
    return make_display("PoseWithCovariance", name + " pose", settings)


def make_view(view: str) -> Dict[str, Any]:
    """Return the camera of a view; "above" and "map" have x to the right and y up."""
    if view not in ORBITS:
        return {
            "Class": "rviz/TopDownOrtho",
            "Scale": ABOVE_PIXELS_PER_M,
            "X": 0.0,
            "Y": 0.0,
            "Angle": 0.0,
            "Target Frame": "<Fixed Frame>",
        }
    distance_m, pitch_rad, yaw_rad, height_m = ORBITS[view]
    return {
        "Class": "rviz/Orbit",
        "Distance": distance_m,
        "Pitch": pitch_rad,
        "Yaw": yaw_rad,
        "Focal Point": {"X": 0.0, "Y": 0.0, "Z": height_m},
        "Target Frame": "<Fixed Frame>",
    }


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
    grid = {"Cell Size": 0.1, "Plane Cell Count": 40, "Color": "200; 200; 200", "Alpha": 0.5}
    displays = [make_display("Grid", "Grid", grid)]
    for name, topic in (
        ("arena (simulated)", "/hero_sim/arena"),
        ("robots of a replay", "/hero_sim/replay"),
        ("objects (simulated)", "/hero_sim/object_markers"),
        ("names, rings, lights", LIGHTS_TOPIC),
        ("selected robot", CHOICE_TOPIC),
        ("swarm behavior", "/behavior/markers"),
    ):
        displays.append(make_display("MarkerArray", name, {"Marker Topic": topic, "Queue Size": MARKERS}))
    for name in names:
        displays += make_robot_displays(name, name in hero_plus, f"{name}/{TRUE}" if name in simulated else name)
    ghosts = [make_model(name, name + " odometry", name, name in hero_plus, 0.3) for name in names if name in simulated]
    displays.append(make_display("Group", "odometry (simulated)", {"Displays": ghosts}, enabled=False))
    localization = [make_display("Map", "occupancy grid", {"Topic": "/map", "Alpha": 0.6})]
    localization += [make_pose_display(name) for name in names]
    displays.append(make_display("Group", "localization", {"Displays": localization}, enabled=view == "map"))
    if picture:  # RViz enables an image even if its file says no
        displays.append(make_display("Image", "camera's image", {"Image Topic": "/track/picture"}))
    config = {
        "Panels": [
            {"Class": "rviz/Displays", "Name": "Displays"},
            {"Class": "rviz/Views", "Name": "Views"},
        ],
        "Visualization Manager": {
            "Class": "",
            "Displays": displays,
            "Global Options": {
                "Background Color": "250; 250; 250",
                "Fixed Frame": fixed_frame or FRAMES[view],
                "Frame Rate": 20,
            },
            "Tools": [
                {"Class": "rviz/MoveCamera"},
                {"Class": "rviz/Select"},
                {"Class": "rviz/FocusCamera"},
                {"Class": "rviz/Measure"},
                # See goal_choice.
                {"Class": "rviz/PublishPoint", "Single click": True, "Topic": POINT_TOPIC},
                {"Class": "rviz/SetGoal", "Topic": GOAL_TOPIC},
            ],
            "Views": {"Current": make_view(view)},
        },
        "Window Geometry": {"X": 0, "Y": 0, "Width": 1200, "Height": 800},
    }
    return str(yaml.safe_dump(config, sort_keys=False, default_flow_style=False))
