"""Shapes of the simulated world as ROS markers, for RViz and the monitor's map."""

from typing import Iterable

from visualization_msgs.msg import MarkerArray

from .scene import FRAME, Shape
from .stepped.ros_messages import encode_markers


def make_markers(shapes: Iterable[Shape], time_ns: int = 0) -> MarkerArray:
    """Return shapes as the message; time_ns: of its stamp."""
    markers: MarkerArray = MarkerArray().deserialize(encode_markers(time_ns, FRAME, shapes))
    return markers
