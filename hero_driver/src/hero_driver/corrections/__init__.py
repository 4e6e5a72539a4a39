"""Corrections of a robot's messages: odometry, stamps, transforms, ranges. Pure."""

from .message_layouts import CLAMP_TOLERANCE_M
from .robot_models import PLUS_WHEELS
from .tick_odometry import TWIST_WINDOW, WheelGeometry
