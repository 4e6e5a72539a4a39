"""A number of robots -> configuration of RViz that shows them all, as text. Pure.

Source of the format: what RViz 1.14 writes itself, cut down to what differs from its defaults. YAML is written by
yaml, so that no name can break it.
"""

from typing import Any, Dict, List, Sequence

import yaml

COLOURS = ("230; 90; 30", "40; 120; 220", "40; 160; 80", "200; 60; 160", "220; 180; 30", "80; 180; 190")


def make_robot_displays(name: str, colour: str) -> List[Dict[str, Any]]:
    """Return what is shown of one robot: its model, the way it came, what its proximity sensors see."""
    return [
        {
            "Class": "rviz/RobotModel",
            "Name": name,
            "Enabled": True,
            "Robot Description": "robot_description",
            "TF Prefix": name,
            "Update Interval": 0,
        },
        {
            "Class": "rviz/Odometry",
            "Name": name + " way",
            "Enabled": True,
            "Topic": "/%s/odom" % name,
            "Unreliable": False,
            "Keep": 300,
            "Position Tolerance": 0.02,
            "Angle Tolerance": 0.2,
            "Covariance": {"Value": False},
            "Shape": {
                "Value": "Arrow",
                "Color": colour,
                "Alpha": 0.6,
                "Shaft Length": 0.012,
                "Shaft Radius": 0.002,
                "Head Length": 0.008,
                "Head Radius": 0.005,
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
            "Color": colour,
            "Decay Time": 0,
        },
    ]


def make_config(names: Sequence[str], fixed_frame: str) -> str:
    """Return the configuration for robots with these names (hero_0, ...), seen in fixed_frame."""
    displays: List[Dict[str, Any]] = [
        {
            "Class": "rviz/Grid",
            "Name": "Grid",
            "Enabled": True,
            "Cell Size": 0.1,
            "Plane Cell Count": 40,
            "Color": "200; 200; 200",
            "Alpha": 0.5,
        }
    ]
    for index, name in enumerate(names):
        displays += make_robot_displays(name, COLOURS[index % len(COLOURS)])
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
                "Fixed Frame": fixed_frame,
                "Frame Rate": 20,
            },
            "Tools": [
                {"Class": "rviz/MoveCamera"},
                {"Class": "rviz/Select"},
                {"Class": "rviz/FocusCamera"},
                {"Class": "rviz/Measure"},
            ],
            "Views": {
                "Current": {
                    "Class": "rviz/Orbit",
                    "Distance": 2.6,
                    "Pitch": 1.0,
                    "Yaw": 4.71,
                    "Focal Point": {"X": 0.0, "Y": 0.0, "Z": 0.0},
                    "Target Frame": "<Fixed Frame>",
                }
            },
        },
        "Window Geometry": {"Width": 1200, "Height": 800},
    }
    return str(yaml.safe_dump(config, sort_keys=False, default_flow_style=False))
