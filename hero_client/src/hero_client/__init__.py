"""The library for programs that use HeRo robots: `from hero_client import Robot, Swarm`.

Public names are imported on first use (PEP 562), so that pure modules of this package work without ROS.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "CommonFrame": "frames",
    "Drivers": "drivers",
    "GoToGoalServer": "go_to_goal_server",
    "GoalError": "robot",
    "Obstacle": "readings",
    "Pose": "geometry",
    "Program": "program",
    "ProgramError": "program",
    "Robot": "robot",
    "RobotError": "robot",
    "RobotNotReadyError": "robot",
    "StaleDataError": "robot",
    "Swarm": "swarm",
    "Velocity": "geometry",
    "open_swarm": "swarm",
    "read_parameters": "parameters",
    "run": "program",
}

__all__ = sorted(_MODULES)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError("hero_client has no attribute %r" % name)
    return getattr(import_module("hero_client." + _MODULES[name]), name)
