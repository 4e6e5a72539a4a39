"""The library for programs that use HeRo robots: `from hero_client import Robot, Swarm`.

Public names are imported on first use (PEP 562), so that pure modules of this package work without ROS.
"""

from importlib import import_module
from threading import Thread
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # of these mypy knows what programs may use of a robot, whatever connects it
    from .robots.robot_base import BaseRobot as BaseRobot  # noqa: PLC0414 - so that it counts as exported
    from .robots.swarm_base import BaseSwarm as BaseSwarm  # noqa: PLC0414

# The rospy of Debian 11 calls it when a script ends; its Python 3.9 no longer has it.
if not hasattr(Thread, "isAlive"):
    setattr(Thread, "isAlive", Thread.is_alive)  # noqa: B010 - mypy knows no such method

_MODULES = {
    "BackgroundMotion": "values.background_motion",
    "BaseRobot": "robots.robot_base",
    "BaseSwarm": "robots.swarm_base",
    "COLORS": "values.colors",
    "Clock": "values.clock",
    "CommonFrame": "robots.common_frame",
    "Drivers": "ros.drivers",
    "FrameError": "values.errors",
    "GoToGoalServer": "apps.go_to_goal_server",
    "GoalError": "values.errors",
    "HeroError": "values.errors",
    "NodeError": "values.errors",
    "Obstacle": "values.readings",
    "Pose": "values.geometry",
    "Program": "program",
    "ProgramError": "values.errors",
    "Robot": "robot",
    "RobotError": "values.errors",
    "RobotNotReadyError": "values.errors",
    "StaleDataError": "values.errors",
    "StopStatus": "ros.stop_status",
    "StoppedError": "values.errors",
    "Swarm": "swarm",
    "Velocity": "values.geometry",
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
