"""The library for programs that use HeRo robots: `from hero_client import Robot, Swarm`.

Public names are imported on first use (PEP 562), so that pure modules of this package work without ROS.
"""

# ruff: noqa: F401
# mypy: implicit-reexport
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Dict, List, Mapping

if TYPE_CHECKING:  # for editors and mypy
    from hero_node import Clock, HeroError, NodeError, Pose, ProgramError, Velocity, run
    from hero_node.ros import Program, rate, read_parameters, start_node

    from .apps.go_to_goal_server import GoToGoalServer
    from .robot import Robot
    from .robots import BaseRobot, BaseSwarm
    from .robots.common_frame import CommonFrame
    from .ros import Drivers, StopStatus
    from .swarm import Swarm, open_swarm
    from .values.background_motion import BackgroundMotion
    from .values.colors import COLORS
    from .values.errors import FrameError, GoalError, RobotError, RobotNotReadyError, StaleDataError, StoppedError
    from .values.readings import Obstacle

_NAMES = {
    "hero_client.apps.go_to_goal_server": "GoToGoalServer",
    "hero_client.robot": "Robot",
    "hero_client.robots.common_frame": "CommonFrame",
    "hero_client.robots.robot_base": "BaseRobot",
    "hero_client.robots.swarm_base": "BaseSwarm",
    "hero_client.ros.drivers": "Drivers",
    "hero_client.ros.stop_status": "StopStatus",
    "hero_client.swarm": "Swarm open_swarm",
    "hero_client.values.background_motion": "BackgroundMotion",
    "hero_client.values.colors": "COLORS",
    "hero_client.values.errors": "FrameError GoalError RobotError RobotNotReadyError StaleDataError StoppedError",
    "hero_client.values.readings": "Obstacle",
    "hero_node.clock": "Clock",
    "hero_node.command_line": "run",
    "hero_node.errors": "HeroError NodeError ProgramError",
    "hero_node.geometry": "Pose Velocity",
    "hero_node.ros.private_parameters": "read_parameters",
    "hero_node.ros.program": "Program",
    "hero_node.ros.script": "rate start_node",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = list(_MODULES)

_CHOSEN: Dict[str, Any] = {}


def choose_backend(names: Mapping[str, Any]) -> None:
    """Give programs these in place of public names that need ROS: other robots, their time and their parameters."""
    _CHOSEN.update(names)


def __getattr__(name: str) -> Any:
    if name in _CHOSEN:
        return _CHOSEN[name]
    if name not in _MODULES:
        raise AttributeError(f"hero_client has no attribute {name!r}")
    try:
        module = import_module(_MODULES[name])
    except ModuleNotFoundError as error:
        if find_spec("rospy") is not None:
            raise
        text = "hero_client.%s needs ROS; without it run the script on simulated robots: python3 -m hero_sim.in_process"
        raise ModuleNotFoundError(text % name, name=error.name) from None
    return getattr(module, name)


def __dir__() -> List[str]:
    return sorted(__all__)
