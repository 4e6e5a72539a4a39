"""Corrections of a robot's messages: odometry, stamps, transforms, ranges. Pure."""

from .message_layouts import CLAMP_TOLERANCE_M
from .tick_odometry import PLUS_WHEELS, TWIST_WINDOW, WheelGeometry
