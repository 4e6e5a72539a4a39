"""Robots and drivers over ROS topics and services."""

from .drivers import Drivers, share_drivers
from .extra_topics import load_fleet_file
from .localized_poses import share_poses
from .lost_commands import find_lost_commands
from .robot_listener import NewestMessage, RobotListener, RobotTrack, follow
from .stop_status import StopStatus, paint
