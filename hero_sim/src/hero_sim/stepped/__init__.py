"""Robots stepped in process: firmware rules and driver corrections as arrays over robots, without bytes or sockets."""

from .robot_rows import RobotRows
from .swarm import StepSwarm
from .topics import LATCHED, StepTopics
