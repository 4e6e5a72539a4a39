"""The library for programs that use HeRo robots: `from hero_client import Robot, Swarm`.

Public names are imported on first use (PEP 562), so that pure modules of this package work without ROS.
"""

from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # of these mypy knows what programs may use of a robot, whatever connects it
    from .robot_base import BaseRobot as BaseRobot  # noqa: PLC0414 - so that it counts as exported
    from .swarm_base import BaseSwarm as BaseSwarm  # noqa: PLC0414

# The rospy of Debian 11 calls it when a script ends; its Python 3.9 no longer has it.
if not hasattr(Thread, "isAlive"):
    setattr(Thread, "isAlive", Thread.is_alive)  # noqa: B010 - mypy knows no such method

_MODULES = {
    "BackgroundMotion": "background_motion",
    "BaseRobot": "robot_base",
    "BaseSwarm": "swarm_base",
    "COLORS": "colors",
    "Clock": "clock",
    "CommonFrame": "common_frame",
    "Drivers": "drivers",
    "FrameError": "errors",
    "GoToGoalServer": "go_to_goal_server",
    "GoalError": "errors",
    "HeroError": "errors",
    "NodeError": "errors",
    "Obstacle": "readings",
    "Pose": "geometry",
    "Program": "program",
    "ProgramError": "errors",
    "Robot": "robot",
    "RobotError": "errors",
    "RobotNotReadyError": "errors",
    "StaleDataError": "errors",
    "StopStatus": "stop_status",
    "StoppedError": "errors",
    "Swarm": "swarm",
    "Velocity": "geometry",
    "open_swarm": "swarm",
    "rate": "script",
    "read_parameters": "parameters",
    "run": "program",
    "start_node": "script",
}

__all__ = sorted(_MODULES)  # noqa: PLE0605


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError("hero_client has no attribute %r" % name)
    return getattr(import_module("hero_client." + _MODULES[name]), name)
