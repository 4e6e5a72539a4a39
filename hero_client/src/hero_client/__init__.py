"""The library for programs that use HeRo robots: `from hero_client import Robot, Swarm`.

Public names are imported on first use (PEP 562), so that pure modules of this package work without ROS.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, List

if TYPE_CHECKING:  # for editors and mypy
    from hero_node.clock import Clock
    from hero_node.command_line import run
    from hero_node.errors import HeroError, NodeError, ProgramError
    from hero_node.geometry import Pose, Velocity
    from hero_node.ros.private_parameters import read_parameters
    from hero_node.ros.program import Program
    from hero_node.ros.script import rate, start_node

    from .apps.go_to_goal_server import GoToGoalServer
    from .robot import Robot
    from .robots.common_frame import CommonFrame
    from .robots.robot_base import BaseRobot
    from .robots.swarm_base import BaseSwarm
    from .ros.drivers import Drivers
    from .ros.stop_status import StopStatus
    from .swarm import Swarm, open_swarm
    from .values.background_motion import BackgroundMotion
    from .values.colors import COLORS
    from .values.errors import (
        FrameError,
        GoalError,
        RobotError,
        RobotNotReadyError,
        StaleDataError,
        StoppedError,
    )
    from .values.readings import Obstacle

__all__ = [
    "COLORS",
    "BackgroundMotion",
    "BaseRobot",
    "BaseSwarm",
    "Clock",
    "CommonFrame",
    "Drivers",
    "FrameError",
    "GoToGoalServer",
    "GoalError",
    "HeroError",
    "NodeError",
    "Obstacle",
    "Pose",
    "Program",
    "ProgramError",
    "Robot",
    "RobotError",
    "RobotNotReadyError",
    "StaleDataError",
    "StopStatus",
    "StoppedError",
    "Swarm",
    "Velocity",
    "open_swarm",
    "rate",
    "read_parameters",
    "run",
    "start_node",
]

_MODULES = {
    "BackgroundMotion": "hero_client.values.background_motion",
    "BaseRobot": "hero_client.robots.robot_base",
    "BaseSwarm": "hero_client.robots.swarm_base",
    "COLORS": "hero_client.values.colors",
    "Clock": "hero_node.clock",
    "CommonFrame": "hero_client.robots.common_frame",
    "Drivers": "hero_client.ros.drivers",
    "FrameError": "hero_client.values.errors",
    "GoToGoalServer": "hero_client.apps.go_to_goal_server",
    "GoalError": "hero_client.values.errors",
    "HeroError": "hero_node.errors",
    "NodeError": "hero_node.errors",
    "Obstacle": "hero_client.values.readings",
    "Pose": "hero_node.geometry",
    "Program": "hero_node.ros.program",
    "ProgramError": "hero_node.errors",
    "Robot": "hero_client.robot",
    "RobotError": "hero_client.values.errors",
    "RobotNotReadyError": "hero_client.values.errors",
    "StaleDataError": "hero_client.values.errors",
    "StopStatus": "hero_client.ros.stop_status",
    "StoppedError": "hero_client.values.errors",
    "Swarm": "hero_client.swarm",
    "Velocity": "hero_node.geometry",
    "open_swarm": "hero_client.swarm",
    "rate": "hero_node.ros.script",
    "read_parameters": "hero_node.ros.private_parameters",
    "run": "hero_node.command_line",
    "start_node": "hero_node.ros.script",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError("hero_client has no attribute %r" % name)
    try:
        module = import_module(_MODULES[name])
    except ModuleNotFoundError as error:
        if find_spec("rospy") is not None:
            raise
        text = "hero_client.%s needs ROS; without it run the script on simulated robots: python3 -m hero_sim.in_process"
        raise ModuleNotFoundError(text % name, name=error.name) from None
    return getattr(module, name)


def __dir__() -> List[str]:
    return __all__
