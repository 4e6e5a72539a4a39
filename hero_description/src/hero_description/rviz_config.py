"""The configuration of RViz for a number of robots, as text. Pure.

Displays of what only simulated or localized robots have (arena, ground truth; poses, occupancy grid) are always
included: with other robots nothing is published on their topics. Source of the format: files that RViz 1.14 writes,
reduced to what differs from its defaults.
"""

from colorsys import hls_to_rgb
from typing import Any, Collection, Dict, List, Sequence, Tuple

import yaml

LIGHTS_TOPIC = "/hero_lights"
# Between RViz and the node goal_choice.
CHOICE_TOPIC = "/hero_choice/chosen"
POINT_TOPIC = "/hero_choice/point"
GOAL_TOPIC = "/hero_choice/goal"
ABOVE_PIXELS_PER_M = 300
"""Of the views from above: an arena of 2.2 m fits into the window."""

PLUS_DESCRIPTION = "hero_plus_description"
"""Parameter that holds the URDF of HeRo+."""

ORBITS = {"orbit": (2.6, 1.0, 4.71, 0.0), "close": (0.27, 0.45, 0.6, 0.02)}
"""Distance (m), pitch and yaw (rad) of the camera, height of the focal point above the fixed frame (m)."""

FRAMES = {"orbit": "world", "close": "world", "above": "world", "map": "map"}
"""Fixed frame of each view, unless another is given."""


def color_of(robot_id: int) -> Tuple[float, float, float]:
    """Return a robot's own color, red, green, blue, each 0..1; hues are a golden angle apart, as in hero_monitor."""
    return hls_to_rgb((robot_id * 137.508 + 24.0) / 360.0, 0.42, 0.7)


def make_robot_displays(name: str, is_plus: bool) -> List[Dict[str, Any]]:
    """Return the displays of one robot: model, path by odometry, proximity, and of a HeRo+ the distance ahead."""
    color = "; ".join("%d" % (255 * part) for part in color_of(int(name.rpartition("_")[2])))
    distance = {"Class": "rviz/Range", "Name": name + " distance", "Enabled": True, "Topic": "/%s/range" % name}
    return [
        *([{**distance, "Color": color, "Alpha": 0.3}] if is_plus else []),
        {
            "Class": "rviz/RobotModel",
            "Name": name,
            "Enabled": True,
            "Robot Description": PLUS_DESCRIPTION if is_plus else "robot_description",
            "TF Prefix": name,
            "Update Interval": 0,
        },
        {
            "Class": "rviz/Odometry",
            "Name": name + " path",
            "Enabled": True,
            "Topic": "/%s/odom" % name,
            "Unreliable": False,
            "Queue Size": 100,  # of slow graphics, which draw a few times a second
            "Keep": 300,
            "Position Tolerance": 0.02,
            "Angle Tolerance": 7.0,
            "Covariance": {"Value": False},
            # Arrows without heads, each as long as the way to the next: a line.
            "Shape": {
                "Value": "Arrow",
                "Color": color,
                "Alpha": 0.8,
                "Shaft Length": 0.025,
                "Shaft Radius": 0.0025,
                "Head Length": 0.0001,
                "Head Radius": 0.0001,
            },
        },
        {
            "Class": "rviz/LaserScan",
            "Name": name + " proximity",
            "Enabled": True,
            "Topic": "/%s/proximity" % name,
            "Style": "Spheres",
            "Size (m)": 0.012,
            "Color Transformer": "FlatColor",
            "Color": color,
            "Decay Time": 0,
        },
    ]


def make_ground_truth_display(name: str) -> Dict[str, Any]:
    """Return the display of a simulated robot's ground truth: an arrow above the model."""
    return {
        "Class": "rviz/Odometry",
        "Name": name + " ground truth",
        "Enabled": True,
        "Topic": "/%s/ground_truth" % name,
        "Keep": 1,
        "Position Tolerance": 0,
        "Angle Tolerance": 0,
        "Covariance": {"Value": False},
        "Shape": {
            "Value": "Arrow",
            "Color": "60; 60; 60",
            "Alpha": 0.8,
            "Shaft Length": 0.045,
            "Shaft Radius": 0.002,
            "Head Length": 0.015,
            "Head Radius": 0.007,
        },
    }


def make_localization_displays(names: Sequence[str]) -> List[Dict[str, Any]]:
    """Return the displays of what hero_localization publishes: occupancy grid, and poses with their errors."""
    poses = [
        {
            "Class": "rviz/PoseWithCovariance",
            "Name": name + " pose",
            "Enabled": True,
            "Topic": "/%s/pose" % name,
            "Shape": "Axes",
            "Axes Length": 0.06,
            "Axes Radius": 0.003,
            "Covariance": {"Value": True, "Orientation": {"Value": False}, "Position": {"Value": True, "Scale": 3}},
        }
        for name in names
    ]
    grid = {"Class": "rviz/Map", "Name": "occupancy grid", "Enabled": True, "Topic": "/map", "Alpha": 0.6}
    return [grid, *poses]


def make_picture_display() -> Dict[str, Any]:
    """Return the display of the overhead camera's image, which RViz enables even if its file says no."""
    return {"Class": "rviz/Image", "Name": "camera's image", "Enabled": True, "Image Topic": "/track/picture"}


def make_marker_display(name: str, topic: str) -> Dict[str, Any]:
    """Return a display of a visualization_msgs/MarkerArray."""
    return {
        "Class": "rviz/MarkerArray",
        "Name": name,
        "Enabled": True,
        "Marker Topic": topic,
        "Queue Size": 10000,  # single markers that wait for their transform; RViz drops the oldest, of walls for good
    }


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
) -> str:
    """Return the configuration for robots with these names (hero_0, ...), of which hero_plus are HeRo+.

    view: one of FRAMES, which holds the fixed frame if none is given; picture: with that of the overhead camera.
    """
    displays: List[Dict[str, Any]] = [
        {
            "Class": "rviz/Grid",
            "Name": "Grid",
            "Enabled": True,
            "Cell Size": 0.1,
            "Plane Cell Count": 40,
            "Color": "200; 200; 200",
            "Alpha": 0.5,
        },
        make_marker_display("arena (simulated)", "/hero_sim/arena"),
        make_marker_display("robots of a replay", "/hero_sim/replay"),
        make_marker_display("objects (simulated)", "/hero_sim/object_markers"),
        make_marker_display("names, rings, lights", LIGHTS_TOPIC),
        make_marker_display("selected robot", CHOICE_TOPIC),
        make_marker_display("swarm behavior", "/behavior/markers"),
    ]
    for name in names:
        displays += make_robot_displays(name, name in hero_plus)
    displays.append(
        {
            "Class": "rviz/Group",
            "Name": "ground truth (simulated)",
            "Enabled": True,
            "Displays": [make_ground_truth_display(name) for name in names],
        }
    )
    displays.append(
        {
            "Class": "rviz/Group",
            "Name": "localization",
            "Enabled": view == "map",
            "Displays": make_localization_displays(names),
        }
    )
    displays += [make_picture_display()] if picture else []
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
