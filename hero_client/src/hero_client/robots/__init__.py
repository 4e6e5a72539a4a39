"""Robots and swarms, whatever connects them. Pure."""

from .robot_base import BaseRobot
from .swarm_base import BaseSwarm
